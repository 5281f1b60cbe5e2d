"""What ArduCopter does its own way. Each file has a twin in `px4`."""
