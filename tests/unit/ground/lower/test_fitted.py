"""Sensors that a vehicle lacks: omitted clauses, refused conditions, and the record in the policy."""

from pathlib import Path

import pytest

from rtshcua.decision.decide import decide
from rtshcua.decision.fallbacks import link_admissible
from rtshcua.decision.prepare import PreparedPolicy, prepare, prepare_mission
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import Compiled, compile_program
from rtshcua.mavlink import dialect
from rtshcua.model.flat.situation import Context, Now, State
from rtshcua.model.outcome import Outcome
from rtshcua.wire.binding import bind
from virtual.rows import rows

CHECKOUT = Path(__file__).resolve().parents[4]
AT = 1_700_000_000_000_000
SKILLS = ("takeoff", "hover", "goto", "return_home", "emergency_land")
TEXT = (
    "".join(f'import "lib:skills/{name}.rts"\n' for name in ("signals", *SKILLS))
    + """
vehicle quad {{
  identity "quad-07"  home 47.39774 N, 8.54559 E within 50 m  speed at most 12 m/s  climb at most 3 m/s
  position error 3 m  energy 100 % = 18 min hover  reserve 15 %  {without}
}}
skill watch() {{
  motion hold  class tactical  deadline 5 s  valid for 40 min  lasts at most 20 s  grace 1 s
  require battery > 40 %  {clause}
  fallback hover for 10 s, return_home, emergency_land  energy at most 4 %
}}
role trainee, pilot, chief
policy rules version 1 {{
  permit takeoff, goto, watch by role operator
  permit hover, return_home, emergency_land by any
  {rule}
  contingency hover for 10 s, return_home, emergency_land
}}
mission m under rules@1 on quad {{
  proposed by operator x for role operator
  phase departure {{ takeoff(altitude = 10 m)  watch() {block} }}
  phase inspection {{ goto(47.39800 N, 8.54559 E, altitude = 10 m) }}
  phase recovery {{ return_home() }}
}}
"""
)
NO_EYES = "without obstacle.distance"


def compiled(without: str = "", clause: str = "", rule: str = "", block: str = "") -> Compiled:
    text = TEXT.format(without=without, clause=clause, rule=rule, block=block)

    def read(name: str) -> bytes:
        return text.encode() if name == "x.rts" else Path(name).read_bytes()

    program = load(["x.rts"], read, str(CHECKOUT))
    return compile_program(program, dialect.load(), mission=None, issued_at_us=AT)


def codes(made: Compiled) -> list[str]:
    return [found.code.id for found in made.diagnostics]


def test_clause_for_a_missing_sensor_is_omitted_and_recorded() -> None:
    made = compiled(NO_EYES, "assume wind.speed < 9 m/s  assume height < 90 m and obstacle.distance > 4 m where fitted")
    assert made.policy is not None, made.diagnostics
    assert made.policy.vehicle.without == ("obstacle.distance",)
    assert "obstacle.distance" not in {signal.name for signal in made.policy.signals}
    watch = next(each for each in made.policy.contracts if each.name == "watch")
    assert [clause.text for clause in watch.assume] == ["wind.speed < 9 m/s", "height < 90 m"]
    left = {(made.policy.contracts[each.skill].name, each.part, each.text) for each in made.policy.left_out}
    assert ("watch", "assume", "obstacle.distance > 4 m") in left
    assert {name for name, _, _ in left} == {"watch", "goto", "return_home"}
    assert made.mission is not None
    assert all(watch == step.contract for step in made.mission.invocations if step.contract.name == "watch")


RULES = {
    "degrade": "degrade goto, watch when obstacle.distance < 2 m to return_home where fitted",
    "forbid": "forbid goto by role operator when obstacle.distance < 2 m where fitted",
    "confirm": "confirm goto when obstacle.distance < 2 m by role operator within 5 s where fitted",
}


@pytest.mark.parametrize("kind", RULES)
def test_rule_for_a_missing_sensor_is_omitted_and_recorded(kind: str) -> None:
    without, with_it = compiled(NO_EYES, rule=RULES[kind]), compiled(rule=RULES[kind])
    assert without.policy is not None, without.diagnostics
    assert with_it.policy is not None, with_it.diagnostics
    (left_out,) = (each for each in without.policy.left_out if each.skill == -1)
    assert (left_out.part, left_out.text) == (kind, RULES[kind])
    assert len(with_it.policy.rules) == len(without.policy.rules) + 1
    assert not any(each.skill == -1 for each in with_it.policy.left_out)
    assert not isinstance(prepare(without.policy), Refusal)


def test_fitted_argument_is_refused_for_a_permit() -> None:
    """Without the rule the policy would permit less, and without its condition more than it states."""
    made = compiled(NO_EYES, rule="permit goto by role trainee when obstacle.distance > 2 m where fitted")
    assert codes(made) == ["E0101"]
    (found,) = compiled(NO_EYES, rule="permit goto by role trainee when obstacle.distance > 2 m").diagnostics
    assert found.help is not None
    assert found.help.startswith("remove the signal from the rule")


