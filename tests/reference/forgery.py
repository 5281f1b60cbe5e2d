"""A real log, and what an attacker would do to it: lines are forged here without any code of `rtshcua.evidence`.

`expect` gives the slug and the record at which the audit of forged lines ends.
"""

import json
from base64 import b64encode
from collections.abc import Iterable
from functools import cache
from hashlib import sha256
from typing import Any
from urllib.parse import quote

from rtshcua.ground.auditor.audit import Audit, audit
from rtshcua.simulation.faults import BatteryLevel
from rtshcua.wire.keys import Duty, SigningKey
from virtual import case
from virtual.flight import Flight

ROOT_KEY = case.KEYS[Duty.ROOT].public
LOG_KEY = case.KEYS[Duty.LOG]


@cache
def flight() -> tuple[bytes, ...]:
    """A short flight that completes."""
    return tuple(Flight(case.seal(case.mission(case.short_steps())), case.simulated("px4")).fly().lines)


@cache
def other_flight() -> tuple[bytes, ...]:
    """Another mission, which comes home early on a low battery."""
    bundle = case.seal(case.mission(case.short_steps(), issued_at_us=case.flat.ISSUED + 1))
    config = case.simulated("px4", faults=(BatteryLevel(18_000_000, 2_000),))
    return tuple(Flight(bundle, config).fly().lines)


def prove(lines: Iterable[bytes], pinned: bytes = ROOT_KEY) -> Audit:
    """The audit under the right root key."""
    return audit(lines, pinned)


def expect(lines: Iterable[bytes], pinned: bytes = ROOT_KEY) -> tuple[str, int]:
    """Slug and record of what is wrong."""
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
    """Numbered and linked anew, with a close that counts right: all that can be done without the log key."""
    done = renumbered(lines)
    if read(done[-1])["type"] == "close":
        done[-1] = edit(done[-1], count=len(done) - 1)
    return rehashed(done)


def signed(lines: Iterable[bytes], key: SigningKey = LOG_KEY) -> list[bytes]:
    """Rewritten and signed: what a holder of the log key can do."""
    *body, last = rewritten(lines)
    genesis = read(body[0])
    origin = f"rtshcua/log/{quote(genesis['vehicle'], safe='')}/{genesis['boot']}"
    root = _tree([leaf(line) for line in [*body, edit(last, checkpoint=None)]])
    text = f"{origin}\n{len(body) + 1}\n{b64encode(root).decode()}\n"
    key_id = sha256(origin.encode() + b"\n\x01" + key.public).digest()[:4]
    signature = b64encode(key_id + key.sign(text.encode(), duty=Duty.LOG)).decode()
    return [*body, edit(last, checkpoint=f"{text}\n\u2014 {origin} {signature}\n")]


def _tree(leaves: list[bytes]) -> bytes:
    """RFC 9162, section 2.1.1, recursively."""
    if len(leaves) == 1:
        return leaves[0]
    half = 1 << (len(leaves) - 1).bit_length() - 1
    return sha256(b"\x01" + _tree(leaves[:half]) + _tree(leaves[half:])).digest()
