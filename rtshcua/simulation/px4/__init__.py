"""What PX4 does its own way. Each file has a twin in `ardupilot`."""
