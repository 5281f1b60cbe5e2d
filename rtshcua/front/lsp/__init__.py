"""The language server: the editor's protocol (LSP 3.17) over pygls, around the pure answers of `rtshcua.ground.editor`.

`server` puts it together, `session` holds what is open and tells what is found, `features` answers, `convert` turns our
places and findings into those of the protocol. `proving` keeps the process in which the long proofs run: `prover`.
"""
