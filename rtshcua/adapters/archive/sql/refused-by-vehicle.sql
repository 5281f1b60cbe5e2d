-- how often each vehicle was refused what, for which reason, under which policy version, and when first and last
SELECT vehicle, policy, policy_version, skill, outcome, reason, COUNT(*) AS refusals, COUNT(DISTINCT log) AS logs,
  MIN(utc_us) AS first_us, MAX(utc_us) AS last_us
FROM decided
WHERE outcome <> 'allow'
GROUP BY vehicle, policy, policy_version, skill, outcome, reason
ORDER BY refusals DESC, vehicle, policy, policy_version, skill, outcome, reason
