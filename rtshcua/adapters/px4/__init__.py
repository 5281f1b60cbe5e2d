"""PX4: how it is commanded (facts: PX4's `Commander` and `Navigator`, recorded answers of PX4 1.16)."""
