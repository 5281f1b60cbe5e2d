"""How large a file may be; apart, so that whoever asks only for that imports no model."""

import re

#: a text without escapes, closed or not: what is not closed is looked at once
_TEXT = re.compile(rb'"[^"]*"?')

MAX_SIZE = 8 << 20  # bytes or characters of one file
MAX_TOKENS = 500_000  # words, numbers, texts and marks of one file: above 100,000 lines as people write them
MAX_FILES = 4_096  # of one program


def without_texts(data: bytes, most: int) -> bytes | None:
    """JSON without its texts and keys; None where it has more than `most` values (objects, lists, texts, numbers).

    That is found out before any of them is built: reading millions takes seconds and hundreds of megabytes.
    """
    bare = bare_of(data, most)
    return None if bare is None or values_of(bare) > most else bare


def bare_of(data: bytes, most: int) -> bytes | None:
    """JSON without its texts and keys; None where it has more of those than `most` values have."""
    if data.count(b'"') > 4 * most:  # a value may have a key, and a text has two quotes; few have more of them inside
        return None
    return _TEXT.sub(b"", data.replace(b"\\\\", b"").replace(b'\\"', b""))


def values_of(bare: bytes) -> int:
    """How many values JSON without texts has: each but the first of an object or a list is behind a comma."""
    return sum(map(bare.count, (b",", b"[", b"{")))
