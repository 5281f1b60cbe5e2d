"""Witnesses: what a log shows them, what they refuse and cosign, what their cosignatures anchor (ADR 28). Pure."""
