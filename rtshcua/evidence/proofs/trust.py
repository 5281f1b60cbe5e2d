"""Establishes the trust in a proof's checkpoint: the notes from one that the log key signed up to it.

The trust root names the log key for duty `log` and the log's vehicle, and the pinned key signed the trust root.
Keys are judged at the given time, even if they have expired since.
"""

from typing import NamedTuple
from urllib.parse import unquote

from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.log_writer import origin_of
from rtshcua.evidence.note import ID_BYTES, Checkpoint, key_id, open_note, parse, read_signature, renamed, split
from rtshcua.evidence.rooted import may_not_sign, trusted_root
from rtshcua.evidence.witnessing.cosign import Cosignature, read_cosignature
from rtshcua.wire.keys import Duty, VerificationKey
from rtshcua.wire.trust import TrustRoot


class LogName(NamedTuple):
    """The vehicle and the flight of a log."""

    origin: str
    vehicle: str
    boot: str


class Believed(NamedTuple):
    """Checkpoints that rest on the pinned key, in order, and their evidence. `certified`: the log key itself signed
    the last one, not the key of an epoch. `cosigned`: the trusted witnesses that cosigned the last one.
    """

    name: LogName
    checkpoints: tuple[Checkpoint, ...]
    certified: bool
    log_key: VerificationKey
    root: TrustRoot
    cosigned: tuple[Cosignature, ...] = ()

    @property
    def anchored(self) -> bool:
        """Whether as many witnesses cosigned the last checkpoint as the trust root requires."""
        return len(self.cosigned) >= self.root.witness_threshold


def believe(notes: tuple[str, ...], root: bytes, pinned: bytes, now_us: int) -> Believed | Flaw:
    """The checkpoints of the notes, the first of which the log key signed, or the flaw. Witnesses may have cosigned
    the last one.

    `pinned` is the root's public key (32 bytes) or its `kid` (16 bytes); `now_us` is UTC.
    """
    first = parse(split(notes[0])[0])
    if isinstance(first, Flaw):
        return renamed(first, "proof")
    name = name_of(first.origin)
    if isinstance(name, Flaw):
        return name
    trusted = trusted_root(root, pinned, now_us)
    if isinstance(trusted, Flaw):
        return trusted
    log_key = signer(trusted, _signer_id(notes[0]), name, now_us)
    if isinstance(log_key, Flaw):
        return log_key
    *chain, last = notes
    text, lines = split(last)
    followed = _follow((*chain, f"{text}\n{lines[0]}" if lines else last), name, log_key, trusted)
    if isinstance(followed, Flaw):
        return followed
    cosigned = _cosigned(text, lines[1:], trusted.witnesses(name.vehicle, now_us))
    return cosigned if isinstance(cosigned, Flaw) else followed._replace(cosigned=cosigned)


def _cosigned(text: str, lines: list[str], witnesses: frozenset[bytes]) -> tuple[Cosignature, ...] | Flaw:
    found: dict[bytes, Cosignature] = {}
    for line in lines:
        cosignature = read_cosignature(line, text, witnesses)
        if isinstance(cosignature, Flaw):
            return cosignature._replace(slug="proof/cosignature")
        if cosignature is None or cosignature.public in found:
            return Flaw(
                "proof/note",
                "a line below the checkpoint is a duplicate, or by a witness that the trust root does not name",
            )
        found[cosignature.public] = cosignature
    return tuple(found.values())


def _follow(notes: tuple[str, ...], name: LogName, log_key: VerificationKey, root: TrustRoot) -> Believed | Flaw:
    checkpoints: list[Checkpoint] = []
    public, certified = log_key.public, True
    for note in notes:
        if checkpoints:
            last = checkpoints[-1]
            if last.key is None:
                return Flaw("proof/chain", "a checkpoint follows the one that ends its log")
            certified = _signer_id(note) != key_id(name.origin, last.key)
            public = log_key.public if certified else last.key
        opened = open_note(note, name.origin, public)
        if isinstance(opened, Flaw):
            return renamed(opened, "proof")
        if opened.origin != name.origin:
            return Flaw("proof/chain", "the checkpoints are of different logs", opened.origin, name.origin)
        if checkpoints and opened.size <= checkpoints[-1].size:
            text = "the checkpoints are out of order"
            return Flaw("proof/chain", text, str(opened.size), f"more than {checkpoints[-1].size}")
        checkpoints.append(opened)
    return Believed(name, tuple(checkpoints), certified, log_key, root)


def name_of(origin: str) -> LogName | Flaw:
    """The parts of the origin of a log."""
    parts = origin.split("/")
    if len(parts) == 4:
        name = LogName(origin, unquote(parts[2]), parts[3])
        if origin == origin_of(name.vehicle, name.boot):
            return name
    return Flaw("proof/origin", "not a log of this program", origin[:160], "rtshcua/log/<vehicle>/<boot>")


def signer(root: TrustRoot, short: bytes, name: LogName, now_us: int) -> VerificationKey | Flaw:
    """The key for duty `log` that a note names by four octets and that may sign for the vehicle."""
    for key in root.keys_for(Duty.LOG).values():
        if key_id(name.origin, key.public) == short:
            return may_not_sign(key, name.vehicle, now_us) or key
    text = "not signed by a key of duty `log` in the trust root: the signer was not authorised"
    return Flaw("trust/log-key", text, short.hex())


def _signer_id(note: str) -> bytes:
    _, signatures = split(note)
    return read_signature(signatures[0])[1][:ID_BYTES] if signatures else b""
