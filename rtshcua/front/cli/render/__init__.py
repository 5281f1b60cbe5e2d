"""How commands show results: text, JSON, tables, and the live view of a flight."""
