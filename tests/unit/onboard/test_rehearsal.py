"""The rehearsal: the decision on each step, the state that it uses, and that it has no effect."""

from msgspec.structs import replace

from reference.documents import ASKED, approval, low, presented
from reference.flat_case import BATTERY, HEIGHT, LINK, MISSION, POSITION_X, POSITION_Y, WIND, M, S
from reference.world import START, FakeVehicle, Run, allowed, loaded
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.mission import Plan
from rtshcua.model.flat.policy import VehicleLimits
from rtshcua.model.flat.situation import State
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.onboard.ports import Ending
from rtshcua.onboard.rehearsal import flown, rehearse
from virtual.rows import rows

OF = loaded()


def state(**changed: int | None) -> State:
    """On the ground at home, all well, but for slots given as `s<number>`."""
    values = FakeVehicle().values | {int(name[1:]): value for name, value in changed.items()}
    return State(tuple(values[slot] for slot in range(len(values))), (10_000,) * len(values))


def told(of_state: State) -> list[tuple[str, str, bool]]:
    found = rehearse(OF, of_state, START)
    return [(each.decision.outcome.name.lower(), each.decision.reason.value, each.hopeful) for each in found]


def test_every_step_of_a_flyable_mission_is_admitted() -> None:
    assert told(state()) == [("allow", "admitted", True)] * 4


def test_a_refused_step_names_the_nearest_value_that_would_pass() -> None:
    found = rehearse(OF, state(**{f"s{BATTERY}": 3_000}), START)
    first = found[0]
    assert first.decision.outcome is Outcome.FALLBACK
    assert not first.hopeful
    assert [(one.subject, one.value) for one in first.nearest] == [("battery", 3_501)]


def test_unknown_signal_may_arrive_for_later_steps_only() -> None:
    calm = told(state(**{f"s{WIND}": None, f"s{LINK}": None}))
    assert calm[2] == ("defer", "state/unknown", True)
    blind = told(state(**{f"s{BATTERY}": None}))
    assert blind[0] == ("defer", "state/unknown", False)


def test_step_that_needs_approval_waits() -> None:
    of = low()
    (asked,) = [each for each in rehearse(of, state(), START) if each.step == ASKED]
    assert (asked.decision.reason, asked.hopeful) == (Reason.AWAITING_APPROVAL, True)


def test_a_denied_step_is_not_hopeful() -> None:
    early = replace(START, utc_us=MISSION.issued_at_us - 60 * S)
    assert {each.decision.reason for each in rehearse(OF, state(), early)} == {Reason.ISSUED_IN_FUTURE}
    assert not any(each.hopeful for each in rehearse(OF, state(), early))


def test_rehearsal_consumes_no_invocation() -> None:
    of = loaded()
    rehearse(of, state(), START)
    assert allowed(of)
    of = low()
    rehearse(of, state(), START)
    assert presented(of, approval(of)).accepted
    run = Run(loaded())
    rehearse(run.loaded, state(), START)
    assert run.until_over().ending is Ending.COMPLETED


@rows(
    ("plan", "x", "y", "height"),
    [
        (Plan(MotionKind.HOLD, (), 0, 0), 1, 2, 3),
        (Plan(MotionKind.CLIMB, (), 9 * M, 0), 1, 2, 9 * M),
        (Plan(MotionKind.FLY, (5, 6), 7, 0), 5, 6, 7),
        (Plan(MotionKind.COVER, (1, 1, 5, 6), 7, 0), 5, 6, 7),
        (Plan(MotionKind.HOME, (0, 0), 0, 0), 0, 0, 0),
        (Plan(MotionKind.LAND, (), 0, 0), 1, 2, 0),
    ],
)
def test_rehearsed_step_starts_where_the_previous_one_ends(plan: Plan, x: int, y: int, height: int) -> None:
    before = state(**{f"s{POSITION_X}": 1, f"s{POSITION_Y}": 2, f"s{HEIGHT}": 3})
    after = flown(before, plan, OF.bundle.policy.vehicle)
    assert [after.values[slot] for slot in (POSITION_X, POSITION_Y, HEIGHT)] == [x, y, height]
    assert after.values[BATTERY] == before.values[BATTERY]
    assert after.ages[BATTERY] == before.ages[BATTERY]


def test_unreported_stays_unknown_and_undeclared_unchanged() -> None:
    vehicle = OF.bundle.policy.vehicle
    unknown = state(**{f"s{POSITION_X}": None, f"s{HEIGHT}": None})
    after = flown(unknown, Plan(MotionKind.FLY, (5, 6), 7, 0), vehicle)
    assert (after.values[POSITION_X], after.values[HEIGHT]) == (None, None)
    without = VehicleLimits(**{name: getattr(vehicle, name) for name in vehicle.__struct_fields__} | {"position": -1})
    moved = flown(state(), Plan(MotionKind.FLY, (5, 6), 7, 0), without)
    assert (moved.values[POSITION_X], moved.values[HEIGHT]) == (0, 7)
