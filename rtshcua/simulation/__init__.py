"""The simulated vehicle: a multirotor that speaks MAVLink 2 and flies as PX4 or as ArduCopter.

The core (`world.Simulation`) is stepped by explicit time and touches nothing; `process` is the thin shell around it
that speaks UDP. Inside, lengths are floats in metres: nothing here decides, signs or records.
"""
