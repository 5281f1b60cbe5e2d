"""Proofs of single records of a log, and of its growth, in files that verify alone (docs/proofs.md). Pure."""
