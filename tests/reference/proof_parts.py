"""Take proofs and receipts apart and assemble them without any code of `rtshcua.evidence`, for forgeries."""

import json
from base64 import b64decode, b64encode
from hashlib import sha256
from typing import Any

import msgspec

from reference.sealed_log import LOG_KEY, PIN, SealedLog, sealed_log, sign
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.proofs.check import check_proof
from rtshcua.evidence.proofs.cose_receipt import check_receipt
from rtshcua.evidence.proofs.make import prove_consistency, prove_inclusion, receipt_of
from rtshcua.wire import cbor
from rtshcua.wire.keys import Duty, SigningKey
from virtual import case

LOG = sealed_log()
OTHER = sealed_log(boot=bytes(16))
THIEF = SigningKey.from_seed(bytes([66]) * 32, duty=Duty.LOG, development=True)


class Parts:
    """A proof taken apart."""

    def __init__(self, data: bytes | Flaw) -> None:
        assert isinstance(data, bytes), data
        head, _, self.note = data.decode().partition("\n\n")
        self.kind, extra, self.number, *self.path = head.split("\n")
        _, _, self.extra = cbor.decode(b64decode(extra.removeprefix("extra ")))  # type: ignore[misc]
        self.extra: dict[str, Any] = dict(self.extra)

    def together(self) -> bytes:
        extra = b64encode(cbor.encode(("rtshcua/proof", 1, self.extra))).decode()
        return "\n".join([self.kind, f"extra {extra}", self.number, *self.path, "", self.note]).encode()

    def slug(self) -> str:
        checked = check_proof(self.together(), PIN)
        return checked.slug if isinstance(checked, Flaw) else "believed"


def inclusion(number: int, log: SealedLog = LOG, at: int | None = None) -> Parts:
    return Parts(prove_inclusion(lambda: log.lines, number, at))


def consistency(old: int, at: int | None = None, log: SealedLog = LOG) -> Parts:
    return Parts(prove_consistency(lambda: log.lines, old, at))


def signed(text: str, key: SigningKey, name: str) -> str:
    """A note, as in c2sp.org/signed-note."""
    short = sha256(name.encode() + b"\n\x01" + key.public).digest()[:4]
    signature = key.private.sign(text.encode())
    return f"{text}\n\u2014 {name} {b64encode(short + signature).decode()}\n"


def origin(log: SealedLog) -> str:
    note: str = json.loads(log.lines[0])["checkpoint"]
    return note.split("\n")[0]


def changed_root(**fields: object) -> bytes:
    """The trust root with a log key of other rights, signed by the right root key."""
    root = case.root()[0]
    keys = tuple(msgspec.structs.replace(key, **fields) if key.duty is Duty.LOG else key for key in root.keys)
    return msgspec.structs.replace(root, keys=keys).sign(case.KEYS[Duty.ROOT])


def receipt_of_record(number: int) -> bytes:
    made = receipt_of(lambda: LOG.lines, number, None, kid=LOG_KEY.kid, signer=sign)
    assert isinstance(made, bytes), made
    return made


def slug_of_receipt(data: bytes) -> str:
    checked = check_receipt(data, PIN)
    return checked.slug if isinstance(checked, Flaw) else "believed"


def receipt(
    protected: dict[int, Any] | None = None, size: Any = 6, number: Any = 3, path: Any = None,
    unprotected: dict[Any, Any] | None = None, payload: Any = None, signature: Any = None, sign_it: bool = False,
) -> bytes:  # fmt: skip
    """A receipt with some of its parts replaced; with `sign_it` by the log key itself."""
    parts: Any = cbor.decode(receipt_of_record(3)[1:])
    head = cbor.encode(cbor.decode(parts[0]) | protected) if protected is not None else parts[0]  # type: ignore[operator]
    mine: Any = cbor.decode(parts[1][396][-1][0])
    proof = cbor.encode((size, number, mine[2] if path is None else path))
    loose = {**parts[1], 396: {-1: (proof,)}} | (unprotected or {})
    made = parts[3] if signature is None else signature
    if sign_it:
        text = prove_inclusion(lambda: LOG.lines, 3)
        root = b64decode(Parts(text).note.split("\n")[2])
        made = sign(cbor.encode(("Signature1", head, b"", root)))
    return b"\xd2" + cbor.encode((head, loose, payload, made))
