"""The boundary's own evidence (docs/log-format.md, section 7), computed independently from the records alone."""

import hashlib
import re
import struct

from reference.independent_records import Malformed, unbase64
from reference.independent_root import Root, Untrusted, payload_of, whole
from rtshcua.model.outcome import WIRE_REASONS

_REASONS = [reason.value for reason in WIRE_REASONS]  # the page refers to their list
_OUTCOMES = ("allow", "deny", "defer", "fallback")
_STATUSES = {"malformed": 1, "unknown_step": 2, "not_current": 3, "clock_apart": 4, "clock_unknown": 5}
_UNKNOWN = 1 << 52
_DOCUMENTS = {"approval": 1, "recall": 2, "replacement": 3, "cancellation": 4}
_CONTENT = "application/vnd.rtshcua.statement+cbor"
_MOST_MARKS = 128


class Disputed(Exception):
    """The records differ from those that the boundary signed."""


def after(digest: bytes, tag: int, payload: bytes, label: bytes = b"rtshcua/boundary") -> bytes:
    """Compute D(n) from D(n-1)."""
    return hashlib.sha256(label + b"\0" + digest + bytes([tag]) + len(payload).to_bytes(4) + payload).digest()


def entry(record: dict) -> tuple[int, bytes] | None:
    """Tag and payload of a record; None for one without an entry. Raises `Disputed` if its entry is malformed."""
    try:
        return _decided(record) if record["type"] == "decision" else _effect(record)
    except (struct.error, Malformed, ValueError, KeyError, OverflowError) as error:
        raise Disputed("a record of which no entry can be made") from error


def _decided(record: dict) -> tuple[int, bytes]:
    state, context = record["state"], record["context"]
    values, ages, monitors = state["values"], state["ages"], state.get("monitors", [])
    binding = bytes.fromhex(record["binding"])
    if len(binding) != 32 or len(values) != len(ages) or len(values) > 72 or len(monitors) > 32:
        raise ValueError("not a request")
    body = struct.pack(">Bhh", record["kind"], record["step"], record["link"]) + binding
    body += struct.pack(">5Q", *_now(record), context["released_us"], context["remaining_us"])
    body += struct.pack(">H", context["phase"])
    body += b"".join((-(1 << 63) if each is None else each).to_bytes(8, signed=True) for each in values)
    body += b"".join(each.to_bytes(4) for each in ages) + bytes(monitors)
    name = b"rtshcua/request"
    head = b"\x83" + bytes([0x60 | len(name)]) + name + b"\x02"
    head += bytes([0x58, len(body)]) if len(body) < 256 else b"\x59" + len(body).to_bytes(2)
    outcome, reason = _OUTCOMES.index(record["outcome"]), _REASONS.index(record["reason"])
    target = max(record["target_link"], -1)
    said = struct.pack(
        ">BBBhqB", outcome, reason, record["rule_step"], target, record["valid_until_us"], context["consumed"]
    )
    return 2, said + head + body


def _effect(record: dict) -> tuple[int, bytes] | None:
    event, detail = record["event"], record["detail"]
    if event == "undecided":
        status, digest = re.fullmatch(r"([a-z_]+) ([0-9a-f]{64})", detail).groups()
        return 3, bytes([_STATUSES[status]]) + bytes.fromhex(digest)
    if event in _DOCUMENTS:
        digest = hashlib.sha256(unbase64(detail)).digest()
        return 4, struct.pack(">Bh3Q", _DOCUMENTS[event], record["step"], *_now(record)) + digest
    if event == "dispatched":
        link = max(record["link"], -1)
        return 6, struct.pack(">BhhQQ", record["kind"], record["step"], link, record["token"], record["at_us"])
    if event == "refused":
        return 7, record["at_us"].to_bytes(8) + detail.encode()
    if event == "permitted":
        return 8, _parameters(detail)
    return (9, detail.encode()) if event == "not-permitted" else None


def _parameters(detail: str) -> bytes:
    what, _, listed = detail.partition(" ")
    payload = b""
    writes = listed.split(", ")
    for write in writes:
        name, before, value = re.fullmatch(r"([A-Z0-9_]{1,16}) from (\S+) to (\S+)", write, re.ASCII).groups()
        payload += struct.pack(">16sII", name.encode(), _bits(before), _bits(value))
    return bytes([("set", "restore").index(what), len(writes)]) + payload


def _bits(text: str) -> int:
    (bits,) = struct.unpack("<I", struct.pack("<f", float(text) + 0.0))
    return bits


def _now(record: dict) -> tuple[int, int, int]:
    return record["at_us"], record["utc_us"], record["utc_error_us"]


