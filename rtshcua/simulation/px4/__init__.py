"""The behaviour that is specific to PX4. Each file has a counterpart in `ardupilot`."""
