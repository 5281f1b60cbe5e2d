"""Findings and outcomes in formats of other programs: SARIF, GitHub workflow commands, JUnit."""
