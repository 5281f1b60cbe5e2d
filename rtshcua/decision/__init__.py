"""Design section 4: the one function that decides, and what it needs. Pure; one file for each kind of rule.

`prepare` checks a policy and a mission once and compiles them; `decide` then decides as often as asked; `fallbacks`
says what flies when it refuses; `watch` looks while a skill runs; `nearest` says what would have passed.
"""
