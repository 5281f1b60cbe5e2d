"""Facts of MAVLink 2, for whoever reads or makes frames: no judgement, no pymavlink, no clock and no socket.

Framing, layouts, numbers and flight modes, signing, quantisation, the dialect as a value and the tlog format. The gate,
the auditor, the adapters and the simulated vehicle read the same facts; what they conclude is written by each apart.
Tests compare the facts with pymavlink's dialect.
"""
