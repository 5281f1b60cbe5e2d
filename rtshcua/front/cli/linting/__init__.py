"""`rtshcua lint`: what it remembers, what it examines anew, what it ignores, fixes and reports."""
