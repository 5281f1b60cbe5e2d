"""The published evaluation (X1 to X7), run by this system: what is measured, the raw data, and the report beside the
published figures.
"""
