"""Size limits of files, in a module of their own that imports no model."""

import re

#: a string without escapes, closed or not
_TEXT = re.compile(rb'"[^"]*"?')

MAX_SIZE = 8 << 20  # bytes or characters of one file
MAX_TOKENS = 500_000  # tokens of one file: more than 100,000 lines of ordinary source
MAX_FILES = 4_096  # of one program


def without_texts(data: bytes, most: int) -> bytes | None:
    """Return JSON without its strings; None if it has more than `most` values (objects, lists, strings, numbers).

    No value is built before the check: millions of values take seconds and hundreds of megabytes.
    """
    bare = bare_of(data, most)
    return None if bare is None or values_of(bare) > most else bare


def bare_of(data: bytes, most: int) -> bytes | None:
    """Return JSON without its strings; None if it has more strings than `most` values could have."""
    if data.count(b'"') > 4 * most:  # a value and its key have four quotes at most, apart from escaped ones
        return None
    return _TEXT.sub(b"", data.replace(b"\\\\", b"").replace(b'\\"', b""))


def values_of(bare: bytes) -> int:
    """Count the values of JSON without strings: each one follows a comma or opens an object or a list."""
    return sum(map(bare.count, (b",", b"[", b"{")))
