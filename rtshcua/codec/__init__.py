"""Messages of the dialect as objects, over pymavlink: frames to messages and back, and messages longer than a frame.

Shared by the adapters and the simulated vehicle. Facts of MAVLink that need no pymavlink are in `rtshcua.mavlink`.
"""
