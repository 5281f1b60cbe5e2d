"""The formatter of sources: one style, every comment kept, and a refusal rather than a change of meaning.

`token_reader` runs the parser's table and notes where tokens and items are; `token_sheet` says what stands between
the tokens, comments included; `line_layout` makes lines of them by the tables in `style`; `format_text` does all of
that and compares the result with the original. `format` adds the parser's findings on a text that cannot be
formatted. `docs/formatting.md` shows the style.
"""
