"""Elaboration: templates, delegations, repetitions and mission parameters become plain rules and steps.

It maps IR to IR, between loading and checking, so that later stages do not see these constructs. Nodes keep their
source spans; `Rule.origin` has the `use` and the `delegate` from which a rule was made.
"""
