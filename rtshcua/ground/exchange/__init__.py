"""Files of other programs read into sources of the language."""
