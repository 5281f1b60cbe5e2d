"""A witness: it cosigns a checkpoint only if the log that it saw before is still the beginning of the present one.

It follows c2sp.org/tlog-witness, with two additions. A log changes its key with every epoch, so a request may
carry the intermediate notes after the checkpoint, each of which names the key of the next; the first is the
genesis' note, signed by the log key of the trust root. And with each size the witness stores the whole text that
it cosigned, including the record that carried it and the next key, and the key that signed it: an epoch's key
signs once.

Everything here is pure. The caller must store the state on the disk before the cosignature is sent; otherwise a
crash could make the witness contradict itself.
"""

from collections.abc import Callable, Iterable
from typing import Final, NamedTuple
from urllib.parse import unquote

from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.log_writer import origin_of
from rtshcua.evidence.merkle import EMPTY
from rtshcua.evidence.merkle_proofs import verify_consistency
from rtshcua.evidence.note import Checkpoint, base64, open_note, parse, split, strict_base64

#: the most lines of a proof (c2sp.org/tlog-witness)
MOST_PROOF: Final = 63
OK, MALFORMED, FORBIDDEN, UNKNOWN, CONFLICT, INCONSISTENT = 200, 400, 403, 404, 409, 422

_ORIGIN: Final = "rtshcua/log/"
_HASH_BYTES: Final = 32
_LONGEST_SIZE: Final = 16  # digits
_STRANGER: Final = "not signed by the key that the previous record names, nor by the log's key"

#: returns the public log keys that the trust root names for a vehicle
LogKeys = Callable[[str], Iterable[bytes]]


class CosignRequest(NamedTuple):
    """A checkpoint to be cosigned. `proof` proves that the tree of `old` leaves is its beginning.

    `chain` holds the notes of the signed records between the checkpoint of `old` leaves and this one, oldest
    first; from the genesis on if the witness is assumed to know nothing.
    """

    old: int
    proof: tuple[bytes, ...]
    note: str
    chain: tuple[str, ...] = ()

    def encode(self) -> bytes:
        """The body of c2sp.org/tlog-witness, followed by each note of the chain after an empty line."""
        proof = "".join(f"{base64(each)}\n" for each in self.proof)
        chain = "".join(f"\n{note}" for note in self.chain)
        return f"old {self.old}\n{proof}\n{self.note}{chain}".encode()


class LastCosigned(NamedTuple):
    """The last cosigned checkpoint of a log: its text, and the public key that the log signed it with."""

    text: str
    signer: bytes


class Declined(NamedTuple):
    """Why nothing is cosigned. `status` is an HTTP status, as c2sp.org/tlog-witness uses them.

    `size` is that of the tree that the witness saw, with a conflict. `contradiction`: the log's own key signed a
    contradiction to what was cosigned before; the note is kept as evidence.
    """

    status: int
    text: str
    size: int = 0
    contradiction: bool = False

    def answer(self) -> "WitnessResponse":
        """The body of the answer: for a conflict the size, else the reason."""
        return WitnessResponse(self.status, f"{self.size}\n" if self.status == CONFLICT else f"{self.text}\n")


class WitnessResponse(NamedTuple):
    """A witness's answer: an HTTP status, and the body of c2sp.org/tlog-witness."""

    status: int
    body: str

    def encode(self) -> bytes:
        """The status in a line of its own, then the body."""
        return f"{self.status}\n{self.body}".encode()

    @property
    def size(self) -> int | None:
        """With a conflict, the size of the tree that the witness cosigned last; None if the body is malformed."""
        digits = self.body.removesuffix("\n")
        return int(digits) if digits.isascii() and digits.isdigit() and len(digits) <= _LONGEST_SIZE else None


def decode_answer(data: bytes) -> WitnessResponse | None:
    """The answer in these bytes; None if they are malformed."""
    status, newline, body = data.partition(b"\n")
    if not newline or len(status) != 3 or not status.isdigit():
        return None
    return WitnessResponse(int(status), body.decode("utf-8", "replace"))


def decode(data: bytes) -> CosignRequest | Declined:
    """The request in a body, or why it is declined. Raises nothing."""
    try:
        head, *parts = data.decode().split("\n\n")
    except UnicodeDecodeError:
        return Declined(MALFORMED, "the request is not UTF-8")
    first, *proof = head.split("\n")
    old = first.removeprefix("old ")
    number = int(old) if old.isascii() and old.isdigit() and len(old) <= _LONGEST_SIZE else 0
    # a part is the text of a note, the next one its signatures; the last ends with one newline
    texts = [f"{body}\n\n{lines}\n" for body, lines in zip(parts[::2], parts[1::2], strict=False)]
    if not texts or len(parts) % 2 or not data.endswith(b"\n") or len(proof) > MOST_PROOF:
        return Declined(MALFORMED, "malformed request")
    texts[-1] = texts[-1][:-1]
    request = CosignRequest(number, tuple(strict_base64(each) for each in proof), texts[0], tuple(texts[1:]))
    if {len(each) for each in request.proof} - {_HASH_BYTES} or request.encode() != data:
        return Declined(MALFORMED, "malformed request")
    return request


