"""Decodes a line into its record. Only the exact line that the encoder writes for the record is accepted."""

import re

import msgspec

from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.records import (
    FORMAT,
    VERSION,
    AnyRecord,
    Close,
    DecisionRecord,
    Effect,
    Genesis,
    Recover,
    Seal,
    encode,
)
from rtshcua.model.outcome import Outcome
from rtshcua.wire import names

#: the longest line in bytes; a genesis carries a whole bundle
LONGEST = 1 << 26
#: the most bytes of a line that a finding quotes
SHOWN = 80


def too_long(line: bytes) -> Flaw | None:
    """The flaw of a line that is longer than any record, checked before it is read."""
    if len(line) <= LONGEST:
        return None
    return Flaw("record/too-long", "the line is too long for a record", f"{len(line)} bytes", f"{LONGEST} bytes")


def shown(line: bytes) -> str:
    """The beginning of a line for a finding."""
    return line[:SHOWN].decode("utf-8", "backslashreplace")


def may_be_torn(line: bytes, prev: str) -> bool:
    """Whether a last line without its end may be what a crash left of the record after the line of hash `prev`: the
    beginning of that record, or nothing but zeros, as a file system leaves data that was not written yet.
    """
    start = b'{"_prev":"' + prev.encode() + b'","at_us":'
    return line.startswith(start) or start.startswith(line) or not line.strip(b"\0")


def behind_close(line: bytes) -> Flaw:
    """The flaw of a line, or part of one, that follows the signed close."""
    if not line.strip(b"\0"):
        what = f"{len(line)} zero octets, as a file system leaves them after a power cut"
    elif not line.strip():
        what = "empty lines or blanks"
    elif line.startswith(_BEGINNING) or _BEGINNING.startswith(line):
        what = "a record" if line.endswith(b"\n") else "part of a record"
    else:
        what = "data other than a record"
    text = f"the signed close is followed by {what}, which no key of this log signed"
    return Flaw("close/junk-after", text, shown(line), "nothing")


_BEGINNING = b'{"_prev":"'
_TYPE = b',"type":"'  # cannot occur in a text, where a quote stands after a backslash
_VERSION = re.compile(rb',"version":(\d{1,15})[,}]')
_DECODERS: dict[bytes, msgspec.json.Decoder[AnyRecord]] = {
    b"genesis": msgspec.json.Decoder(Genesis),
    b"decision": msgspec.json.Decoder(DecisionRecord),
    b"effect": msgspec.json.Decoder(Effect),
    b"seal": msgspec.json.Decoder(Seal),
    b"recover": msgspec.json.Decoder(Recover),
    b"close": msgspec.json.Decoder(Close),
}
_OUTCOMES = frozenset(outcome.name.lower() for outcome in Outcome)
_DIGITS = "0123456789abcdef"
_WORDS = {
    "`int`": "an integer", "`float`": "a fraction", "`str`": "a text", "`bool`": "a truth value", "`null`": "null",
    "`array`": "a list", "`object`": "not JSON", "JSON is malformed": "it is not JSON",
}  # fmt: skip


def read(line: bytes) -> AnyRecord | Flaw:
    """The record of a line (newline included), or the flaw of the line."""
    start = line.rfind(_TYPE) + len(_TYPE)
    name = line[start : line.find(b'"', start)] if start >= len(_TYPE) else b""
    decoder = _DECODERS.get(name)
    if decoder is None:
        return Flaw("record/malformed", "not a record: expected genesis, decision, effect, seal, recover or close")
    try:
        record = decoder.decode(line)
    except UnicodeDecodeError:
        return Flaw("record/malformed", "the line is not UTF-8")
    except msgspec.DecodeError as error:
        version = _VERSION.search(line) if name == b"genesis" else None
        if version is not None and int(version[1]) != VERSION:
            return _unknown_format(FORMAT, int(version[1]))
        return Flaw("record/malformed", f"malformed record of type {name.decode()}: {_words(error)}")
    if encode(record) != line:
        return Flaw("record/not-canonical", "the record is not in its canonical form (RFC 8785)")
    if isinstance(record, DecisionRecord):
        return _decision(record)
    if isinstance(record, Genesis) and (record.format != FORMAT or record.version != VERSION):
        return _unknown_format(record.format, record.version)
    return record


def _decision(record: DecisionRecord) -> DecisionRecord | Flaw:
    if record.outcome not in _OUTCOMES:
        text = "malformed record of type decision: unknown outcome"
        return Flaw("record/malformed", text, record.outcome, ", ".join(sorted(_OUTCOMES)))
    for octets in (record.binding, record.invocation):
        if octets.strip(_DIGITS) or len(octets) & 1:
            text = "malformed record of type decision: binding or invocation is not hexadecimal"
            return Flaw("record/malformed", text, octets)
    return record


def _words(error: msgspec.DecodeError) -> str:
    text = str(error)
    for theirs, ours in _WORDS.items():
        text = text.replace(theirs, ours)
    return text[:1].lower() + text[1:]


def _unknown_format(name: str, version: int) -> Flaw:
    text = "the format is not supported by this program"
    if name == FORMAT and version < VERSION:
        text += f"; see {names.COMPATIBILITY} for logs of earlier versions"
    return Flaw("genesis/format", text, f"{name} version {version}", f"{FORMAT} version {VERSION}")
