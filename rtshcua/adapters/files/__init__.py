"""Files: the evidence log, the run folder, the replay store, the key store. What must survive a crash is synced."""
