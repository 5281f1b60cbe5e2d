"""Builds the IR: one action for each rule of the grammar, called with the reader, the rule's span and its parts.

All actions share `reader`. `literals`, `conditions`, `site`, `skills`, `policies` and `tests` have the actions, and
`actions` gathers them. A rule whose parts are the fields of one node is a row in the table `FORMS` of its module.
"""
