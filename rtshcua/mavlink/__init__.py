"""Facts of MAVLink 2 for code that reads or makes frames, without pymavlink, clock or socket.

Framing, layouts, numbers and flight modes, signing, quantisation, the dialect as a value and the tlog format. The
gate, the auditor, the adapters and the simulated vehicle share these facts, but each has rules of its own. Tests
compare the facts with pymavlink's dialect.
"""
