"""Whose flight a run finds in the air: the effect of an earlier run's last command, or somebody else's.

Our commands do not expire: PX4 is never flown in Offboard, which needs a continuous stream, and ArduCopter flies to a
position target without a time limit (its GUID_TIMEOUT applies to velocities). Neither autopilot counts our heartbeat as
a ground station's (vehicles.md 1). So the last command stays in force without a process, until somebody, or a failsafe,
takes over.
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
    """How the vehicle is flown by somebody else; empty where a command still in force may explain it."""
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
    """The modes that may still show because of commands in force, which may reach the vehicle only now."""
    in_force = () if left is None else left.in_force
    return frozenset(mode for each in in_force for mode in flavour.shows[each.command.kind])


def arrives(left: Left | None, flavour: AutopilotFlavour, before: int, mode: int) -> bool:
    """Whether a change of mode may come from a command that was in transit: it came after a command that shows so."""
    if left is None:
        return False
    shows = [flavour.shows[each.command.kind] for each in left.in_force]
    return any(before in earlier and mode in later for earlier, later in combinations(shows, 2))


def _goes_there(of: CommandInForce, seen: ObservedVehicle, kept: int) -> bool:
    """Whether the vehicle's reported target may be the command's; without a report any command may explain it. `kept`:
    the tolerance in mm against an earlier report. It is exact where another command came later: then the vehicle most
    likely obeyed that one and was stopped since.
    """
    if seen.target is None:
        return True
    targets = list(_targets(of, seen, kept))
    return not targets or any(target.matches(seen.target) for target in targets)


def _targets(of: CommandInForce, seen: ObservedVehicle, kept: int) -> Iterator[ExpectedTarget]:
    """The targets that it may report: its last one, and the next place, which it had not reported yet. None where the
    stages come from a pack or are not known.
    """
    command, named = of
    amsl = None if seen.home_amsl is None else seen.amsl(command.altitude)
    if named is not None:
        yield ExpectedTarget(*named, within=kept, level=kept)
    if command.kind in _LEGS:
        before = None
        for number, place in enumerate(zip(command.geo[::2], command.geo[1::2], strict=True)):
            target = ExpectedTarget(*place, None if seen.home_amsl is None else seen.amsl(command.height_at(number)))
            if named is None or (before is not None and before.matches(named)):
                yield target
            before = target
    elif named is None and seen.located:
        if command.kind == MotionKind.CLIMB:  # straight up
            yield ExpectedTarget(seen.latitude, seen.longitude, amsl, ways.TAKES_OFF)
        elif command.kind == MotionKind.HOLD and (here := ways.stopping(seen)) is not None:
            yield here
