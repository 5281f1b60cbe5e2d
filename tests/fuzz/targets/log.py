"""The lines of an evidence log, raw; or linked and signed again, as by a holder of the log key.

The first byte is 0 for raw lines.
"""

import json
from functools import cache
from random import Random

from fuzz.mutation.trees import mutated_json
from reference import forgery
from rtshcua.diagnostics.excerpt import visible
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import encode

MAX_LENGTH = 400_000


@cache
def seeds() -> tuple[bytes, ...]:
    first, *rest, last = forgery.flight()
    other = forgery.other_flight()
    logs = [[first, *rest, last], [first, *rest[:6], last], [first, last], list(other), [first, *other[1:9], last]]
    return tuple(bytes([mode]) + b"".join(log) for log in logs for mode in (0, 1))


def mutated(data: bytes, of: Random) -> bytes:
    """Change, remove or duplicate a line."""
    lines = data[1:].splitlines(keepends=True)
    if not lines:
        return data
    at = of.randrange(len(lines))
    match of.randrange(6):
        case 0:
            del lines[at]
        case 1:
            lines.insert(of.randrange(len(lines)), lines[at])
        case _:
            lines[at] = forgery.write(_object(mutated_json(lines[at], of))) if of.random() < 0.8 else lines[at][:-2]
    return data[:1] + b"".join(lines)


def _object(line: bytes) -> dict[str, object]:
    try:
        found = forgery.read(line)
    except ValueError:
        return {}
    return json.loads(json.dumps(found).replace("\\ud800", "")) if isinstance(found, dict) else {}


def one(data: bytes) -> None:
    lines = data[1:].splitlines(keepends=True)
    for line in lines:
        record = read(line)
        assert isinstance(record, Flaw) or encode(record) == line
        if isinstance(record, Flaw):
            assert visible(record.text).isprintable()
    if data[:1] != b"\0":
        try:
            lines = forgery.signed(lines)
        except (ValueError, LookupError, TypeError, AttributeError, RecursionError):
            return  # no log at all, so there is nothing to sign
    forgery.prove(lines)
