"""What a proof is made of, found in a log in one pass: the signed record that vouches, and the signatures up to it."""

from base64 import b64decode
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import Close, Decision, Effect, Genesis, Recover, Signed

_SIGNED = b',"checkpoint":"'  # no text can hold it, for a quote inside a text stands behind a backslash


class Found(NamedTuple):
    """What a proof is made of: the trust root, the notes that the log key and then epoch keys signed, up to that of
    `signed`, and the line that was asked for, if it is before it.
    """

    root: bytes
    chain: tuple[str, ...]
    signed: Signed
    line: bytes


def find(
    lines: Iterable[bytes], number: int | None, at: int | None, *, since: int | None = None, closed: bool = False
) -> Found | Flaw:
    """What a proof of record `number`, or of what follows the signed record `since`, is made of.

    The signed record is `at`; without it the first one after `number`, or the last one there is (`closed`, `since`).
    """
    if at is not None and number is not None and at < number:
        return Flaw("proof/number", f"record {at} was signed before record {number} was written", str(at), f"{number}")
    finder = _Finder(number, at, since, to_end=closed or (since is not None and at is None))
    count = 0
    for count, line in enumerate(_whole(lines), 1):
        flaw = finder.take(count - 1, line)
        if flaw is not None:
            return flaw
        if finder.done:
            break
    return finder.found(count)


class _Finder:
    def __init__(self, number: int | None, at: int | None, since: int | None, *, to_end: bool) -> None:
        self.done = False
        self._number, self._at, self._since, self._to_end = number, at, since, to_end
        self._root = b""
        self._notes: list[str] = []
        self._sizes: set[int] = set()
        self._signed: Signed | None = None
        self._line = b""

    def take(self, seq: int, line: bytes) -> Flaw | None:
        if seq == self._number:
            self._line = line
        if _SIGNED not in line and seq:
            return None
        record = read(line)
        if isinstance(record, Flaw):
            if record.slug == "genesis/format":
                return record
            text = f"record {seq} of the log is none: {record.text}"
            return Flaw("proof/log" if seq else "proof/no-log", text, record.found, record.expected)
        if isinstance(record, Decision | Effect) or isinstance(record, Genesis) != (seq == 0) or record.seq != seq:
            return Flaw("proof/log", f"record {seq} of the log stands where it does not belong", record.type)
        if isinstance(record, Genesis):
            try:
                self._root = b64decode(record.root, validate=True)
            except ValueError:
                return Flaw("proof/log", "the trust root in the genesis is not base64")
        if isinstance(record, Genesis | Recover) and (self._since is None or self._since >= seq):
            self._notes.clear()  # signed by the log key itself: nothing before it is needed
        self._notes.append(record.checkpoint or "")
        self._sizes.add(seq)
        self._signed = record
        self.done = isinstance(record, Close) or (not self._to_end and self._serves(seq))
        return None

    def _serves(self, seq: int) -> bool:
        if self._at is not None:
            return seq >= self._at
        return self._number is None or seq > self._number

    def found(self, count: int) -> Found | Flaw:
        number, signed = self._number, self._signed
        if signed is None:
            return Flaw("proof/no-log", "there is no whole record in it")
        if number is not None and not self._line:
            text = f"the log has no record {number}"
            return Flaw("proof/number", text, str(number), f"0 to {count - 1}")
        for asked in (self._at, self._since):
            if asked is not None and asked not in self._sizes:
                return Flaw("proof/number", f"record {asked} is no signed record: a genesis, a seal or a close")
        least = number if number is not None else self._since
        assert least is not None
        if signed.seq < least:
            return Flaw("proof/unsealed", f"nothing after record {least} is signed yet, and so nothing vouches for it")
        return Found(self._root, tuple(self._notes), signed, self._line)


def _whole(lines: Iterable[bytes]) -> Iterator[bytes]:
    """The lines but for what a crash left of the last one."""
    for line in lines:
        if not line.endswith(b"\n"):
            return
        yield line
