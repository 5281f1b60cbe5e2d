"""What must be true of sources before anything is lowered: names, types, and the checks by their codes."""
