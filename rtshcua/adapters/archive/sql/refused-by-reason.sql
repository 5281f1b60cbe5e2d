-- how often each reason refused, on how many vehicles, and how much of it no witness holds
SELECT outcome, reason, COUNT(*) AS refusals, COUNT(DISTINCT vehicle) AS vehicles, COUNT(DISTINCT log) AS logs,
  SUM(CASE WHEN witness = 'witnessed' THEN 0 ELSE 1 END) AS unwitnessed
FROM decided
WHERE outcome <> 'allow'
GROUP BY outcome, reason
ORDER BY refusals DESC, outcome, reason
