-- the logs that did not verify to a signed close, and why
SELECT log, name, status, finding, finding_record, finding_text, vehicle, begun_us
FROM logs
WHERE status <> 'verified'
ORDER BY status, begun_us, log
