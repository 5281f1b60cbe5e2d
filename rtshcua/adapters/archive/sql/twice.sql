-- bundles of which two flights of one vehicle each began a step: what it kept of used ones was emptied, put back or made anew
SELECT a.vehicle, a.mission, a.bundle_digest, a.log AS one, a.begun_us AS one_begun_us, b.log AS other, b.begun_us AS other_begun_us
FROM logs a
JOIN logs b ON a.vehicle = b.vehicle AND a.bundle_digest = b.bundle_digest AND a.log < b.log AND a.boot <> b.boot
WHERE a.log IN (SELECT log FROM happened WHERE event = 'dispatched' AND kind = 0)
  AND b.log IN (SELECT log FROM happened WHERE event = 'dispatched' AND kind = 0)
ORDER BY a.vehicle, a.log, b.log
