"""PX4: modes and commands (facts: PX4's `Commander` and `Navigator`, recorded answers of PX4 1.16)."""