def judge(request: CosignRequest, seen: LastCosigned | None, log_keys: LogKeys) -> LastCosigned | Declined:
    """The checkpoint that may be cosigned, or why it is declined. `seen` is what was cosigned last for this origin,
    if anything.
    """
    text, lines = split(request.note)
    checkpoint = parse(text)
    if not lines or isinstance(checkpoint, Flaw):
        return Declined(MALFORMED, "the note is not the checkpoint of a log")
    known = None if seen is None else parse(seen.text)
    assert not isinstance(known, Flaw), "the stored note is a checkpoint"
    vehicle = vehicle_of(checkpoint.origin)
    keys = tuple(log_keys(vehicle)) if vehicle else ()
    if not keys:
        return Declined(UNKNOWN, f"unknown log `{checkpoint.origin}`")
    size = 0 if known is None else known.size
    if request.old > checkpoint.size:
        return Declined(MALFORMED, f"a tree of {checkpoint.size} records does not begin with one of {request.old}")
    if request.old != size:
        return Declined(CONFLICT, f"the last cosigned tree has {size} records, not {request.old}", size)
    if seen is not None and text == seen.text:
        return seen  # cosign it again, because the answer may have been lost
    signer = _follow(request, known, seen, keys)
    if isinstance(signer, Declined):
        return signer
    root = EMPTY if known is None else known.root
    if not verify_consistency(size, root, checkpoint.size, checkpoint.root, request.proof):
        # Anyone can combine a wrong proof with a correct note, so this alone is not a contradiction.
        return Declined(INCONSISTENT, f"the proof does not show that the tree begins with the one of {size} records")
    return LastCosigned(text, signer)


def vehicle_of(origin: str) -> str:
    """The vehicle whose log has this origin; empty for an invalid origin."""
    quoted, _, boot = origin.removeprefix(_ORIGIN).rpartition("/")
    vehicle = unquote(quoted, errors="replace")
    return vehicle if origin == origin_of(vehicle, boot) else ""


def _follow(
    request: CosignRequest, known: Checkpoint | None, seen: LastCosigned | None, log_keys: tuple[bytes, ...]
) -> bytes | Declined:
    """The key that signed the last note, if each note is signed by the key that the previous one names, or by the log
    key, and continues it.
    """
    chain = [*request.chain, request.note]
    if seen is not None and split(chain[0])[0] == seen.text:
        del chain[0]  # a sender that is unsure of the witness's state sends the genesis again
    before, signer, origin = known, b"", request.note.partition("\n")[0]
    for note in chain:
        named = () if before is None or before.key is None else (before.key,)
        signer, checkpoint = _opened(note, origin, (*named, *log_keys))
        if checkpoint is None:
            twice = seen is not None and _opened(note, origin, (seen.signer,))[1] is not None
            return _conflict(known, contradiction=True) if twice else Declined(FORBIDDEN, _STRANGER)
        if before is None and (checkpoint.size or checkpoint.root != EMPTY or checkpoint.after is not None):
            return Declined(FORBIDDEN, "the first note of a log must be the checkpoint of its genesis")
        if before is not None and (before.key is None or checkpoint.size <= before.size):
            return _conflict(known, contradiction=before is known and checkpoint.size >= before.size)
        if before is not None and checkpoint.after != before.digest():
            # The log key may sign several times, and other notes may lie between, so this alone is not a
            # contradiction.
            if before is known and signer == before.key:
                return _conflict(known, contradiction=True)
            return Declined(INCONSISTENT, "the note does not follow the checkpoint that should precede it")
        before = checkpoint
    return signer


def _opened(note: str, origin: str, keys: Iterable[bytes]) -> tuple[bytes, Checkpoint | None]:
    """The key that signed the note of a log, and its checkpoint."""
    for key in keys:
        checkpoint = open_note(note, origin, key)
        if not isinstance(checkpoint, Flaw) and checkpoint.origin == origin:
            return key, checkpoint
    return b"", None


def _conflict(known: Checkpoint | None, *, contradiction: bool) -> Declined:
    size = 0 if known is None else known.size
    text = "the note contradicts what was cosigned before, or the order of a log"
    return Declined(CONFLICT, text, size, contradiction)
