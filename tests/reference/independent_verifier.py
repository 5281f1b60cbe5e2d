"""A second verifier of evidence logs, written from docs/log-format.md alone: standard library and `cryptography`.

It reads the whole log into memory and only returns a verdict. Tests compare it with `rtshcua verify-log`.
Run it as `python tests/reference/independent_verifier.py LOG ROOTKEY_HEX [ANCHORS...]`.
"""

import hashlib
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import quote

if __package__ in (None, ""):
    sys.path.insert(0, str(Path(__file__).parent.parent))

from reference.independent_boundary import Boundary, Disputed
from reference.independent_images import Contradicted, Images
from reference.independent_note import Broken, claimed, cosigned, ident, notes_of, read_note
from reference.independent_records import LONGEST, SIGNED, Malformed, canonical, parse, unbase64
from reference.independent_root import Root, Untrusted, check_bundle, holds, key_id, open_root

MOST_LINES, LONGEST_US = 2048, 20_000_000
_ANCHORED, _STALLED = "anchored", "stalled"


@dataclass(frozen=True)
class Verdict:
    """`closed`, `incomplete`, `broken`, `untrusted`, `anchor`, `boundary` or `images`; `line` is the
    first bad one. `gaps` are the lines after a gap, each with its duration in us.
    """

    kind: str
    why: str = ""
    line: int | None = None
    lines: int = 0
    anchored: int = 0
    gaps: tuple[tuple[int, int], ...] = ()

    @property
    def accepted(self) -> bool:
        """Whether everything holds and the log is closed."""
        return self.kind == "closed"


def leaf(line: bytes) -> bytes:
    """The Merkle leaf of a line, and the link of the chain."""
    return hashlib.sha256(b"\0" + line).digest()


def merkle(leaves: Sequence[bytes]) -> bytes:
    """MTH of RFC 9162 section 2.1.1, by its definition."""
    if not leaves:
        return hashlib.sha256().digest()
    if len(leaves) == 1:
        return leaves[0]
    k = 1 << (len(leaves) - 1).bit_length() - 1
    return hashlib.sha256(b"\1" + merkle(leaves[:k]) + merkle(leaves[k:])).digest()


@dataclass
class Growing:
    """The same root, computed incrementally: the roots of the full subtrees, largest first, with their sizes."""

    full: list[tuple[int, bytes]] = field(default_factory=list)

    def push(self, digest: bytes) -> None:
        """Add a leaf."""
        size = 1
        while self.full and self.full[-1][0] == size:
            digest = hashlib.sha256(b"\1" + self.full.pop()[1] + digest).digest()
            size *= 2
        self.full.append((size, digest))

    def root(self) -> bytes:
        """The root of the leaves so far."""
        if not self.full:
            return hashlib.sha256().digest()
        root = self.full[-1][1]
        for _, left in reversed(self.full[:-1]):
            root = hashlib.sha256(b"\1" + left + root).digest()
        return root


def verify(log: bytes, pinned: bytes, anchors: Iterable[bytes] = (), witnesses: int | None = None) -> Verdict:
    """Verify a log under a pinned root key. `anchors` are the contents of anchor files."""
    return Walk(pinned).verdict(log, anchors, witnesses)


