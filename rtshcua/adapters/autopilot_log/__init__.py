"""Read the log that an autopilot itself writes: PX4's ULog and ArduPilot's DataFlash.

The libraries that parse them (pyulog, pymavlink) were not made for hostile files: some need time or memory without
bound. They run in a process of their own with limits (`python -m rtshcua.adapters.autopilot_log`).
"""
