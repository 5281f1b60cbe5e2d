"""What a source says: frozen, strict pydantic nodes, each with its source span. Names are still unresolved here.

`node` the base, `expression` conditions and values, `signals`, `places` (zones, vehicle), `skills`, `policies`,
`missions`, `program` a file and its import closure.
"""
