-- logs that say another one came before, which is not in the archive: it is missing
SELECT l.vehicle, l.log, l.begun_us, l.before AS missing_leaf
FROM logs l
LEFT JOIN (SELECT vehicle, last_leaf FROM logs WHERE status IN ('verified', 'incomplete')) p
  ON p.last_leaf = l.before AND p.vehicle = l.vehicle
WHERE l.status IN ('verified', 'incomplete') AND l.before IS NOT NULL AND p.last_leaf IS NULL
ORDER BY l.vehicle, l.begun_us, l.log
