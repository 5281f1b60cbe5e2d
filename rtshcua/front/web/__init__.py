"""A page of a flight on the loopback interface, which grows while it flies."""
