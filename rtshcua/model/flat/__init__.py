"""The flat form of design section 4.5: what a bundle carries and what `decide` evaluates. Integers, bytes and
short texts only.

Every struct is array-like, so its wire form is a CBOR array in field order. `code` instructions and clauses, `zone`,
`signal`, `contract`, `policy`, `mission`, `vehicle`.
"""
