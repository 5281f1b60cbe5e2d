"""A MAVLink vehicle, whatever its flavour: telemetry, commands and their outcomes, manoeuvres, the UDP link.

`udp` is the socket, `driver` what is behind it, and the other modules are its parts: what comes in (`link`,
`source_time`, `telemetry`, `observed`, `texts`), what has to be settled before a flight (`streams`, `preflight`,
`parameters`, `fence`), and how a command is flown (`manoeuvre`, of the stages in `flavour`, ended by `effects`, watched
by `supervision`). `messages` makes what is sent.

What differs between PX4 and ArduCopter is in the parallel packages `adapters.px4` and `adapters.ardupilot`.
"""
