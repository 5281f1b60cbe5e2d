-- how often each rule of the decision (integrity, freshness, authority, ...) refused
SELECT rule_step, rule, outcome, COUNT(*) AS refusals, COUNT(DISTINCT vehicle) AS vehicles
FROM decided
WHERE outcome <> 'allow'
GROUP BY rule_step, rule, outcome
ORDER BY rule_step, rule, outcome
