"""Signals that cannot arrive on a link, and the steps that wait for them."""

from msgspec.structs import replace

from reference.flat_case import BATTERY, GOOD_LINK, GOTO, HOVER, INSPECT, LINK, MISSION, POSITION_X, TAKEOFF
from reference.world import START, FakeVehicle, loaded
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy, RuleKind
from rtshcua.model.flat.signal import SignalSource
from rtshcua.model.flat.situation import State
from rtshcua.onboard.rehearsal import needed, rehearse, stranded, unheard
from virtual import case

POLICY = case.policy()
SILENT = frozenset({LINK})


def of(skill: int, policy: Policy = POLICY, mission: Mission = MISSION) -> bool:
    """Whether a step with a skill needs the link's quality."""
    (step, *_) = [each for each in mission.invocations if each.skill == skill]
    return LINK in needed(policy, step)


def test_a_signal_with_another_source_comes_all_the_same() -> None:
    assert unheard(POLICY, {"RADIO_STATUS"}) == SILENT
    assert unheard(POLICY, {"WIND"}) == frozenset()
    assert unheard(POLICY, {"GLOBAL_POSITION_INT"}) >= {POSITION_X, POSITION_X + 1}
    other = SignalSource("HEARTBEAT", ("type",), 1, 1, ())
    signals = tuple(replace(each, sources=(*each.sources, other)) for each in POLICY.signals)
    assert unheard(replace(POLICY, signals=signals), {"RADIO_STATUS"}) == frozenset()


def test_contract_needs_the_signals_it_reads() -> None:
    assert of(INSPECT)
    assert not of(TAKEOFF)


def test_signals_of_blocking_and_sole_permit_rules_are_needed() -> None:
    stops = [replace(POLICY.rules[-1], kind=kind, when=GOOD_LINK) for kind in (RuleKind.FORBID, RuleKind.DEGRADE)]
    for rule in stops:
        assert of(TAKEOFF, replace(POLICY, rules=(*POLICY.rules, rule)))
        assert not of(TAKEOFF, replace(POLICY, rules=(*POLICY.rules, replace(rule, skills=(HOVER,)))))
    permit = replace(POLICY.rules[0], kind=RuleKind.PERMIT, skills=(TAKEOFF,), when=GOOD_LINK)
    without = tuple(each for each in POLICY.rules if each.kind != RuleKind.PERMIT)
    assert of(TAKEOFF, replace(POLICY, rules=(*without, permit)))
    assert not of(TAKEOFF, replace(POLICY, rules=(*POLICY.rules, permit)))


def test_steps_that_need_a_silent_signal_are_stranded() -> None:
    mission = case.mission(case.short_steps())
    assert [each.skill for each in stranded(POLICY, mission, SILENT)] == [GOTO]
    assert stranded(POLICY, mission, frozenset()) == ()


def test_a_rehearsal_has_no_hope_for_stranded_steps() -> None:
    values = FakeVehicle().values | {LINK: None}
    state = State(tuple(values[slot] for slot in range(len(values))), (10_000,) * len(values))
    told = [[each.hopeful for each in rehearse(loaded(), state, START, slots)] for slots in (frozenset(), SILENT)]
    assert told[0] == [True] * 4
    assert not all(told[1])
    blind = State(tuple(None if slot == BATTERY else value for slot, value in enumerate(state.values)), state.ages)
    assert not rehearse(loaded(), blind, START, SILENT)[0].hopeful
