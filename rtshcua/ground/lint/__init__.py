"""Lint rules: warnings about sources that compile and deserve a second look.

`linter` runs the rules, each a function from a `LintInput` to findings. They report only files that were requested,
never the files that these import. `filter` removes what comments (`ignores`) or the configuration ignore.
"""