def test_clause_applies_if_the_sensor_is_fitted() -> None:
    policy = compiled(clause="assume obstacle.distance > 4 m where fitted").policy
    assert policy is not None
    watch = next(each for each in policy.contracts if each.name == "watch")
    assert [clause.text for clause in watch.assume] == ["obstacle.distance > 4 m"]
    assert policy.left_out == ()


def test_clauses_on_several_lines_keep_their_order() -> None:
    policy = compiled(clause="require gps.fix >= fix_3d  maintain height < 50 m  require height < 40 m").policy
    assert policy is not None
    watch = next(each for each in policy.contracts if each.name == "watch")
    assert [clause.text for clause in watch.require] == ["battery > 40 %", "gps.fix >= fix_3d", "height < 40 m"]


@rows(
    "parts",
    [
        {"clause": "assume obstacle.distance > 4 m"},
        {"clause": "assume obstacle.distance > 4 m for the last 3 s"},
        {"clause": "maintain height < 90 m and obstacle.distance > 4 m"},
        {"rule": "forbid goto by any when obstacle.distance < 4 m"},
        {"rule": "permit goto by role pilot when obstacle.distance > 4 m"},
        {"rule": "degrade any when obstacle.distance < 4 m to return_home"},
        {"rule": "confirm goto when obstacle.distance < 4 m by role chief within 30 s"},
        {"rule": "delegate goto by role operator to role trainee through operator when obstacle.distance > 4 m"},
        {"block": "{ require obstacle.distance > 4 m }"},
    ],
)
def test_condition_on_a_missing_sensor_is_refused(parts: dict[str, str]) -> None:
    made = compiled(NO_EYES, **parts)
    assert codes(made) == ["E0413"]
    (found,) = made.diagnostics
    assert "`obstacle.distance`" in found.message
    assert "`quad`" in found.message
    assert found.help is not None
    assert "E0413" not in codes(compiled(**parts))


@rows(
    ("without", "code"),
    [
        ("without obstacle.distanse", "E0201"),
        ("without quad", "E0204"),
        ("without position", "E0414"),
        ("without link.quality, battery", "E0414"),
        ("brakes from 12 m/s in 6 s after 500 ms  without velocity.east", "E0414"),
        ("without link.quality, link.quality", "E0106"),
        ("without link.quality  without obstacle.distance", "E0106"),
    ],
)
def test_required_signal_cannot_be_declared_missing(without: str, code: str) -> None:
    assert codes(compiled(without)) == [code]


def test_misspelt_signal_gets_a_suggestion() -> None:
    (found,) = compiled("without obstacle.distanse").diagnostics
    assert "obstacle.distance" in str(found.help)


def test_unread_velocity_may_be_missing() -> None:
    assert codes(compiled("without velocity.down")) == []


def test_fitted_argument_is_refused_in_a_step() -> None:
    assert codes(compiled(block="{ require height < 90 m where fitted }")) == ["E0101"]


def test_shipped_skills_compile_for_a_stock_copter() -> None:
    """GPS, barometer and battery, and wind, which the shipped skills read."""
    made = compiled("without obstacle.distance, link.quality")
    assert made.policy is not None, made.diagnostics
    assert made.mission is not None
    policy = prepare(made.policy)
    assert isinstance(policy, PreparedPolicy), policy
    (goto,) = (each for each in prepare_mission(bind(made.mission, bytes(32)), policy) if each.invocation.step == 2)
    invocation = goto.invocation
    context = Context(invocation.binding, "quad-07", 1, 0, 0, invocation.phase, 1_000, ())
    known = {"position": 0, "height": 10_000, "battery": 9_000, "gps.fix": 3, "wind.speed": 1_000, "landed": 2}
    decision = decide(goto, _state(made, known), policy, context, Now(0, AT + 1, 0))
    assert decision.outcome is Outcome.ALLOW, decision


@pytest.mark.parametrize(
    ("missing", "holds"), [((), True), (("gps.fix",), True), (("position",), False), (("height",), False)]
)
def test_hold_as_a_link_needs_the_position_but_no_fix(missing: tuple[str, ...], holds: bool) -> None:
    made = compiled()
    assert made.policy is not None
    policy = prepare(made.policy)
    assert isinstance(policy, PreparedPolicy), policy
    known = {"position": 0, "height": 10_000, "battery": 9_000, "gps.fix": 3}
    state = _state(made, {name: value for name, value in known.items() if name not in missing})
    hover, home, land = policy.contingency
    assert link_admissible(hover, state, policy, Now(0, AT, 0)) == holds
    assert link_admissible(home, state, policy, Now(0, AT, 0)) == ("gps.fix" not in missing)
    assert link_admissible(land, state, policy, Now(0, AT, 0))


def _state(made: Compiled, known: dict[str, int]) -> State:
    assert made.policy is not None
    values: list[int | None] = [None] * made.policy.slots
    for signal in made.policy.signals:
        values[signal.slot] = known.get(signal.name)
        if signal.name == "position":
            values[signal.slot + 1] = known.get(signal.name)
    return State(tuple(values), (0,) * made.policy.slots)
