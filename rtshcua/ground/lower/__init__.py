"""Lower checked sources to the flat form: `policy` lowers a policy, `mission` a mission under it."""
