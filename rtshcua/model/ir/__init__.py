"""What a source says: frozen nodes, each with its source span. Names are still unresolved here.

`node` the base, `expression` conditions and values, `signals`, `places` (zones, vehicle), `skills`, `policies`,
`missions`, `tests`, `program` a file and its import closure.
"""