class Boundary:
    """The statements of one log, compared with all of its records."""

    def __init__(self, genesis: dict, root: Root) -> None:
        self.keys = root.public("boundary", genesis["vehicle"], genesis["utc_us"])
        self.genesis = genesis
        self.digests = [bytes(32)]  # D(0), D(1), ...
        self.counts: list[int] = []  # of the statements
        self.last: list | None = None
        self.marks: dict[int, bytes] = {}
        self.stated = self.recovered = self.lost = False
        self.gap_end = 0  # the end of this epoch's last gap
        self.claim = genesis if genesis["utc_error_us"] < _UNKNOWN else None  # since the previous statement

    def line(self, record: dict) -> None:
        """Read the next record after the genesis. Raises `Disputed`."""
        kind = record["type"]
        if not self.keys:
            return
        if self.claim is None and record["utc_error_us"] < _UNKNOWN:
            self.claim = record
        if kind == "recover":
            self.claim = None
        if self.lost:
            self._alone(record)
        elif kind == "effect" and record["event"] == "boundary-lost":
            self.lost = True
            if self.last is None or len(self.digests) - 1 < self.last[3]:
                raise Disputed("no statement before it was lost, or entries of one without a record")
        elif kind in ("decision", "effect") and record.get("event") != "boundary":
            if record.get("event") == "stalled":
                self.gap_end = record["at_us"]
            self._entry(record)
        elif kind == "effect":
            self._statement(record)
        else:
            recovers = kind == "recover" or (kind == "close" and self.recovered and record["ending"] == "recovered")
            if not recovers and (not self.stated or len(self.digests) - 1 > self.last[3]):
                raise Disputed("no statement at the end of an epoch")
            if kind == "close" and not recovers and (not self.last[-1] or len(self.digests) - 1 != self.last[3]):
                raise Disputed("no final statement, or entries of it without a record")
            self.recovered = self.recovered or kind == "recover"
            self.stated, self.gap_end = False, 0

    def _alone(self, record: dict) -> None:
        """Read a record that follows the loss of the boundary."""
        event = record.get("event")
        by_standing = event == "dispatched" and record["kind"] in (1, 2)
        if record["type"] == "decision" or event == "boundary":
            raise Disputed("a decision or a statement of a boundary that was lost")
        if event not in (None, "refused", "not-permitted") and not by_standing and entry(record) is not None:
            raise Disputed("an entry of a boundary that was lost")

    def _entry(self, record: dict) -> None:
        made = entry(record)
        if made is None:
            return
        if self.last is None or self.last[-1]:
            raise Disputed("an entry before the first statement, or after the last")
        self.digests.append(after(self.digests[-1], *made))
        self._compare(len(self.digests) - 1)

    def _compare(self, number: int) -> None:
        """Compare entry `number`, if a statement covers it."""
        digest = self.digests[number]
        if self.marks.pop(number, digest[:8]) != digest[:8]:
            raise Disputed("an entry is not that of its mark")
        if self.last[3] == number and self.last[4] != digest:
            raise Disputed("another digest")

    def _time(self, record: dict, clock: list[int]) -> None:
        """Compare the claimed time of day with that of a statement: `at_us`, `utc_us`, `utc_error_us`."""
        at, utc, error = clock
        since = at if self.last is None else self.last[14]
        for claim in (self.claim, record):
            if claim is None or claim["utc_error_us"] >= _UNKNOWN:
                continue
            off = abs(claim["utc_us"] - claim["at_us"] - (utc - at))
            allowed = claim["utc_error_us"] + max(0, at - max(claim["at_us"], since)) * 500 // 1_000_000 + 2_000_000
            if error >= _UNKNOWN or off + error > allowed:
                raise Disputed("a time of day that is not the boundary's")
        self.claim = None

    def _statement(self, record: dict) -> None:
        try:
            envelope = unbase64(record["detail"])
            payload = payload_of(envelope, "boundary", _CONTENT, self.keys) if len(envelope) <= 2048 else b""
            name, version, said = whole(payload)
            flight, session, before, count, digest, marks, *counted, final = said
            counted, clock = counted[:7], counted[7:]
        except (Malformed, Untrusted, ValueError, TypeError) as error:
            raise Disputed("not a statement of the boundary") from error
        numbers = [session, count, *clock, *(each for each in counted if type(each) is int)]
        octets = [before, digest, *(each for each in counted if type(each) is bytes)]
        shape = [type(each) for each in counted] == [int, bytes, int, int, int, int, bytes] and type(marks) is bytes
        shape = shape and [type(each) for each in clock] == [int] * 4
        if (name, version) != ("rtshcua/statement", 2) or not shape or type(final) is not bool:
            raise Disputed("not a statement of version 2")
        if type(clock[0]) is not int or not 0 <= clock[0] <= 4:
            raise Disputed("no source of a time of day")
        if any(type(each) is not int or not 0 <= each < 1 << 63 for each in numbers):
            raise Disputed("a number out of range")
        if any(type(each) is not bytes or len(each) != 32 for each in octets):
            raise Disputed("a digest of another length")
        if flight != bytes.fromhex(self.genesis["boot"]):
            raise Disputed("of another flight")
        earlier = 0
        if self.last is None:
            bundle = hashlib.sha256(unbase64(self.genesis["bundle"])).digest()
            enforced = bytes([self.genesis["mode"] != "none"])
            self.digests.append(after(self.digests[0], 1, session.to_bytes(8) + before + flight + bundle + enforced))
        else:
            earlier = self.last[3]
            same = [session, before] == self.last[1:3]
            grows = count >= earlier and all(
                now >= then for now, then in zip(counted, self.last[6:13], strict=True) if type(now) is int
            )
            if not same or not grows or self.last[-1] or len(self.digests) - 1 < earlier:
                raise Disputed("it does not follow the statement before")
        if len(marks) != 8 * min(count - earlier, _MOST_MARKS) or len(self.digests) - 1 > count:
            raise Disputed("it does not mark its entries, or is behind the records")
        self._time(record, clock[1:])
        if clock[1] < self.gap_end - 2_000_000:
            raise Disputed("older than the end of the gap before it")
        self.gap_end = 0
        self.last, self.stated = said, True
        self.marks = {earlier + 1 + n: marks[8 * n : 8 * n + 8] for n in range(len(marks) // 8)}
        for number in range(earlier + 1, len(self.digests)):
            self._compare(number)
        self._compare(min(count, len(self.digests) - 1))
