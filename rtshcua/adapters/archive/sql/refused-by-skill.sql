-- how often each skill was asked for and refused, on how many vehicles
SELECT skill, COUNT(*) AS decisions, SUM(CASE WHEN outcome <> 'allow' THEN 1 ELSE 0 END) AS refusals,
  COUNT(DISTINCT CASE WHEN outcome <> 'allow' THEN vehicle END) AS vehicles
FROM decided
GROUP BY skill
ORDER BY refusals DESC, skill
