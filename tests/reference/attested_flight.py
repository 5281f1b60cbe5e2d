"""A flight whose boundary signs its own evidence, waits in the air for an approval, and receives forged input."""

from collections.abc import Sequence
from functools import cache

from msgspec.structs import replace

from reference import flat_case as flat
from rtshcua.onboard.ports import BoundaryKey, Event, Presented
from rtshcua.wire.approval import ApprovalDocument, sign_approval
from rtshcua.wire.boundary_chain import START
from rtshcua.wire.keys import Duty
from virtual import case
from virtual.flight import Flight
from virtual.once import once

S = case.S
_LEG = 1


def _bundle() -> bytes:
    """Return a bundle: take off, fly a leg that a supervisor must approve, and return."""
    policy = case.policy()
    rules = list(policy.rules)
    rules[flat.CONFIRM_RULE] = replace(rules[flat.CONFIRM_RULE], skills=(flat.GOTO,), when=None)
    return case.seal(case.mission(case.low_steps()), replace(policy, rules=tuple(rules)))


def _approval(flight: Flight) -> bytes:
    flying = flight.loaded.in_force
    step = flying.bundle.mission.invocations[_LEG]
    utc_us = flight.clock.now().utc_us
    said = ApprovalDocument(
        flying.flight, flying.bundle.mission_digest, step.invocation_id, step.binding, "quad-07", "supervisor", 1,
        utc_us, utc_us + 60 * S,
    )  # fmt: skip
    return sign_approval(said, case.KEYS[Duty.APPROVAL])


def fly(session: int = 1, before: bytes = START) -> tuple[bytes, ...]:
    """The lines of the flight; 3 s after the leg was deferred come the approval, a forged one, and a forged frame."""
    boundary = BoundaryKey(case.BOUNDARY_KEY, session, before)
    flight = Flight(_bundle(), case.simulated("px4"), boundary=boundary)
    since: list[int] = []

    def each(flight: Flight) -> Sequence[Event]:
        now_us = flight.clock.elapsed_us
        if not since and any(b"approval/awaited" in line for line in flight.sink.lines[1:]):
            since.append(now_us)
        if len(since) != 1 or now_us - since[0] < 3 * S:
            return ()
        since.append(now_us)
        flight.vehicle.frames.seal(b"no frame", flight.clock.now().monotonic_us)
        good = _approval(flight)
        return [Presented(now_us, good[:-1] + bytes([good[-1] ^ 1]), 1), Presented(now_us, good, 1)]

    return tuple(flight.fly(each).lines)


@cache
def attested() -> tuple[bytes, ...]:
    """Return the first session of the boundary."""
    return once("attested", fly)


@cache
def second() -> tuple[bytes, ...]:
    """Return the next session of the same boundary with the same bundle."""
    return once("attested_again", lambda: fly(2, bytes([2]) * 32))
