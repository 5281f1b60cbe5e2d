"""E0619, E0621: each step finds the vehicle as the steps before leave it: on the ground or in the air, where, how high.

What a motion determines is the position, the height above home, and the landed state that the autopilot reports. A
clause of `require` or `assume` that cannot hold with these, whatever everything else is, is what no step brought about.
A vehicle that has not climbed cannot fly, survey or hold: no autopilot does that from the ground.
"""

from collections.abc import Sequence

from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.decision.values import TRUE, point
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.prove.places import Place, from_home, from_where, planned
from rtshcua.ground.prove.situation import Ground
from rtshcua.mavlink.enums import MAV_LANDED_STATE_IN_AIR, MAV_LANDED_STATE_ON_GROUND
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.signal import ENUMERATION
from rtshcua.model.ir.missions import MissionDecl, Step
from rtshcua.model.quantity import Dimension, display

#: where an autopilot reports whether it has landed
LANDED = ("EXTENDED_SYS_STATE", "landed_state")

_ALOFT = {MotionKind.FLY: "flies somewhere", MotionKind.COVER: "flies a survey", MotionKind.HOLD: "holds in the air"}


def aloft(
    ground: Ground, step: Step, invocation: PreparedInvocation, starts: Sequence[Place], before: Sequence[Step]
) -> tuple[Place, ...]:
    """All of `starts` if the vehicle can do there what a step does, nowhere after a finding: that it is on the ground.

    That it cannot hold or fly there is not asked when the step is admitted, so `skip` does not help against that.
    """
    flat = invocation.invocation
    for start in starts:
        if not start.aloft and flat.plan.kind in _ALOFT:
            motion = ground.context.symbols.skills[step.skill.text].motion
            assert motion is not None
            words = f"`{flat.contract.name}` {_ALOFT[MotionKind(flat.plan.kind)]}"
            skipped = [] if start is starts[0] else before
            help = "let a step before it climb, as `takeoff` does"
            _report(ground, step, start, words, (motion.span, "its motion"), skipped, help)
            return ()
    return tuple(starts)


def prove(
    ground: Ground, step: Step, invocation: PreparedInvocation, starts: Sequence[Place], before: Sequence[Step]
) -> tuple[Place, ...]:
    """Where of `starts` a step finds what it needs, nowhere after a finding: the first thing that it lacks.

    The first of `starts` is where it begins when no step `before` was skipped.
    """

    def finds(start: Place) -> None:
        clause = _lacking(ground, invocation, start)
        if clause is not None:
            words, label = f"it needs `{clause.text}`", (ground.span(clause), "the contract asks for this")
            skipped = [] if start is starts[0] else before
            _report(ground, step, start, words, label, skipped, "add a step before it that brings this about")

    return from_where(ground, invocation, starts, finds)


def _report(
    ground: Ground,
    step: Step,
    start: Place,
    words: str,
    label: tuple[Span, str],
    before: Sequence[Step],
    help: str,
) -> None:
    skipped = [each for each in before if each.on_inadmissible == "skip"]
    ground.context.report.add(
        codes.NOT_CHAINED,
        step.span,
        f"{words}, and when this step begins the vehicle {'may be' if skipped else 'is'} {_is(start)}",
        help="a step before it may be skipped: let that `abort` or `hold`" if skipped else help,
        labels=[label, *((each.span, "this step may be skipped") for each in skipped[-1:])],
    )


def ending(ground: Ground, mission: MissionDecl, step: Step, ends: Sequence[Place]) -> None:
    """Warn of a mission that leaves the vehicle in the air: only its contingency then brings it down."""
    for place in ends:
        if place.aloft:
            may = "ends" if place is ends[0] else "may end, when steps are skipped,"
            ground.context.report.add(
                codes.NOT_LANDED,
                step.span,
                f"`{mission.name.text}` {may} in the air, {_is(place)}",
                help="end it in a step that lands, as `return_home` does, and cannot be skipped; else the policy's "
                "contingency brings the vehicle down",
            )
            return


def _lacking(ground: Ground, invocation: PreparedInvocation, start: Place) -> Clause | None:
    """A clause that cannot hold at `start`, and can elsewhere."""
    if not invocation.require and not invocation.assume:
        return None
    at, _ = planned(ground, invocation, start)
    slots = list(at.slots)
    for signal in ground.prepared.policy.signals:
        if signal.kind == ENUMERATION and all((each.message, *each.fields) == LANDED for each in signal.sources):
            slots[signal.slot] = point(MAV_LANDED_STATE_IN_AIR if start.aloft else MAV_LANDED_STATE_ON_GROUND)
    there = at.over(slots, None, 0)
    for clause, condition in (*invocation.require, *invocation.assume):
        if not condition(there) & TRUE and condition(ground.around(invocation)) & TRUE:
            return clause
    return None


def _is(place: Place) -> str:
    height = f"{display(place.height, Dimension.ALTITUDE)} up" if place.aloft else "on the ground"
    return f"{height}, {from_home(place.x, place.y)}"
