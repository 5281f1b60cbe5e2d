"""A real log, and forgeries of an attacker, made without any code of `rtshcua.evidence`.

`expect` gives the slug and the record at which the audit of forged lines ends. Four attackers: without keys (`edit`,
`rehashed`, `renumbered`), without keys but diligent (`rewritten`), with the key of the epoch in which the vehicle was
taken (`captured`), and with all keys from the beginning (`signed`).
"""

import json
from collections.abc import Iterable
from functools import cache
from hashlib import sha256
from itertools import count
from typing import Any

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from reference.resealing import resealed
from reference.verifiers import ROOT_KEY, agree
from rtshcua.evidence.report import LogVerdict
from rtshcua.ground.audit.audit import Audit, audit
from rtshcua.model.faults import BatteryLevel, Fault
from rtshcua.virtual.vehicle import TICK_US
from rtshcua.wire.keys import Duty, SigningKey
from virtual import case
from virtual.flight import Flight
from virtual.once import once

LOG_KEY = case.KEYS[Duty.LOG]
SIGNED = ("genesis", "seal", "recover", "close")
#: the secret of an untrusted key
STRANGER = b"\x77" * 32


def flown(bundle: bytes, *faults: Fault) -> tuple[bytes, ...]:
    """The lines of a flight's log."""
    # tests/vectors/log were flown with a return at this height, landing as it comes, and heard this often
    config = case.simulated("px4", return_mm=30 * case.M, land_mm_s=None, faults=faults)
    return tuple(Flight(bundle, config, tick_us=TICK_US, attested=False).fly().lines)


@cache
def flight() -> tuple[bytes, ...]:
    """A short flight that completes."""
    return once("flight", lambda: flown(case.seal(case.mission(case.short_steps()))))


@cache
def other_flight() -> tuple[bytes, ...]:
    """Another mission, which comes home early on a low battery."""
    bundle = case.seal(case.mission(case.short_steps(), issued_at_us=case.flat.ISSUED + 1))
    return once("other_flight", lambda: flown(bundle, BatteryLevel(18_000_000, 2_000)))


def prove(lines: Iterable[bytes], pinned: bytes = ROOT_KEY) -> Audit:
    """Audit under the right root key. The independent verifier must reach the same result."""
    lines = list(lines)
    found = audit(lines, pinned)
    agree(b"".join(lines), found, pinned)
    return found


def sound(lines: Iterable[bytes]) -> Audit:
    """Audit a valid log, deriving every decision again."""
    lines = list(lines)
    result = prove(lines)
    assert result.report.failure is None, result.report.failure
    assert result.report.verdict is LogVerdict.VERIFIED
    assert result.derived == sum(read(line)["type"] == "decision" for line in lines)
    assert result.dispatches == sum(read(line).get("event") == "dispatched" for line in lines)
    return result


def expect(lines: Iterable[bytes], pinned: bytes = ROOT_KEY) -> tuple[str, int]:
    """Return slug and record of the flaw."""
    report = prove(lines, pinned).report
    finding = report.failure or report.shortfall
    assert finding is not None, "the forgery was not noticed"
    return finding.slug, finding.record


def read(line: bytes) -> dict[str, Any]:
    """The fields of a line."""
    fields: dict[str, Any] = json.loads(line)
    return fields


def write(fields: dict[str, Any]) -> bytes:
    """The canonical line of some fields."""
    return json.dumps(fields, ensure_ascii=False, separators=(",", ":"), sort_keys=True).encode() + b"\n"


def edit(line: bytes, **fields: object) -> bytes:
    """The line with some fields set."""
    return write(read(line) | fields)


def leaf(line: bytes) -> bytes:
    """Chain link and Merkle leaf of a line."""
    return sha256(b"\x00" + line).digest()


def signers(lines: Iterable[bytes]) -> list[int]:
    """The numbers of the signed records."""
    return [number for number, line in enumerate(lines) if read(line)["type"] in SIGNED]


def rehashed(lines: Iterable[bytes]) -> list[bytes]:
    """Every line linked to the one before it; the numbers stay."""
    done: list[bytes] = []
    for line in lines:
        done.append(edit(line, _prev=leaf(done[-1]).hex() if done else "0" * 64))
    return done


def renumbered(lines: Iterable[bytes]) -> list[bytes]:
    """Every line numbered; the links stay."""
    return [edit(line, seq=seq) for seq, line in enumerate(lines)]


def rewritten(lines: Iterable[bytes]) -> list[bytes]:
    """Numbers, links and counts recomputed, checkpoints unchanged: all that is possible without a key."""
    return resealed(lines, seed_of, keep=("checkpoint",))


def signed(lines: Iterable[bytes], key: SigningKey = LOG_KEY) -> list[bytes]:
    """Rewritten and signed, as by a holder of the log key and all epoch keys."""
    return resealed(lines, lambda public: seed_of(public, key))


def captured(lines: Iterable[bytes], *secrets: bytes) -> list[bytes]:
    """Rewritten, and signed where one of these secrets is the right key, as by a holder of some keys."""
    held = {public_of(secret).hex(): secret for secret in secrets}
    return resealed(lines, lambda public: held.get(public, b""))


def by_one_key(lines: Iterable[bytes], secret: bytes) -> list[bytes]:
    """Rewritten, and signed throughout with this secret."""
    return resealed(lines, lambda _: secret)


def public_of(secret: bytes) -> bytes:
    """The Ed25519 public key of a secret seed."""
    return Ed25519PrivateKey.from_private_bytes(secret).public_key().public_bytes_raw()


def as_log_key(lines: Iterable[bytes], key: SigningKey) -> list[bytes]:
    """The lines as if `key` had been the log key from the beginning."""
    genesis, *rest = lines
    return [edit(genesis, log_key=key.public.hex(), log_kid=key.kid.hex()), *rest]


_seeds: dict[str, bytes] = {}
_numbers = count(1)


def seed_of(public: str, log_key: SigningKey = LOG_KEY) -> bytes:
    """The secret behind the public key (hexadecimal) of an epoch in these tests; the log key's for any other."""
    while public not in _seeds and len(_seeds) < 100:
        seed = next(_numbers).to_bytes(32)  # as `reference.seeds` draws them
        _seeds[public_of(seed).hex()] = seed
    return _seeds.get(public) or log_key.private.private_bytes_raw()
