"""The formatter of sources: one style. It keeps every comment, and refuses a text rather than change its meaning.

`token_reader` finds tokens and items with the parser's table. `token_sheet` describes the gaps between tokens and
their comments. `line_layout` makes lines by the tables in `style`. `format_text` runs these and compares the result
with the original. `format` adds the parser's findings on a text that cannot be formatted.
`docs/formatting.md` shows the style.
"""
