-- logs of one vehicle that both say they come right after the same log: a flight was copied, or its state set back
SELECT a.vehicle, a.before AS after_leaf, a.log AS one, a.begun_us AS one_begun_us, b.log AS other, b.begun_us AS other_begun_us
FROM logs a
JOIN logs b ON a.vehicle = b.vehicle AND a.before = b.before AND a.log < b.log AND a.boot <> b.boot
WHERE a.status IN ('verified', 'incomplete') AND b.status IN ('verified', 'incomplete')
ORDER BY a.vehicle, a.log, b.log
