"""Makes the IR: an action for each rule of the grammar, called with the reader, the rule's span and its parts.

`reader` is what all actions share; `literals`, `conditions`, `site`, `skills`, `policies` and `tests` have the actions,
which `actions` gathers. A rule whose parts are the fields of one node is a row in the table `FORMS` of its module.
"""
