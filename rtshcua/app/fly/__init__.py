"""A flight: a row of stages from a signed bundle to a closed log, each from one typed result to the next."""
