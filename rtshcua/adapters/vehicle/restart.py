"""Whose flight it is that a run finds in the air: what an earlier run of ours left it doing, or somebody else's.

Nothing of ours runs out: PX4 is never flown in Offboard, whose stream would have to go on, and ArduCopter flies to a
position target without an end (its GUID_TIMEOUT is for velocities). Neither counts our heartbeat as a ground station's
(vehicles.md 1). So what was told last is in force while there is no process, until somebody, or a failsafe, takes over.
"""

from collections.abc import Iterator
from itertools import combinations

from rtshcua.adapters.vehicle import flavour as ways
from rtshcua.adapters.vehicle.flavour import KEPT, AutopilotFlavour, ExpectedTarget
from rtshcua.adapters.vehicle.observed import ObservedVehicle
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.left import CommandInForce, Left

_LEGS = (MotionKind.FLY, MotionKind.COVER)


def flown_by(left: Left, flavour: AutopilotFlavour, seen: ObservedVehicle) -> str:
    """How it is flown by somebody else; empty where a command that was left in force may be what it does."""
    if left.taken:
        return f"{left.taken}, as the previous run commanded"
    assert seen.mode is not None
    last = len(left.in_force) - 1
    showing = [(n, each) for n, each in enumerate(left.in_force) if seen.mode in flavour.shows[each.command.kind]]
    if not showing:
        return flavour.mode_name(seen.mode)
    if seen.mode not in flavour.aims:
        return ""
    there = any(_goes_there(each, seen, kept=KEPT if number == last else 0) for number, each in showing)
    return "" if there else "another target"


def modes_of(left: Left | None, flavour: AutopilotFlavour) -> frozenset[int]:
    """The modes that may still show of what was left in force, which may get there only now."""
    in_force = () if left is None else left.in_force
    return frozenset(mode for each in in_force for mode in flavour.shows[each.command.kind])


def arrives(left: Left | None, flavour: AutopilotFlavour, before: int, mode: int) -> bool:
    """Whether a change of mode may come from a command that was still on its way: it came after one that shows so."""
    if left is None:
        return False
    shows = [flavour.shows[each.command.kind] for each in left.in_force]
    return any(before in earlier and mode in later for earlier, later in combinations(shows, 2))


def _goes_there(of: CommandInForce, seen: ObservedVehicle, kept: int) -> bool:
    """Whether the target that the vehicle names may be the command's; one that names none may go to any.

    `kept`: how far off, in mm, what it names may be from what it named before. To the digit, where another command came
    after this one: then it most likely obeyed that, and was stopped since.
    """
    if seen.target is None:
        return True
    targets = list(_targets(of, seen, kept))
    return not targets or any(target.matches(seen.target) for target in targets)


def _targets(of: CommandInForce, seen: ObservedVehicle, kept: int) -> Iterator[ExpectedTarget]:
    """Where it may say that it flies to: what it said last, and the next place, of which it had said nothing yet.

    Nothing where it goes by a way of its own, or where nobody knows.
    """
    command, named = of
    amsl = None if seen.home_amsl is None else seen.amsl(command.altitude)
    if named is not None:
        yield ExpectedTarget(*named, within=kept, level=kept)
    if command.kind in _LEGS:
        before = None
        for place in zip(command.geo[::2], command.geo[1::2], strict=True):
            target = ExpectedTarget(*place, amsl)
            if named is None or (before is not None and before.matches(named)):
                yield target
            before = target
    elif named is None and seen.located:
        if command.kind == MotionKind.CLIMB:  # straight up
            yield ExpectedTarget(seen.latitude, seen.longitude, amsl, ways.TAKES_OFF)
        elif command.kind == MotionKind.HOLD and (here := ways.stopping(seen)) is not None:
            yield here
