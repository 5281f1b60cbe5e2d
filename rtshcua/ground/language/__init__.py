"""The language: text to typed IR. `parse` one text, `load` a file and all it imports.

`grammar/rtshcua.lark` is the grammar; `generate` has Lark make the LALR table of it, `automaton` runs on that table,
`build` makes the IR.
"""
