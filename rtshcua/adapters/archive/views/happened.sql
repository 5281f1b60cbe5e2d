-- every effect of the logs that are to be believed, with what became of its log
SELECT
  e.log, e.seq, e.vehicle, e.mission, e.at_us, e.utc_us, e.utc_error_us, e.utc_day, e.event, e.detail,
  e.kind, e.step, e.link, e.skill, e.token, e.durability, l.status, l.checked,
  CASE WHEN e.seq < l.anchored THEN 'witnessed' ELSE 'unwitnessed' END AS witness
FROM effects e
JOIN logs l ON e.log = l.log
WHERE l.status IN ('verified', 'incomplete')
