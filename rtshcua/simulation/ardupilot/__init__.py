"""The behaviour that is specific to ArduCopter. Each file has a counterpart in `px4`."""
