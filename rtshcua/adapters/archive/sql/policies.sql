-- which versions of which policy decided where, from when to when
SELECT policy, policy_version, COUNT(DISTINCT vehicle) AS vehicles, COUNT(DISTINCT log) AS logs, COUNT(*) AS decisions,
  SUM(CASE WHEN outcome <> 'allow' THEN 1 ELSE 0 END) AS refusals, MIN(utc_us) AS first_us, MAX(utc_us) AS last_us
FROM decided
GROUP BY policy, policy_version
ORDER BY policy, policy_version
