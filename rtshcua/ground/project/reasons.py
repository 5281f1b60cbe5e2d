"""What counts as a reason, wherever something is ignored: in a comment, or in a configuration."""

#: a reason has at least so many letters and digits
SHORTEST = 3


def says_why(reason: str) -> bool:
    """Whether a text can be a reason: it has letters. Points and marks alone say nothing, seen or unseen."""
    return sum(map(str.isalnum, reason)) >= SHORTEST and any(map(str.isalpha, reason))
