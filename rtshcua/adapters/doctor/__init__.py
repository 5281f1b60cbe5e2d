"""The doctor: what a vehicle supports, and what would stop a mission. It asks, listens, and moves nothing."""
