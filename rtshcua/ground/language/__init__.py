"""The language: from text to typed IR. `parse` parses one text, `load` loads a file and its imports.

`grammar/rtshcua.lark` is the grammar. `generate` makes its LALR table with Lark, `automaton` parses with that table,
and `build` makes the IR.
"""
