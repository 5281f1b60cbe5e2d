"""The qualification: sorties on the user's own vehicle, what was observed in them, and what that says of each thing
that the adapters take for granted.
"""
