"""One flight for each kind of fault: its log and its raw frames."""

from functools import cache
from typing import NamedTuple

from msgspec.structs import replace

from reference.flat_case import MIN, M, S
from reference.kept_frames import Entries, kept
from rtshcua.model.faults import BatteryLevel, Fault, GpsLoss, LinkSilence, Obstacle, PilotMode, WindStep
from rtshcua.model.flat.mission import Invocation
from rtshcua.model.flat.policy import Policy
from rtshcua.onboard.enforcement.load import EnforcementMode
from virtual import case
from virtual.flight import Flight
from virtual.once import once

FAULTS: dict[str, tuple[Fault, ...]] = {
    "none": (),
    "low battery": (BatteryLevel(15 * S, 2_000),),
    "empty battery on the ground": (BatteryLevel(0, 1_500),),
    "wind": (WindStep(15 * S, 14 * M),),
    "no fix": (GpsLoss(15 * S),),
    "no fix for a while": (GpsLoss(12 * S, 4 * S),),
    "obstacle": (Obstacle(15 * S, 2 * M),),
    "pilot": (PilotMode(15 * S),),
    "silence": (LinkSilence(15 * S),),
}
#: faults flown with the whole reference mission; the others with its first leg, on which the fault occurs
WHOLE = ("none", "obstacle")


class Recorded(NamedTuple):
    """The lines of a flight's log, and the received and sent frames: (UTC us, frame)."""

    lines: tuple[bytes, ...]
    entries: Entries


@cache
def recorded(fault: str, flavour: str, mode: EnforcementMode = EnforcementMode.SOFTWARE) -> Recorded:
    """Fly a mission with one of `FAULTS`. A vehicle that is never received again flies for at most 2 minutes."""
    return once(f"{fault}-{flavour}-{mode}", lambda: _flown(fault, flavour, mode))


@cache
def fallen_back(flavour: str) -> Recorded:
    """Fly a mission with wind above the limit on a leg, so that the step's chain flies."""
    return once(f"fallen_back-{flavour}", lambda: _fly(flavour, (WindStep(20 * S, 14 * M),), case.short_steps()))


def _flown(fault: str, flavour: str, mode: EnforcementMode) -> Recorded:
    policy = case.policy()
    if fault == "silence":
        policy = replace(policy, vehicle=replace(policy.vehicle, endurance_us=2 * MIN))
    steps = None if fault in WHOLE else case.short_steps()
    return _fly(flavour, FAULTS[fault], steps, policy, mode)


def _fly(
    flavour: str, faults: tuple[Fault, ...], steps: tuple[Invocation, ...] | None, policy: Policy | None = None,
    mode: EnforcementMode = EnforcementMode.SOFTWARE,
) -> Recorded:  # fmt: skip
    bundle = case.seal(case.mission(steps), policy)
    flight = Flight(bundle, case.simulated(flavour, faults=faults), mode=mode, attested=False)
    entries = kept(flight)
    return Recorded(tuple(flight.fly().lines), entries)
