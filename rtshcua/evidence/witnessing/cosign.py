"""Cosignatures of witnesses (c2sp.org/tlog-cosignature, Ed25519): further signature lines below a checkpoint.

A witness signs the time and the text of the checkpoint. Its name is not signed: only its key identifies it.
"""

from collections.abc import Callable, Iterable
from typing import Final, NamedTuple

from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.note import ID_BYTES, key_id, read_signature, signature_line, split
from rtshcua.wire.keys import Duty, verified
from rtshcua.wire.keys import key_id as kid_of

COSIGNATURE: Final = b"\x04"
_HEADER: Final = "cosignature/v1\n"
_TIME_BYTES: Final = 8
_SIGNATURE_BYTES: Final = 64
_LAST_S: Final = (1 << 63) - 1


class Cosignature(NamedTuple):
    """A cosignature: public key (32 bytes) and given name of the witness, and the time in seconds since the Unix
    epoch.
    """

    public: bytes
    name: str
    time_s: int


def name_of(public: bytes) -> str:
    """The name of one of our witnesses: the name of its key in the trust root."""
    return f"rtshcua/witness/{kid_of(Duty.WITNESS, public).hex()}"


def cosign(text: str, time_s: int, public: bytes, signer: Callable[[bytes], bytes]) -> str:
    """The signature line of a witness under the text of a checkpoint, `time_s` seconds after the Unix epoch."""
    name = name_of(public)
    signature = signer(_message(text, time_s))
    return signature_line(name, key_id(name, public, COSIGNATURE) + time_s.to_bytes(_TIME_BYTES, "big") + signature)


def read_cosignature(line: str, text: str, witnesses: Iterable[bytes]) -> Cosignature | Flaw | None:
    """The witness, by public key, who cosigned the text with this line; None for a line of anybody else.

    A line in the name of a witness with a wrong signature is a flaw.
    """
    name, octets = read_signature(line)
    if len(octets) != ID_BYTES + _TIME_BYTES + _SIGNATURE_BYTES:
        return None
    public = next((key for key in witnesses if octets[:ID_BYTES] == key_id(name, key, COSIGNATURE)), None)
    if public is None:
        return None
    signature = octets[ID_BYTES + _TIME_BYTES :]
    time_s = int.from_bytes(octets[ID_BYTES : ID_BYTES + _TIME_BYTES], "big")
    if time_s > _LAST_S or not verified(public, signature, _message(text, time_s)):
        return Flaw("anchor/signature", f"witness `{name}` did not sign this checkpoint at this time", name)
    return Cosignature(public, name, time_s)


def cosignatures(note: str, witnesses: Iterable[bytes]) -> tuple[str, list[Cosignature]] | Flaw:
    """The text of an anchor, and the witnesses who cosigned it; lines of others are skipped."""
    text, lines = split(note)
    known = list(witnesses)
    found = []
    for line in lines:
        cosignature = read_cosignature(line, text, known)
        if isinstance(cosignature, Flaw):
            return cosignature
        if cosignature is not None:
            found.append(cosignature)
    return text, found


def _message(text: str, time_s: int) -> bytes:
    return f"{_HEADER}time {time_s}\n{text}".encode()
