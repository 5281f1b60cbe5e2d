"""The decision function (design section 4) and everything that it needs. Pure, with one module for each kind of rule.

`prepare` checks a policy and a mission once and compiles them, and `decide` then decides as often as needed.
`fallbacks` selects the link that flies after a refusal, `watch` monitors a skill while it runs, and `nearest`
computes the smallest change with which a refused request would have passed.
"""
