"""The runtime: mission queue, state monitor, supervisor, fallbacks. Sans-I/O: events in, actions out."""
