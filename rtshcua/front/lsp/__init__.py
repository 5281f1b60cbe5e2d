"""The language server: the editor's protocol (LSP 3.17) over pygls, around the pure answers of `rtshcua.ground.editor`.

`server` puts it together, `session` holds what is open (`texts`, `disk`) and publishes what is found, `features`
answers; `prover` is the process in which the long proofs run.
"""
