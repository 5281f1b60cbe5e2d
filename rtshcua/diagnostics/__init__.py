"""Diagnostics: spans, stable codes, findings, refusals, exit codes. The lowest layer."""
