"""From a line back to its record: only the one line that our encoder would have written for it is accepted."""

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
#: bytes of a line that a finding quotes
SHOWN = 80


def too_long(line: bytes) -> Flaw | None:
    """Whether a line is longer than any record, which is said before it is read."""
    if len(line) <= LONGEST:
        return None
    return Flaw("record/too-long", "the line is too long for a record", f"{len(line)} bytes", f"{LONGEST} bytes")


def shown(line: bytes) -> str:
    """The beginning of a line, as a finding quotes it."""
    return line[:SHOWN].decode("utf-8", "backslashreplace")


def may_be_torn(line: bytes, prev: str) -> bool:
    """Whether a last line without its end may be what a crash left of the record after the line of hash `prev`: its
    beginning, or nothing but zeros, as a file system leaves what was not on the disk yet.
    """
    start = b'{"_prev":"' + prev.encode() + b'","at_us":'
    return line.startswith(start) or start.startswith(line) or not line.strip(b"\0")


def behind_close(line: bytes) -> Flaw:
    """What is wrong where a line, or part of one, stands behind the signed close: the log itself ends before it."""
    if not line.strip(b"\0"):
        what = f"{len(line)} zero octets, as a file system leaves them after a power cut"
    elif not line.strip():
        what = "empty lines or blanks"
    elif line.startswith(_BEGINNING) or _BEGINNING.startswith(line):
        what = "a record" if line.endswith(b"\n") else "a part of a record"
    else:
        what = "something that is no record"
    text = f"the log is over: behind its signed close stands {what}, for which no key of this log signed"
    return Flaw("close/junk-after", text, shown(line), "nothing")


_BEGINNING = b'{"_prev":"'
_TYPE = b',"type":"'  # no text can hold it, for a quote inside a text stands behind a backslash
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
    "`array`": "a list", "`object`": "an object", "JSON is malformed": "it is not JSON",
}  # fmt: skip


def read(line: bytes) -> AnyRecord | Flaw:
    """The record of a line (newline included), or what is wrong with the line."""
    start = line.rfind(_TYPE) + len(_TYPE)
    name = line[start : line.find(b'"', start)] if start >= len(_TYPE) else b""
    decoder = _DECODERS.get(name)
    if decoder is None:
        return Flaw("record/malformed", "it is not a record: genesis, decision, effect, seal, recover or close")
    try:
        record = decoder.decode(line)
    except UnicodeDecodeError:
        return Flaw("record/malformed", "it is not UTF-8")
    except msgspec.DecodeError as error:
        version = _VERSION.search(line) if name == b"genesis" else None
        if version is not None and int(version[1]) != VERSION:
            return _unknown_format(FORMAT, int(version[1]))
        return Flaw("record/malformed", f"it has not the form of a record of type {name.decode()}: {_words(error)}")
    if encode(record) != line:
        return Flaw("record/not-canonical", "it is not written in the one form that this record has (RFC 8785)")
    if isinstance(record, DecisionRecord):
        return _decision(record)
    if isinstance(record, Genesis) and (record.format != FORMAT or record.version != VERSION):
        return _unknown_format(record.format, record.version)
    return record


def _decision(record: DecisionRecord) -> DecisionRecord | Flaw:
    if record.outcome not in _OUTCOMES:
        text = "it has not the form of a record of type decision: its outcome is none that there is"
        return Flaw("record/malformed", text, record.outcome, ", ".join(sorted(_OUTCOMES)))
    for octets in (record.binding, record.invocation):
        if octets.strip(_DIGITS) or len(octets) & 1:
            text = "it has not the form of a record of type decision: its binding or invocation is not hexadecimal"
            return Flaw("record/malformed", text, octets)
    return record


def _words(error: msgspec.DecodeError) -> str:
    text = str(error)
    for theirs, ours in _WORDS.items():
        text = text.replace(theirs, ours)
    return text[:1].lower() + text[1:]


def _unknown_format(name: str, version: int) -> Flaw:
    text = "its format is not one that this program reads"
    if name == FORMAT and version < VERSION:
        text += f"; {names.COMPATIBILITY} says what verifies logs of earlier versions"
    return Flaw("genesis/format", text, f"{name} version {version}", f"{FORMAT} version {VERSION}")
