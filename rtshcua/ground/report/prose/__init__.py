"""Every construct of the language in plain English: the one place where that is done.

Names of the sources stand between backticks, as in messages; a page may turn these into links. Sentences begin with a
capital and end in a full stop; what stands within a sentence does neither.
"""
