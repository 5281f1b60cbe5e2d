"""Records, documents and values in words, for terminals and pages. Nothing is verified here."""