class Walk:
    """The state of a verifier that reads a log forwards."""

    def __init__(self, pinned: bytes) -> None:
        self.pinned = pinned
        self.seq = 0
        self.prev = bytes(32)
        self.tree = Growing()
        self.roots = {0: self.tree.root()}
        self.sealed: dict[int, bytes] = {}
        self.notes: list[str] = []
        self.closed = False
        self.genesis: dict = {}
        self.trust: Root | None = None
        self.origin = ""
        self.segment = hashlib.sha256()
        self.octets = 0
        self.epoch = 0
        self.key = b""
        self.signed_seq = self.signed_us = 0
        self.stalled_us: int | None = None
        self.gaps: list[tuple[int, int]] = []
        self.at_us = self.low = 0
        self.base: tuple[int, int] = (0, 0)
        self.boundary: Boundary | None = None
        self.disputed: tuple[str, int] | None = None
        self.images = Images()
        self.contradicted: tuple[str, int] | None = None

    def verdict(self, rest: bytes, anchors: Iterable[bytes] = (), witnesses: int | None = None) -> Verdict:
        """The verdict on the log if these octets are its rest."""
        lines = rest.split(b"\n")
        torn = lines.pop()
        try:
            for line in lines:
                self.line(line + b"\n")
            kind = self.end(torn)
        except Untrusted as error:
            return Verdict("untrusted", str(error), 0)
        except (Broken, Malformed) as error:
            return Verdict("broken", str(error), self.seq, self.seq)
        try:
            anchored = self.anchored([*self.notes, *notes_of(anchors)], witnesses)
        except Broken as error:
            return Verdict("anchor", str(error), None, self.seq)
        if self.disputed is not None:
            return Verdict("boundary", *self.disputed, self.seq, anchored)
        if self.contradicted is not None:
            return Verdict("images", *self.contradicted, self.seq, anchored)
        if self.boundary is not None and self.boundary.lost:
            kind = "incomplete"
        return Verdict(kind, "", None, self.seq, anchored, tuple(self.gaps))

    def line(self, line: bytes) -> None:
        """Read the next line. Raises `Broken`, `Malformed` and `Untrusted`."""
        if self.closed:
            raise Broken("something after the close")
        record = parse(line)
        if (record["type"] == "genesis") != (self.seq == 0):
            raise Broken("a genesis is line 0, and no other line is")
        if record["seq"] != self.seq:
            raise Broken("seq")
        if record["_prev"] != self.prev.hex():
            raise Broken("_prev")
        if self.seq == 0:
            self._trust(record)
        silent_us = record["at_us"] - self.at_us
        self._clocks(record)
        if record["type"] in SIGNED:
            self._signed(line, record)
            if record["type"] in ("seal", "close") and silent_us > LONGEST_US:
                self.gaps.append((self.seq, silent_us))
        else:
            self._epoch(record, silent_us)
        self._attested(record)
        if self.contradicted is None:
            try:
                self.images.line(record)
            except Contradicted as error:
                self.contradicted = str(error), self.seq
        if record.get("event") == _ANCHORED:
            self.notes.append(record["detail"])
        self.prev = leaf(line)
        self.tree.push(self.prev)
        self.segment.update(line)
        self.octets += len(line)
        self.seq += 1
        self.roots[self.seq] = self.tree.root()

    def _attested(self, record: dict) -> None:
        if self.boundary is None:
            self.boundary = Boundary(record, self.trust)
        elif self.disputed is None:
            try:
                self.boundary.line(record)
            except Disputed as error:
                self.disputed = str(error), self.seq

    def _trust(self, record: dict) -> None:
        self.genesis = record
        self.trust = open_root(unbase64(record["root"]), self.pinned, record["utc_us"])
        key = bytes.fromhex(record["log_key"])
        if key not in self.trust.public("log", record["vehicle"], record["utc_us"]):
            raise Untrusted("the root does not name the log key for this vehicle")
        if record["log_kid"] != key_id("log", key).hex():
            raise Untrusted("log_kid is not the name of the log key")
        check_bundle(unbase64(record["bundle"]), self.trust, record["vehicle"], record["mission"], record["utc_us"])
        self.origin = f"rtshcua/log/{quote(record['vehicle'], safe='')}/{record['boot']}"

    def _clocks(self, record: dict) -> None:
        at, utc, error = record["at_us"], record["utc_us"], record["utc_error_us"]
        anew = record["type"] in ("genesis", "recover")
        if record["type"] == "genesis" and record["received_us"] > at:
            raise Broken("received after it began")
        if not anew and at < self.at_us:
            raise Broken("at_us goes back")
        if utc + error < self.low:
            raise Broken("UTC goes back")
        if anew:
            self.base = (utc - at, error)
        elif abs(utc - at - self.base[0]) > error + self.base[1]:
            raise Broken("UTC and monotonic time part")
        self.at_us = at
        self.low = max(self.low, utc - error) if self.seq else utc - error

    def _epoch(self, record: dict, silent_us: int) -> None:
        if record.get("event") == _STALLED:
            if self.stalled_us is not None:
                raise Broken("a second gap in an epoch")
            if record["detail"] != f"{silent_us} us":
                raise Broken("a gap that is not there")
            self.stalled_us = silent_us
            self.gaps.append((self.seq, silent_us))
        since_us = record["at_us"] - self.signed_us - (self.stalled_us or 0)
        if self.seq - self.signed_seq > MOST_LINES or since_us > LONGEST_US:
            raise Broken("an epoch is not sealed")

    def _signed(self, line: bytes, record: dict) -> None:
        kind = record["type"]
        note = read_note(record["checkpoint"])
        by_log_key = kind in ("genesis", "recover")
        public = bytes.fromhex(self.genesis["log_key"]) if by_log_key else self.key
        if note.origin != self.origin:
            raise Broken("note: origin")
        if note.size != self.seq:
            raise Broken("note: size")
        if note.root != self.tree.root():
            raise Broken("note: root")
        if note.record != leaf(canonical(record | {"checkpoint": None}) + b"\n"):
            raise Broken("note: self")
        if (None if note.key is None else note.key.hex()) != record.get("next_key"):
            raise Broken("note: next key")
        if note.after != (hashlib.sha256(self.sealed[self.signed_seq]).digest() if self.seq else None):
            raise Broken("note: after")
        if len(note.signatures) != 1:
            raise Broken("note: not one signature")
        ((name, blob),) = note.signatures
        if name != self.origin or blob[:4] != ident(self.origin, 1, public) or not holds(public, blob[4:], note.text):
            raise Broken("note: signature")
        if kind != "genesis":
            found = record["epoch"], record["bytes"], record["records"], record["digest"]
            if found != (self.epoch, self.octets, self.seq - self.signed_seq, self.segment.hexdigest()):
                raise Broken("segment")
            self.epoch += 1
        self.key = note.key or b""
        self.signed_seq, self.signed_us, self.stalled_us = self.seq, record["at_us"], None
        self.segment, self.octets = hashlib.sha256(), 0
        self.sealed[self.seq] = note.text
        self.closed = kind == "close"

    def end(self, torn: bytes) -> str:
        """The verdict at the end of the file. Raises `Broken`."""
        if self.closed:
            if torn:
                raise Broken("something after the close")
            return "closed"
        expected = b'{"_prev":"' + self.prev.hex().encode() + b'","at_us":'
        zeros = torn == bytes(len(torn))  # padding by the disk
        if len(torn) > LONGEST or (not zeros and torn[: len(expected)] != expected[: len(torn)]):
            raise Broken("the last line is torn and not what follows")
        if self.seq == 0:
            raise Broken("no genesis")
        return "incomplete"

    def anchored(self, notes: Iterable[str], witnesses: int | None) -> int:
        """The largest size that enough trusted witnesses cosigned. Raises `Broken` if one saw another log."""
        assert self.trust is not None
        keys = self.trust.public("witness", self.genesis["vehicle"], self.genesis["utc_us"])
        enough = self.trust.witnesses if witnesses is None else witnesses
        seen: dict[bytes, int] = {}  # the largest size that each witness cosigned: it saw all smaller ones too
        for text in notes:
            try:
                note = read_note(text)
            except Broken:
                continue
            if note.origin != self.origin:
                continue
            lines = [(name, blob, public) for name, blob in note.signatures for public in keys]
            if any(claimed(n, b, public) and not cosigned(note.text, n, b, public) for n, b, public in lines):
                continue
            for name, blob in note.signatures:
                for public in keys:
                    if cosigned(note.text, name, blob, public):
                        if self.roots.get(note.size) != note.root or self.sealed.get(note.size) != note.text:
                            raise Broken(f"a witness saw another log of {note.size} lines")
                        seen[public] = max(note.size, seen.get(public, 0))
        sizes = sorted(seen.values(), reverse=True)
        return sizes[enough - 1] if len(sizes) >= enough else 0


def main(arguments: Sequence[str]) -> int:
    """Verify one file; exit 0 only if it is closed."""
    log, pinned, *anchors = arguments
    verdict = verify(Path(log).read_bytes(), bytes.fromhex(pinned), [Path(a).read_bytes() for a in anchors])
    print(verdict)
    return 0 if verdict.accepted else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
