"""The software on the vehicle: admission, supervision, dispatch. It contains no parser, no compiler, and no key that
signs a mission.
"""
