-- each decision that was not `allow`: which vehicle was refused what, when, why, under which policy version
SELECT utc_us, vehicle, mission, skill, what, outcome, reason, clause, policy, policy_version, witness, log, seq
FROM decided
WHERE outcome <> 'allow'
ORDER BY utc_us, log, seq
