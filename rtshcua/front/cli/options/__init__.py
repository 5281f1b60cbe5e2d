"""Options that several commands share, and what is known about the options of all."""
