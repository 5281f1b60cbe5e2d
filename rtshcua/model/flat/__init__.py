"""The flat form (design section 4.5): the contents of a bundle, which `decide` evaluates. Integers, bytes and short
texts only.

Every struct is array-like, so its wire form is a CBOR array in field order. `code` instructions and clauses,
`zone`, `signal`, `contract`, `policy`, `mission`, `vehicle`.
"""
