-- how often each clause of a policy or contract refused, on how many vehicles
SELECT policy, policy_version, clause, reason, COUNT(*) AS refusals, COUNT(DISTINCT vehicle) AS vehicles
FROM decided
WHERE outcome <> 'allow' AND clause IS NOT NULL
GROUP BY policy, policy_version, clause, reason
ORDER BY refusals DESC, policy, policy_version, clause, reason
