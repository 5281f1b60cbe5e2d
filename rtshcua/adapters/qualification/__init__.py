"""The qualification: sorties with the user's own vehicle, the observations in them, and the checks of what the adapters
assume.
"""
