-- how many decisions a day (UTC), and how many of them refused
SELECT utc_day, COUNT(*) AS decisions, SUM(CASE WHEN outcome <> 'allow' THEN 1 ELSE 0 END) AS refusals,
  COUNT(DISTINCT vehicle) AS vehicles
FROM decided
GROUP BY utc_day
ORDER BY utc_day
