-- what happened, by event: how often, on how many vehicles
SELECT event, COUNT(*) AS times, COUNT(DISTINCT vehicle) AS vehicles, COUNT(DISTINCT log) AS logs
FROM happened
GROUP BY event
ORDER BY times DESC, event
