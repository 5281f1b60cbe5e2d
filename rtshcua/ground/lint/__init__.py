"""Lint rules: warnings about sources that compile and deserve a second look.

`lint` runs the rules, each a function from a `LintInput` to findings. They report only files that were requested, never
the files that these import. `filter` removes the findings that comments (`ignores`) or the configuration ignore.
"""
