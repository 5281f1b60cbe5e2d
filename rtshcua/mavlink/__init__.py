"""MAVLink 2: the dialect as a value, frames, quantisation of what arrives, and the tlog format.

Shared by the adapters and the simulated vehicle. Importing this package imports nothing else.
"""
