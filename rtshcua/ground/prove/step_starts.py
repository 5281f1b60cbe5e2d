"""The places at which each step may begin, and the proof that it can begin there (E0619, E0621).

Before the first step the vehicle is at the declared home. A step ends at its planned place. If a step may be skipped,
the vehicle may also stay where it was, so the next step may begin at several places.

A motion determines the position, the height above home, and the landed state that the autopilot reports. If a clause of
`require` or `assume` cannot hold with these values, no earlier step established its condition. A vehicle on the ground
cannot fly, survey or hold: no autopilot starts these from the ground.
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
from rtshcua.model.flat.limits import FULL
from rtshcua.model.flat.mission import OnInadmissible
from rtshcua.model.flat.signal import ENUMERATION
from rtshcua.model.ir.missions import MissionDecl
from rtshcua.model.quantity import Dimension, display

#: most places that the proofs follow; the ways from further places are only checked on board
MOST_PLACES = 16


class StartPlace(NamedTuple):
    """Local x, y and height in mm, and whether the vehicle is in the air."""

    x: int
    y: int
    height: int
    aloft: bool


AT_HOME = StartPlace(0, 0, 0, aloft=False)


class MissionStart(NamedTuple):
    """Where a mission begins, the charge then, in 1/10000, and the slowest speed of earlier steps in mm/s (0: none),
    which an autopilot may keep on a return. A mission begins at home with a full charge, or in flight.
    """

    place: StartPlace = AT_HOME
    charge: int = FULL
    speed: int = 0


FROM_HOME = MissionStart()


def place_after(invocation: PreparedInvocation, start: StartPlace) -> StartPlace:
    """Return the place at which a completed step ends that began at `start`."""
    plan = invocation.invocation.plan
    x, y = plan.path[-2:] if plan.path else start[:2]
    match plan.kind:
        case MotionKind.HOME | MotionKind.LAND:
            return StartPlace(x, y, 0, aloft=False)
        case MotionKind.HOLD:
            return start
        case _:
            return StartPlace(x, y, plan.last_height, aloft=True)


def places_after(
    invocation: PreparedInvocation, starts: Sequence[StartPlace], able: Sequence[StartPlace]
) -> tuple[StartPlace, ...]:
    """Return the places where the vehicle may be after a step.

    `starts` are the places where it may be before the step, and `able` those at which the step may begin. The result is
    not limited to `MOST_PLACES`.
    """
    ends = [place_after(invocation, start) for start in able]
    if may_be_skipped(invocation):
        ends += starts
    return tuple(dict.fromkeys(ends))


def may_be_skipped(invocation: PreparedInvocation) -> bool:
    """Whether the mission continues if a step is not admitted."""
    return invocation.invocation.on_inadmissible == OnInadmissible.SKIP


def from_where(
    proof: ProofContext,
    invocation: PreparedInvocation,
    starts: Sequence[StartPlace],
    finds: Callable[[StartPlace], None],
) -> tuple[StartPlace, ...]:
    """Return the places of `starts` for which `finds`, a proof of a condition of admission, reports nothing.

    Returns none if a step that cannot be skipped fails anywhere. A step that may be skipped must only be admitted at
    one of the places; its findings are reported if it is admitted nowhere.
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
    """Return all states of a vehicle at `start`, and the planned volume of the step from there."""
    known = proof.prepared.tables.known
    at = proof.around(invocation)
    slots = list(at.slots)
    slots[known.x], slots[known.y], slots[known.height] = point(start.x), point(start.y), point(start.height)
    return at.over(slots, None, 0), invocation.planner.volume(slots, known)


def from_home(x: int, y: int) -> str:
    """Describe a place relative to home, to the nearest metre."""
    east, north = (x + 500) // 1000, (y + 500) // 1000
    parts = [f"{abs(east)} m {'east' if east > 0 else 'west'}"] if east else []
    parts += [f"{abs(north)} m {'north' if north > 0 else 'south'}"] if north else []
    return f"{' and '.join(parts)} of home" if parts else "at home"


#: the message and the field in which an autopilot reports whether it has landed
LANDED = ("EXTENDED_SYS_STATE", "landed_state")

_ALOFT = {MotionKind.FLY: "flies to a place", MotionKind.COVER: "flies a survey", MotionKind.HOLD: "holds in the air"}


def prove_aloft(
    proof: ProofContext, step: MissionStep, starts: Sequence[StartPlace], skipped: Sequence[MissionStep]
) -> tuple[StartPlace, ...]:
    """Return `starts`, or nothing after reporting a step that cannot begin on the ground.

    Admission on board does not check this, so a `skip` of the step does not help.
    """
    flat = step.flat
    for start in starts:
        if not start.aloft and flat.plan.kind in _ALOFT:
            motion = proof.skills[flat.contract.name].motion
            assert motion is not None
            need = f"`{flat.contract.name}` {_ALOFT[MotionKind(flat.plan.kind)]}"
            help = "add a step before it that climbs, such as `takeoff`"
            before = () if start is starts[0] else skipped
            _report_unchained(proof, step, start, need, (motion.span, "its motion"), before, help)
            return ()
    return tuple(starts)


def prove_start(
    proof: ProofContext, step: MissionStep, starts: Sequence[StartPlace], skipped: Sequence[MissionStep]
) -> tuple[StartPlace, ...]:
    """Return the places of `starts` at which a step's conditions can hold. Reports a condition that cannot.

    The first of `starts` is the place where it begins if none of the `skipped` steps was skipped.
    """

    def finds(start: StartPlace) -> None:
        clause = _lacking(proof, step.prepared, start)
        if clause is not None:
            need, label = f"it needs `{clause.text}`", (proof.span(clause), "the contract contains this condition")
            help, before = "add a step before it that establishes this", () if start is starts[0] else skipped
            _report_unchained(proof, step, start, need, label, before, help)

    return from_where(proof, step.prepared, starts, finds)


def _report_unchained(
    proof: ProofContext,
    step: MissionStep,
    start: StartPlace,
    need: str,
    label: tuple[Span, str],
    skipped: Sequence[MissionStep],
    help: str,
) -> None:
    proof.report.add(
        codes.NOT_CHAINED,
        step.span,
        f"{need}, but when this step begins the vehicle {'may be' if skipped else 'is'} {_place_text(start)}",
        help="let the step that may be skipped `abort` or `hold`" if skipped else help,
        labels=[label, *((each.span, "this step may be skipped") for each in skipped[-1:])],
    )


def warn_not_landed(proof: ProofContext, mission: MissionDecl, step: MissionStep, ends: Sequence[StartPlace]) -> None:
    """Warn of a mission that ends in the air, so that only the contingency lands the vehicle."""
    for place in ends:
        if place.aloft:
            may = "ends" if place is ends[0] else "may end, if steps are skipped,"
            proof.report.add(
                codes.NOT_LANDED,
                step.span,
                f"`{mission.name.text}` {may} in the air, {_place_text(place)}",
                help="end it with a step that lands, such as `return_home`, and that cannot be skipped; otherwise the "
                "policy's contingency lands the vehicle",
            )
            return


def _lacking(proof: ProofContext, invocation: PreparedInvocation, start: StartPlace) -> Clause | None:
    """Return a clause that cannot hold at `start` but can elsewhere, or None."""
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
