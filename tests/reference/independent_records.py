"""An independent reader of lines and records (docs/log-format.md, sections 1 and 4), with the standard library only."""

import base64
import binascii
import json
import re

LONGEST = 1 << 26  # octets of a line, its newline included
LARGEST = (1 << 53) - 1
SIGNED = frozenset({"genesis", "seal", "recover", "close"})

_KEY = re.compile(r"[a-z_]+", re.ASCII)
_HEX = re.compile(r"(?:[0-9a-f]{2})*", re.ASCII)


class Malformed(ValueError):
    """A line that is not a record."""


def unbase64(text: str) -> bytes:
    """The octets of canonical, padded base64. Raises `Malformed`."""
    try:
        data = base64.b64decode(text.encode("ascii"), validate=True)
    except (binascii.Error, UnicodeEncodeError) as error:
        raise Malformed("not base64") from error
    if base64.b64encode(data).decode() != text:
        raise Malformed("not canonical base64")
    return data


def canonical(value: object) -> bytes:
    """The JCS encoding of a value of the kinds in logs; all keys are ASCII, so they sort by code point."""
    return json.dumps(value, ensure_ascii=False, separators=(",", ":"), sort_keys=True).encode()


def parse(line: bytes) -> dict:
    """The record of one line, its newline included. Raises `Malformed`."""
    if len(line) > LONGEST or not line.endswith(b"\n"):
        raise Malformed("too long, or not ended")
    try:
        record = json.loads(line[:-1].decode(), object_pairs_hook=_object, parse_float=_refuse, parse_constant=_refuse)
        same = canonical(record) == line[:-1]
    except (ValueError, RecursionError) as error:
        raise Malformed("not JSON of this form") from error
    if not same or not isinstance(record, dict):
        raise Malformed("not canonical")
    form = FORMS.get(record.get("type") if isinstance(record.get("type"), str) else "")
    if form is None or set(record) != set(form):
        raise Malformed("not the fields of a type")
    for name, holds in form.items():
        if not holds(record[name]):
            raise Malformed(f"{name} is not as it must be")
    return record


def _object(pairs: list[tuple[str, object]]) -> dict:
    names = [name for name, _ in pairs]
    if len(set(names)) != len(names):
        raise Malformed("a key twice")
    if not all(_KEY.fullmatch(name) for name in names):
        raise Malformed("another key")
    return dict(pairs)


def _refuse(text: str) -> None:
    raise Malformed(f"{text} has no place here")


def integer(value: object) -> bool:
    """An integer that a double can represent; no boolean."""
    return type(value) is int and -LARGEST <= value <= LARGEST


def count(value: object) -> bool:
    """An integer of at least 0."""
    return integer(value) and value >= 0


def text(value: object) -> bool:
    """Any text."""
    return type(value) is str


def one_of(*values: object):
    """One of these values, of the same type."""
    return lambda value: any(type(value) is type(each) and value == each for each in values)


def digits(n: int | None = None):
    """Lower-case hexadecimal: `n` digits, or any even number of them."""
    return lambda value: text(value) and _HEX.fullmatch(value) is not None and n in (None, len(value))


def or_null(holds):
    """A value that `holds` accepts, or null."""
    return lambda value: value is None or holds(value)


def base64_text(value: object) -> bool:
    """Base64 of anything."""
    if not text(value):
        return False
    try:
        unbase64(value)
    except Malformed:
        return False
    return True


def listed(holds):
    """A list of values that `holds` accepts."""
    return lambda value: type(value) is list and all(map(holds, value))


def _context(value: object) -> bool:
    return (
        type(value) is dict
        and set(value) == {"approvals", "consumed", "phase", "policy_version", "released_us", "remaining_us", "vehicle"}
        and listed(lambda each: listed(integer)(each) and len(each) == 5)(value["approvals"])
        and text(value["vehicle"])
        and all(integer(value[name]) for name in value if name not in ("approvals", "vehicle"))
    )


def _state(value: object) -> bool:
    return (
        type(value) is dict
        and set(value) in ({"ages", "values"}, {"ages", "monitors", "values"})
        and listed(integer)(value["ages"])
        and listed(or_null(integer))(value["values"])
        and ("monitors" not in value or (listed(integer)(value["monitors"]) and value["monitors"] != []))
    )


def _clause_at(value: object) -> bool:
    return value is None or (listed(integer)(value) and len(value) == 3)


_ALL = {"_prev": digits(64), "at_us": count, "seq": count, "utc_error_us": count, "utc_us": count}
_SEGMENT = {"bytes": count, "checkpoint": text, "digest": digits(64), "epoch": count, "records": count}
_INTEGERS = ("kind", "link", "rule_step", "step", "target_link", "valid_until_us")

FORMS = {
    "genesis": _ALL
    | {
        "before": or_null(digits(64)),
        "boot": digits(32),
        "bundle": base64_text,
        "checkpoint": text,
        "format": one_of("rtshcua/log"),
        "log_key": digits(64),
        "log_kid": digits(32),
        "mission": text,
        "mode": text,
        "next_key": digits(64),
        "received_us": count,
        "root": base64_text,
        "sync_us": count,
        "type": text,
        "vehicle": text,
        "version": one_of(4),
    },
    "decision": _ALL
    | dict.fromkeys(_INTEGERS, integer)
    | {
        "binding": digits(),
        "clause": or_null(text),
        "clause_at": _clause_at,
        "context": _context,
        "durability": one_of(0, 1, 2, 3),
        "invocation": digits(),
        "mode": text,
        "outcome": one_of("allow", "deny", "defer", "fallback"),
        "reason": text,
        "state": _state,
        "target": or_null(text),
        "type": text,
    },
    "effect": _ALL
    | {
        "detail": text,
        "durability": one_of(0, 1, 2, 3),
        "event": text,
        "kind": integer,
        "link": integer,
        "step": integer,
        "token": integer,
        "type": text,
    },
    "seal": _ALL | _SEGMENT | {"next_key": digits(64), "type": text},
    "recover": _ALL
    | _SEGMENT
    | {"discarded_bytes": count, "discarded_digest": digits(64), "next_key": digits(64), "type": text},
    "close": _ALL | _SEGMENT | {"ending": text, "tlog": or_null(digits(64)), "type": text},
}
