"""E0619, E0621: where each step may begin, and that it finds there what it needs: in the air or not, where, how high.

Before the first step the vehicle stands at the declared home. A step ends where it was planned to; one that is skipped
when it is inadmissible may also leave the vehicle where it was, so there can be several places.

What a motion determines is the position, the height above home, and the landed state that the autopilot reports. A
clause of `require` or `assume` that cannot hold with these, whatever everything else is, is what no step brought about.
A vehicle that has not climbed cannot fly, survey or hold: no autopilot does that from the ground.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from rtshcua.decision.evaluate import Environment
from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.decision.values import TRUE, point
from rtshcua.decision.volume import Volume
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.span import Span
from rtshcua.ground.prove.proof_context import ProofContext
from rtshcua.ground.prove.step_times import MissionStep
from rtshcua.mavlink.enums import MAV_LANDED_STATE_IN_AIR, MAV_LANDED_STATE_ON_GROUND
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.mission import OnInadmissible
from rtshcua.model.flat.signal import ENUMERATION
from rtshcua.model.ir.missions import MissionDecl
from rtshcua.model.quantity import Dimension, display

#: so many places are followed; where steps that may be skipped leave more, the rest is left for on board
MOST_PLACES = 16


class StartPlace(NamedTuple):
    """Local x, y and the height in mm, and whether the vehicle is in the air."""

    x: int
    y: int
    height: int
    aloft: bool


AT_HOME = StartPlace(0, 0, 0, aloft=False)


def place_after(invocation: PreparedInvocation, start: StartPlace) -> StartPlace:
    """Where a step ends that began at `start` and was done."""
    plan = invocation.invocation.plan
    x, y = plan.path[-2:] if plan.path else start[:2]
    match plan.kind:
        case MotionKind.HOME | MotionKind.LAND:
            return StartPlace(x, y, 0, aloft=False)
        case MotionKind.HOLD:
            return start
        case _:
            return StartPlace(x, y, plan.altitude, aloft=True)


def places_after(
    invocation: PreparedInvocation, starts: Sequence[StartPlace], able: Sequence[StartPlace]
) -> tuple[StartPlace, ...]:
    """Where the vehicle may be after a step that may come at any of `starts`, and may begin at those that are `able`.

    No regard is had to `MOST_PLACES`.
    """
    ends = [place_after(invocation, start) for start in able]
    if may_be_skipped(invocation):
        ends += starts
    return tuple(dict.fromkeys(ends))


def may_be_skipped(invocation: PreparedInvocation) -> bool:
    """Whether the mission goes on without a step that is not admitted."""
    return invocation.invocation.on_inadmissible == OnInadmissible.SKIP


def from_where(
    proof: ProofContext,
    invocation: PreparedInvocation,
    starts: Sequence[StartPlace],
    finds: Callable[[StartPlace], None],
) -> tuple[StartPlace, ...]:
    """The places where `finds`, which proves what admission asks for, reports nothing; none if that forbids the step.

    A step that may be skipped is, where it is not admitted: so it must only be admitted somewhere.
    """
    found = proof.report.found
    able: list[StartPlace] = []
    set_aside: list[Diagnostic] = []
    for start in starts:
        before = len(found)
        finds(start)
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


def planned(proof: ProofContext, invocation: PreparedInvocation, start: StartPlace) -> tuple[Environment, Volume]:
    """Any state of a vehicle that is at `start`, and the volume that the step is planned to take from there."""
    known = proof.prepared.tables.known
    at = proof.around(invocation)
    slots = list(at.slots)
    slots[known.x], slots[known.y], slots[known.height] = point(start.x), point(start.y), point(start.height)
    return at.over(slots, None, 0), invocation.planner.volume(slots, known)


def from_home(x: int, y: int) -> str:
    """A place in words, to the nearest metre."""
    east, north = (x + 500) // 1000, (y + 500) // 1000
    words = [f"{abs(east)} m {'east' if east > 0 else 'west'}"] if east else []
    words += [f"{abs(north)} m {'north' if north > 0 else 'south'}"] if north else []
    return f"{' and '.join(words)} of home" if words else "at home"


#: where an autopilot reports whether it has landed
LANDED = ("EXTENDED_SYS_STATE", "landed_state")

_ALOFT = {MotionKind.FLY: "flies somewhere", MotionKind.COVER: "flies a survey", MotionKind.HOLD: "holds in the air"}


def prove_aloft(
    proof: ProofContext, step: MissionStep, starts: Sequence[StartPlace], skipped: Sequence[MissionStep]
) -> tuple[StartPlace, ...]:
    """All of `starts` if the vehicle can do there what a step does, nowhere after a finding: that it is on the ground.

    That it cannot hold or fly there is not asked when the step is admitted, so `skip` does not help against that.
    """
    flat = step.flat
    for start in starts:
        if not start.aloft and flat.plan.kind in _ALOFT:
            motion = proof.skills[flat.contract.name].motion
            assert motion is not None
            words = f"`{flat.contract.name}` {_ALOFT[MotionKind(flat.plan.kind)]}"
            help = "let a step before it climb, as `takeoff` does"
            before = () if start is starts[0] else skipped
            _report_unchained(proof, step, start, words, (motion.span, "its motion"), before, help)
            return ()
    return tuple(starts)


def prove_start(
    proof: ProofContext, step: MissionStep, starts: Sequence[StartPlace], skipped: Sequence[MissionStep]
) -> tuple[StartPlace, ...]:
    """Where of `starts` a step finds what it needs, nowhere after a finding: the first thing that it lacks.

    The first of `starts` is where it begins when none of the steps that may be `skipped` was.
    """

    def finds(start: StartPlace) -> None:
        clause = _lacking(proof, step.prepared, start)
        if clause is not None:
            words, label = f"it needs `{clause.text}`", (proof.span(clause), "the contract asks for this")
            help, before = "add a step before it that brings this about", () if start is starts[0] else skipped
            _report_unchained(proof, step, start, words, label, before, help)

    return from_where(proof, step.prepared, starts, finds)


def _report_unchained(
    proof: ProofContext,
    step: MissionStep,
    start: StartPlace,
    words: str,
    label: tuple[Span, str],
    skipped: Sequence[MissionStep],
    help: str,
) -> None:
    proof.report.add(
        codes.NOT_CHAINED,
        step.span,
        f"{words}, and when this step begins the vehicle {'may be' if skipped else 'is'} {_place_text(start)}",
        help="a step before it may be skipped: let that `abort` or `hold`" if skipped else help,
        labels=[label, *((each.span, "this step may be skipped") for each in skipped[-1:])],
    )


def warn_not_landed(proof: ProofContext, mission: MissionDecl, step: MissionStep, ends: Sequence[StartPlace]) -> None:
    """Warn of a mission that leaves the vehicle in the air: only its contingency then brings it down."""
    for place in ends:
        if place.aloft:
            may = "ends" if place is ends[0] else "may end, when steps are skipped,"
            proof.report.add(
                codes.NOT_LANDED,
                step.span,
                f"`{mission.name.text}` {may} in the air, {_place_text(place)}",
                help="end it in a step that lands, as `return_home` does, and cannot be skipped; else the policy's "
                "contingency brings the vehicle down",
            )
            return


def _lacking(proof: ProofContext, invocation: PreparedInvocation, start: StartPlace) -> Clause | None:
    """A clause that cannot hold at `start`, and can elsewhere."""
    if not invocation.require and not invocation.assume:
        return None
    at, _ = planned(proof, invocation, start)
    slots = list(at.slots)
    for signal in proof.policy.signals:
        if signal.kind == ENUMERATION and all((each.message, *each.fields) == LANDED for each in signal.sources):
            slots[signal.slot] = point(MAV_LANDED_STATE_IN_AIR if start.aloft else MAV_LANDED_STATE_ON_GROUND)
    there = at.over(slots, None, 0)
    for clause, condition in (*invocation.require, *invocation.assume):
        if not condition(there) & TRUE and condition(proof.around(invocation)) & TRUE:
            return clause
    return None


def _place_text(place: StartPlace) -> str:
    height = f"{display(place.height, Dimension.ALTITUDE)} up" if place.aloft else "on the ground"
    return f"{height}, {from_home(place.x, place.y)}"
