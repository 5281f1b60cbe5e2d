"""Witnesses: what a log submits to them, what they refuse and cosign, what their cosignatures anchor (ADR 28). Pure."""
