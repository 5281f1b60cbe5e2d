"""The coverage items of a policy, and the goals that a decision reaches."""

from msgspec.structs import replace

from reference import flat_case as flat
from rtshcua.decision.prepare import PreparedInvocation, PreparedPolicy, prepare, prepare_mission
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.testing.clause_coverage import coverage, enough, per_mille, reached_goals, share
from rtshcua.ground.testing.coverage_goals import CoverageItem, Goal, Universe, universe_of
from rtshcua.ground.why.trace import trace
from rtshcua.model.flat.contract import SourceKind
from rtshcua.model.flat.policy import Policy, RuleKind
from rtshcua.model.flat.signal import POSITION, SignalSource
from rtshcua.model.flat.situation import ConfirmAnswer, State

FIELDS = {POSITION: ("x", "y")}
REPORTED = tuple(
    replace(each, sources=(SignalSource("M", FIELDS.get(each.kind, ("f",)), 1, 1, ()),)) for each in flat.SIGNALS
)
POLICY = replace(flat.POLICY, signals=REPORTED)
TAKEOFF, GOTO, INSPECT, RETURN = range(4)  # the steps of the mission


def prepared(policy: Policy = POLICY) -> tuple[PreparedPolicy, tuple[PreparedInvocation, ...]]:
    ready = prepare(policy)
    assert not isinstance(ready, Refusal), ready
    invocations = prepare_mission(flat.MISSION, ready)
    assert not isinstance(invocations, Refusal), invocations
    return ready, invocations


PREPARED, STEPS = prepared()
UNIVERSE = universe_of(PREPARED)


def item(role: str, text: str, skill: str = "", of: Universe = UNIVERSE) -> CoverageItem:
    """The item of a role, a skill and a text."""
    (found,) = [each for each in of.items if (each.role, each.skill) == (role, skill) and each.text == text]
    return found


def seen(step: int, state: State, approvals: tuple[ConfirmAnswer, ...] = ()) -> dict[tuple[str, str, str], set[Goal]]:
    """The goals that the decision on a step reaches, by item."""
    invocation = STEPS[step]
    context = flat.context(invocation.invocation, approvals=approvals)
    found: dict[tuple[str, str, str], set[Goal]] = {}
    for number, goal in reached_goals(UNIVERSE, invocation, trace(invocation, state, PREPARED, context, flat.NOW)):
        each = UNIVERSE.items[number]
        found.setdefault((each.role, each.skill, each.text), set()).add(goal)
    return found


def test_every_rule_clause_and_outcome_is_an_item() -> None:
    roles = [each.role for each in UNIVERSE.items]
    permitted = ("takeoff", "hover", "goto", "inspect_area", "return_home", "emergency_land")
    assert roles.count("permit") == 4
    assert (roles.count("forbid"), roles.count("confirm"), roles.count("degrade"), roles.count("airspace")) == (1,) * 4
    assert [each.skill for each in UNIVERSE.items if each.role == "energy"] == list(permitted)
    for skill in permitted:
        contract = next(each for each in POLICY.contracts if each.name == skill)
        found = [each.text for each in UNIVERSE.items if each.skill == skill and each.role != "energy"]
        assert found == [each.text for each in (*contract.require, *contract.assume, *contract.maintain)]
    assert UNIVERSE.items[-1].goals == (Goal.ALLOW, Goal.DENY, Goal.DEFER, Goal.FALLBACK)


def test_skill_without_a_permit_has_no_items() -> None:
    assert not [each for each in UNIVERSE.items if each.skill == "track_target"]


def test_impossible_goals_are_excluded() -> None:
    reads_arguments = item("permit", "permit (0,)")
    assert reads_arguments.impossible == (Goal.UNKNOWN,)
    without_condition = item("forbid", "forbid (6,)")
    assert without_condition.goals == (Goal.TRUE, Goal.DECIDED)
    reads_a_signal = item("require", "battery > 35 %", "takeoff")
    assert reads_a_signal.goals == (Goal.TRUE, Goal.FALSE, Goal.UNKNOWN, Goal.DECIDED)
    lands = item("energy", "the charge to finish, to come home, and the reserve", "emergency_land")
    assert lands.impossible == (Goal.FALSE,)  # it needs nothing


