"""What an editor asks of sources while they are written: pure answers over texts, positions as character offsets.

`positions` is the one place that knows how editors count; `pieces` parses again what an edit changed; `desk` holds what
is open. The shell that speaks the protocol is `rtshcua.front.lsp`.
"""
