"""Makes the IR: one method for each rule of the grammar, called with the rule's span and its parts.

`base` what all share, `literals` numbers and texts, `conditions`, `signals`, `zones`, `vehicles`, `skills`,
`policies`, `tests`, and `missions`, where the `Builder` is whole.
"""