def test_constant_clause_has_only_its_truth_as_goal() -> None:
    always = flat.clause("20 m <= 30 m", flat.apply(flat.Op.LE, flat.const(20), flat.const(30)))
    rules = (*flat.RULES, flat.rule(RuleKind.FORBID, flat.TAKEOFF, when=always))
    ready, _ = prepared(replace(POLICY, rules=rules))
    assert universe_of(ready).items[7].goals == (Goal.TRUE, Goal.DECIDED)


def test_time_of_day_can_be_unknown_by_a_clock_error() -> None:
    assert Goal.UNKNOWN in item("permit", "permit (3,)").goals


def test_allowed_step_reaches_its_checks_and_its_permit_decides() -> None:
    found = seen(TAKEOFF, flat.state())
    assert found["permit", "", "permit (0,)"] == {Goal.TRUE, Goal.DECIDED}
    assert found["require", "takeoff", "battery > 35 %"] == {Goal.TRUE}
    assert found["outcomes", "", "the outcomes of its decisions"] == {Goal.ALLOW}
    assert found["degrade", "", "degrade ()"] == {Goal.FALSE}
    assert not [key for key in found if key[1] not in ("", "takeoff")]


def test_no_permit_decides_if_two_permits_allow() -> None:
    again = flat.rule(RuleKind.PERMIT, flat.TAKEOFF, roles=(flat.OPERATOR,), sources=(SourceKind.AGENT,), start=90)
    ready, invocations = prepared(replace(POLICY, rules=(*flat.RULES, again)))
    of, step = universe_of(ready), invocations[TAKEOFF]
    found = reached_goals(of, step, trace(step, flat.state(), ready, flat.context(step.invocation), flat.NOW))
    assert {goal for number, goal in found if of.items[number].role == "permit"} == {Goal.TRUE}


def test_named_clause_decides_and_later_steps_are_not_reached() -> None:
    found = seen(TAKEOFF, flat.state({flat.BATTERY: 3_000}))
    assert found["require", "takeoff", "battery > 35 %"] == {Goal.FALSE, Goal.DECIDED}
    assert found["permit", "", "permit (0,)"] == {Goal.TRUE}
    assert not [key for key in found if key[0] in ("airspace", "energy", "degrade")]


def test_unknown_clause_that_defers_decides() -> None:
    found = seen(TAKEOFF, flat.state({flat.BATTERY: None}))
    assert found["require", "takeoff", "battery > 35 %"] == {Goal.UNKNOWN, Goal.DECIDED}


def test_charge_decides_without_being_named() -> None:
    found = seen(RETURN, flat.state({flat.BATTERY: 700}))
    assert {Goal.FALSE, Goal.DECIDED} <= found["energy", "return_home", item_text("return_home")]


def test_degrade_whose_target_flies_decides_although_a_clause_refused() -> None:
    found = seen(TAKEOFF, flat.state({flat.BATTERY: 2_000}))
    assert found["require", "takeoff", "battery > 35 %"] == {Goal.FALSE, Goal.DECIDED}
    assert found["degrade", "", "degrade ()"] == {Goal.TRUE, Goal.DECIDED}


def item_text(skill: str) -> str:
    return next(each.text for each in UNIVERSE.items if (each.role, each.skill) == ("energy", skill))


def test_share_is_rounded_down_and_full_only_for_full_coverage() -> None:
    assert (per_mille(999_999, 1_000_000), per_mille(7, 7), per_mille(0, 0)) == (999, 1000, 1000)
    assert share(2, 3) == "66.6 %"


def test_threshold_is_compared_without_rounding() -> None:
    found = coverage(UNIVERSE, [])
    assert (found.covered, enough([found], 0), enough([found], 1)) == (0, True, False)
    whole = frozenset((number, goal) for number, each in enumerate(UNIVERSE.items) for goal in each.goals)
    full = coverage(UNIVERSE, [whole, whole])
    assert (full.covered, full.decisions, enough([full], 100)) == (UNIVERSE.total, 2, True)
    assert enough([found, full], 50)
    assert not enough([found, full], 51)


def test_rule_that_never_decided_is_listed() -> None:
    invocation = STEPS[TAKEOFF]
    decided = trace(invocation, flat.state(), PREPARED, flat.context(invocation.invocation), flat.NOW)
    found = coverage(UNIVERSE, [reached_goals(UNIVERSE, invocation, decided)])
    assert "permit (0,)" not in {each.text for each in found.undecided}
    assert "forbid (6,)" in {each.text for each in found.undecided}
