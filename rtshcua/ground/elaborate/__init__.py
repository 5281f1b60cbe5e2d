"""Elaboration: templates, delegations, repetitions and a mission's parameters become plain rules and steps.

From IR to IR, between loading and checking, so that nothing after it knows of these constructs. Nodes keep the spans of
what they were written as; `Rule.origin` says through which `use` and `delegate` a rule came to be.
"""
