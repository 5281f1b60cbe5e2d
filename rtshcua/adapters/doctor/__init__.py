"""The doctor examines what a vehicle supports and what would stop a mission. It asks and listens; it moves nothing."""
