"""Findings and outcomes in the forms that other programs read: SARIF, GitHub's workflow commands, JUnit."""
