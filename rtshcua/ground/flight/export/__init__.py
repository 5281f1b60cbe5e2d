"""A flight as a file for other programs: one module a format, each a pure function of a `FlightExport`."""
