"""Editor features for sources: pure functions over texts, with positions as character offsets.

`workspace` holds the open texts, `incremental_parse` parses only what an edit changed, `positions` converts to the
positions of the protocol. `rtshcua.front.lsp` implements the protocol.
"""
