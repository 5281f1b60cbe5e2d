"""Is a flat policy or mission well-formed? A signature says who made a bundle, not that it makes sense.

Each function yields what is wrong, worst first; `prepare` refuses on the first. Nothing yielded means that compiling
and deciding cannot fail.
"""
