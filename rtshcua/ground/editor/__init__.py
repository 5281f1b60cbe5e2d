"""What an editor asks of sources while they are written: pure answers over texts, positions as character offsets.

`workspace` holds the open texts, `incremental_parse` parses again only what an edit changed, `positions` is the one
place that knows how editors count. `rtshcua.front.lsp` speaks the protocol.
"""
