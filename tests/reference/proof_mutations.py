"""Mutated proofs, and a check that every accepted one is true of its log.

Raw octets are changed; or the content of a proof is taken apart, changed, exchanged with that of other proofs,
and assembled in its canonical form again, so that the verifier accepts its form.
"""

import json
from base64 import b64decode, b64encode
from collections.abc import Callable
from functools import cache
from random import Random
from typing import Any

from reference.sealed_log import LOG_KEY, PIN, SealedLog, sealed_log, sign
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.proofs.check import Proven, check_proof
from rtshcua.evidence.proofs.cose_receipt import ReceiptClaim, check_receipt
from rtshcua.evidence.proofs.make import (
    prove_consistency,
    prove_inclusion,
    receipt_of,
    with_cosignatures,
)
from rtshcua.evidence.witnessing.cosign import cosign
from rtshcua.wire import cbor
from rtshcua.wire.keys import Duty
from virtual import case

WITNESS = case.KEYS[Duty.WITNESS]
SEEN_S = 1_750_000_100


@cache
def logs() -> tuple[SealedLog, ...]:
    """Two logs: one with a recovery, and one of another boot of the same vehicle."""
    return sealed_log(recovers=True), sealed_log(boot=bytes(16)), sealed_log(boot=bytes([7]) * 16, mission="other")


@cache
def proofs() -> tuple[bytes, ...]:
    """Proofs of every kind, of each log."""
    made: list[bytes | Flaw] = []
    for log in logs():
        last = len(log.lines) - 1
        made += [prove_inclusion(lambda log=log: log.lines, number) for number in (1, 8, last - 1, last)]
        made += [prove_consistency(lambda log=log: log.lines, old) for old in log.signed[:-1]]
        made += [receipt_of(lambda log=log: log.lines, n, None, kid=LOG_KEY.kid, signer=sign) for n in (1, 8)]
    made += [with_cosignatures(_sound(made[0]), [cosigned(logs()[0])])]
    return tuple(_sound(proof) for proof in made)


def cosigned(log: SealedLog, number: int | None = None) -> str:
    """The anchor that a witness makes of the first seal, or of that signed record."""
    note = str(json.loads(log.lines[log.signed[1] if number is None else number])["checkpoint"])
    text = note.rpartition("\n\n")[0] + "\n"
    return note + cosign(text, SEEN_S, WITNESS.public, lambda data: WITNESS.sign(data, duty=Duty.WITNESS))


def _sound(proof: bytes | Flaw) -> bytes:
    assert isinstance(proof, bytes), proof
    return proof


def mutated(of: Random) -> bytes:
    """Return a random proof, changed once or a few times."""
    return changed(of.choice(proofs()), of)


def changed(data: bytes, of: Random) -> bytes:
    """Return the octets, changed once or a few times."""
    for _ in range(of.choice((1, 1, 1, 2, 3))):
        data = of.choice(_MUTATIONS)(data, of)
    return data


def check(data: bytes) -> str:
    """Return the slug of a refusal, or `true` if the proof is true of a log; fail for a false accepted proof."""
    result = check_receipt(data, PIN) if data[:1] == b"\xd2" else check_proof(data, PIN)
    if isinstance(result, Flaw):
        assert result.slug.partition("/")[0] in ("proof", "trust"), result
        return result.slug
    assert any(_true(result, log) for log in logs()), "a forged proof was believed"
    return "true"


def _true(result: Proven | ReceiptClaim, log: SealedLog) -> bool:
    genesis = json.loads(log.lines[0])
    name = result.name if isinstance(result, ReceiptClaim) else result.believed.name
    if (name.vehicle, name.boot) != (genesis["vehicle"], genesis["boot"]):
        return False
    true = json.loads(log.lines[result.number])
    if isinstance(result, ReceiptClaim):
        return _line(result.record) == log.lines[result.number] and result.number < result.size
    if any((each.public, each.time_s) != (WITNESS.public, SEEN_S) for each in result.believed.cosigned):
        return False
    notes = {json.loads(log.lines[at])["checkpoint"].rpartition("\n\n")[0] + "\n" for at in log.signed}
    if result.checkpoint.text() not in notes or (result.older and result.older.text() not in notes):
        return False
    if result.record is None:
        return result.older is not None and result.older.size == result.number
    if result.record is result.signed:
        true["checkpoint"] = None
    return bool(json.loads(_line(result.record)) == true)


