"""A policy against an earlier one of its name: what it means, what differs, and whether its version says so."""
