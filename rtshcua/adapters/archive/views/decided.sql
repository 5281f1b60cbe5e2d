-- every decision of the logs that are to be believed, with what became of its log
SELECT
  d.log, d.seq, d.vehicle, d.mission, d.policy, d.policy_version, d.at_us, d.utc_us, d.utc_error_us, d.utc_day,
  d.kind, d.step, d.link, d.skill, d.what, d.outcome, d.reason, d.rule, d.rule_step, d.clause, d.clause_source,
  d.clause_start, d.target, d.durability, l.status, l.checked,
  CASE WHEN d.seq < l.anchored THEN 'witnessed' ELSE 'unwitnessed' END AS witness
FROM decisions d
JOIN logs l ON d.log = l.log
WHERE l.status IN ('verified', 'incomplete')