def _line(record: Any) -> bytes:
    from rtshcua.evidence.records import encode

    return encode(record)


def _octets(data: bytes, of: Random) -> bytes:
    at = of.randrange(len(data) or 1)
    match of.randrange(5):
        case 0 if data:
            return data[:at] + bytes([data[at] ^ 1 << of.randrange(8)]) + data[at + 1 :]
        case 1:
            return data[:at] + bytes([of.randrange(256)]) + data[at:]
        case 2:
            return data[:at] + data[at + of.choice((1, 2, 4, 64)) :]
        case 3:
            other = of.choice(proofs())
            return data[:at] + other[at:]
    return data[:at]


def _lines(data: bytes, of: Random) -> bytes:
    lines, others = data.split(b"\n"), of.choice(proofs()).split(b"\n")
    at = of.randrange(len(lines))
    match of.randrange(5):
        case 0:
            lines[at] = of.choice(others)
        case 1:
            del lines[at]
        case 2:
            lines.insert(at, of.choice(lines + others))
        case 3:
            other = of.randrange(len(lines))
            lines[at], lines[other] = lines[other], lines[at]
        case _:
            word, _, number = lines[at].partition(b" ")
            lines[at] = word + b" %d" % of.choice((0, 1, 2, 6, 12, 18, 1 << 52)) if number.isdigit() else b""
    return b"\n".join(lines)


def _path(data: bytes, of: Random) -> bytes:
    """Replace one or two hashes of a path, or add or remove one."""
    head, blank, note = data.partition(b"\n\n")
    lines = head.split(b"\n")
    if data[:1] == b"\xd2" or len(lines) < 4:
        return data
    at = of.randrange(3, len(lines))
    lines[at : at + of.choice((0, 1, 1, 2))] = [b64encode(of.randbytes(32))] * of.choice((0, 1, 1, 1))
    return b"\n".join(lines) + blank + note


def _parts(data: bytes, of: Random) -> bytes:
    """Take the content of a proof apart, and change it."""
    other = of.choice(proofs())
    try:
        if data[:1] == b"\xd2":
            value = cbor.decode(data[1:])
            return b"\xd2" + cbor.encode(_changed(value, cbor.decode(other[1:]) if other[:1] == b"\xd2" else None, of))
        head, extra, rest = data.split(b"\n", 2)
        mine = cbor.decode(b64decode(extra[6:]))
        theirs = cbor.decode(b64decode(other.split(b"\n", 2)[1][6:])) if other[:1] != b"\xd2" else None
        return b"\n".join((head, b"extra " + b64encode(cbor.encode(_changed(mine, theirs, of))), rest))
    except (ValueError, RecursionError):
        return data


def _changed(value: Any, theirs: Any, of: Random) -> Any:
    """The value with a change, or with a part of another value."""
    if isinstance(value, dict) and value:
        key = of.choice(list(value))
        if isinstance(theirs, dict) and key in theirs and of.random() < 0.4:
            return value | {key: theirs[key]}
        if of.random() < 0.1:
            return {name: each for name, each in value.items() if name != key}
        inner = theirs[key] if isinstance(theirs, dict) and key in theirs else None
        return value | {key: _changed(value[key], inner, of)}
    if isinstance(value, tuple) and value:
        at = of.randrange(len(value))
        match of.randrange(6):
            case 0:
                return value[:at] + value[at + 1 :]
            case 1:
                return (*value[:at], value[of.randrange(len(value))], *value[at:])
            case 2 if isinstance(theirs, tuple) and theirs:
                return (*value[:at], of.choice(theirs), *value[at + 1 :])
        inner = theirs[at] if isinstance(theirs, tuple) and at < len(theirs) else None
        return (*value[:at], _changed(value[at], inner, of), *value[at + 1 :])
    if isinstance(value, bytes) and value:
        return _octets(value, of) if of.random() < 0.8 else b""
    if isinstance(value, str) and value:
        return _octets(value.encode(), of).decode("utf-8", "replace")
    return of.choice((None, 0, 1, -1, 7, True, "", b"", (), {}, 1 << 60))


_MUTATIONS: tuple[Callable[[bytes, Random], bytes], ...] = (_octets, _lines, _path, *[_parts] * 4)
