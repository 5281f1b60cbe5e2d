"""Options shared by several commands, and tables about the options of all commands."""
