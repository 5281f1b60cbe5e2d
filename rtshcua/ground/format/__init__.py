"""One style for sources: `formatted` lays a text out anew, keeps every comment, and refuses rather than change meaning.

`read` runs the parser's own table and notes where tokens and items are; `sheet` says what stands between the tokens,
`comments` included; `layout` makes lines of them on a `page`, by the tables in `style`; `align` pads columns; `same`
compares what came of it with what was there. `attempt` is all of that, `format` adds the parser's findings on what it
does not take, `finding` is what lint and editor say. `docs/formatting.md` shows the style.
"""
