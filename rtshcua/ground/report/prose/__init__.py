"""Describes every construct of the language in plain English.

Names of the sources are in backticks, as in messages; a page may turn them into links. Sentences begin with a capital
letter and end with a full stop; parts of sentences do not.
"""
