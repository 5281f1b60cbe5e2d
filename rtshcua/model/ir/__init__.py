"""The contents of a source: frozen nodes, each with its source span. Names are still unresolved.

`node` the base, `expression` conditions and values, `signals`, `places` (zones, vehicle), `skills`, `policies`,
`missions`, `tests`, `program` a file and its import closure.
"""
