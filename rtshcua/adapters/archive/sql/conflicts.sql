-- two logs of one boot that were signed at the same record over different trees: one of them was written anew
SELECT a.vehicle, a.boot, MIN(a.seq) AS seq, a.log AS one, b.log AS other
FROM seals a
JOIN seals b ON a.vehicle = b.vehicle AND a.boot = b.boot AND a.seq = b.seq AND a.log < b.log
JOIN logs la ON la.log = a.log
JOIN logs lb ON lb.log = b.log
WHERE (a.root <> b.root OR a.self <> b.self) AND la.status IN ('verified', 'incomplete') AND lb.status IN ('verified', 'incomplete')
GROUP BY a.vehicle, a.boot, a.log, b.log
ORDER BY a.vehicle, a.boot, a.log, b.log
