"""A MAVLink vehicle, whatever its flavour: telemetry, commands and their outcomes, manoeuvres, the UDP link.

What differs between PX4 and ArduCopter is in the parallel packages `adapters.px4` and `adapters.ardupilot`.
"""
