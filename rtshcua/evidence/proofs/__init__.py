"""Proofs of single records of a log, and of its growth, as files that can be verified without the log
(docs/proofs.md). Pure.
"""
