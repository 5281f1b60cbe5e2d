-- how many records of each believed log no witness holds
SELECT vehicle, log, begun_us, records, anchored, records - anchored AS unanchored
FROM logs
WHERE status IN ('verified', 'incomplete') AND anchored < records
ORDER BY unanchored DESC, log
