"""Where the vehicle may be between two steps, and what of that the next step is planned from.

Before the first step it stands at the declared home. A step ends where it was planned to; one that is skipped when it
is inadmissible may also leave the vehicle where it was, so there can be several places.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from rtshcua.decision.evaluate import Environment
from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.decision.values import point
from rtshcua.decision.volume import Volume
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.ground.prove.situation import Ground
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.mission import OnInadmissible

#: so many places are followed; where steps that may be skipped leave more, the rest is left for on board
MOST_PLACES = 16


class Place(NamedTuple):
    """Local x, y and the height in mm, and whether the vehicle is in the air."""

    x: int
    y: int
    height: int
    aloft: bool


AT_HOME = Place(0, 0, 0, aloft=False)


def end(invocation: PreparedInvocation, start: Place) -> Place:
    """Where a step ends that began at `start` and was done."""
    plan = invocation.invocation.plan
    x, y = plan.path[-2:] if plan.path else start[:2]
    match plan.kind:
        case MotionKind.HOME | MotionKind.LAND:
            return Place(x, y, 0, aloft=False)
        case MotionKind.HOLD:
            return start
        case _:
            return Place(x, y, plan.altitude, aloft=True)


def after(invocation: PreparedInvocation, starts: Sequence[Place], able: Sequence[Place]) -> tuple[Place, ...]:
    """Where the vehicle may be after a step that may come at any of `starts`, and may begin at those that are `able`.

    No regard is had to `MOST_PLACES`.
    """
    ends = [end(invocation, start) for start in able]
    if may_be_skipped(invocation):
        ends += starts
    return tuple(dict.fromkeys(ends))


def may_be_skipped(invocation: PreparedInvocation) -> bool:
    """Whether the mission goes on without a step that is not admitted."""
    return invocation.invocation.on_inadmissible == OnInadmissible.SKIP


def from_where(
    ground: Ground, invocation: PreparedInvocation, starts: Sequence[Place], proof: Callable[[Place], None]
) -> tuple[Place, ...]:
    """The places where a proof of something that admission asks for finds nothing; empty if that forbids the step.

    A step that may be skipped is, where it is not admitted: so it must only be admitted somewhere.
    """
    found = ground.context.report.found
    able: list[Place] = []
    set_aside: list[Diagnostic] = []
    for start in starts:
        before = len(found)
        proof(start)
        if len(found) == before:
            able.append(start)
        elif may_be_skipped(invocation):
            set_aside += found[before:]
            del found[before:]
        else:
            return ()
    if not able:
        found += set_aside[:1]
    return tuple(able)


def planned(ground: Ground, invocation: PreparedInvocation, start: Place) -> tuple[Environment, Volume]:
    """Any state of a vehicle that is at `start`, and the volume that the step is planned to take from there."""
    known = ground.prepared.tables.known
    at = ground.around(invocation)
    slots = list(at.slots)
    slots[known.x], slots[known.y], slots[known.height] = point(start.x), point(start.y), point(start.height)
    return at.over(slots, None, 0), invocation.planner.volume(slots, known)


def from_home(x: int, y: int) -> str:
    """A place in words, to the nearest metre."""
    east, north = (x + 500) // 1000, (y + 500) // 1000
    words = [f"{abs(east)} m {'east' if east > 0 else 'west'}"] if east else []
    words += [f"{abs(north)} m {'north' if north > 0 else 'south'}"] if north else []
    return f"{' and '.join(words)} of home" if words else "at home"
