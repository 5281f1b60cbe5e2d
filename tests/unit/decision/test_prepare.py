"""Malformed policies and missions are refused with a reason; no bundle makes deciding fail."""

from random import Random
from typing import Any

import msgspec
import pytest
from hypothesis import given, settings
from msgspec.structs import replace

from reference import flat_case as flat
from reference import worlds
from reference.asking import POLICY, STEP
from reference.flat_case import GOTO, HOVER, INSPECT, M
from rtshcua.decision.decide import decide
from rtshcua.decision.fallbacks import choose_contingency, choose_fallback
from rtshcua.decision.prepare import PreparedInvocation, PreparedPolicy, prepare, prepare_invocation, prepare_mission
from rtshcua.decision.running_conditions import watch
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.contract import CHOICE, PLACE, QUANTITY, ZONE, Motion, MotionKind, Parameter
from rtshcua.model.flat.limits import MAX_RULES, MAX_SILENCE, MAX_SLOTS, MAX_STALE, MAX_TEXT, MAX_ZONES
from rtshcua.model.flat.mission import Invocation, Mission
from rtshcua.model.flat.policy import Airspace, LeftOut, Policy, RuleKind
from rtshcua.model.flat.zone import CIRCLE, MAX_COORDINATE, MAX_VERTICES, POLYGON, Zone
from virtual.rows import rows

P = flat.POLICY


def vehicle(**fields: Any) -> Policy:
    return replace(P, vehicle=replace(P.vehicle, **fields))


def signal(number: int, **fields: Any) -> Policy:
    changed = tuple(replace(s, **fields) if n == number else s for n, s in enumerate(P.signals))
    return replace(P, signals=changed)


def source(**fields: Any) -> Policy:
    return signal(0, sources=(replace(P.signals[0].sources[0], **fields),))


def zone(**fields: Any) -> Policy:
    return replace(P, zones=(replace(P.zones[0], **fields), *P.zones[1:]))


def contract(skill: int, **fields: Any) -> Policy:
    changed = tuple(replace(c, **fields) if n == skill else c for n, c in enumerate(P.contracts))
    return replace(P, contracts=changed)


def parameter(number: int, **fields: Any) -> Policy:
    parameters = P.contracts[INSPECT].parameters
    changed = tuple(replace(p, **fields) if n == number else p for n, p in enumerate(parameters))
    return contract(INSPECT, parameters=changed)


def rule(**fields: Any) -> Policy:
    return replace(P, rules=(replace(P.rules[0], **fields), *P.rules[1:]))


def lacking(*without: str, **fields: Any) -> Policy:
    return replace(P, vehicle=replace(P.vehicle, without=without), **fields)


BAD = flat.clause("bad", (0, 0, 0))
DEEP = "instruction 0: unknown instruction 0"

POLICIES: list[tuple[Policy, str]] = [
    (replace(P, slots=MAX_SLOTS + 1), f"number of slots {MAX_SLOTS + 1} is not in 0..{MAX_SLOTS}"),
    (replace(P, slots=9), "a slot has no signal"),
    (replace(P, slots=7), "signal `obstacle.distance`: slot 7 does not exist or is owned twice"),
    (signal(1, slot=0), "signal `height`: slot 0 does not exist or is owned twice"),
    (signal(0, slot=-1), "signal `battery`: slot -1 does not exist or is owned twice"),
    (signal(6, kind=2), "signal `obstacle.distance`: slot 8 does not exist or is owned twice"),
    (signal(0, kind=3), "signal `battery`: kind 3 is not in 0..2"),
    (signal(0, stale_us=0), f"signal `battery`: staleness 0 is not in 1..{MAX_STALE}"),
    (source(denominator=0), "signal `battery`: denominator 0 is not in 1.."),
    (source(numerator=1 << 53), "signal `battery`: numerator 9007199254740992 is not in"),
    (source(fields=()), "signal `battery`: number of fields 0 is not in 1..2"),
    (source(fields=("x",) * 3), "signal `battery`: number of fields 3 is not in 1..2"),
    (signal(4, sources=P.signals[0].sources * 2, kind=2), "signal `gps.fix`: number of fields 1 is not in 2..2"),
    (vehicle(home_within=-1), f"vehicle: home distance -1 is not in 0..{MAX_COORDINATE}"),
    (vehicle(speed=0), f"vehicle: speed 0 is not in 1..{1 << 20}"),
    (vehicle(climb=0), f"vehicle: climb 0 is not in 1..{1 << 20}"),
    (vehicle(position_error=-1), f"vehicle: position error -1 is not in 0..{1 << 20}"),
    (vehicle(endurance_us=0), f"vehicle: endurance 0 is not in 1..{1 << 42}"),
    (vehicle(reserve=10_001), "vehicle: reserve 10001 is not in 0..10000"),
    (vehicle(utc_offset_us=1 << 40), f"vehicle: offset from UTC {1 << 40} is not in -86400000000..86400000000"),
    (vehicle(position=flat.HEIGHT), "vehicle: slot 1 is not a position"),
    (vehicle(position=flat.POSITION_Y), "vehicle: slot 6 is not a position"),
    (vehicle(height=flat.FIX), "vehicle: slot 4 is not a height"),
    (vehicle(height=-2), "vehicle: slot -2 is not a height"),
    (vehicle(battery=99), "vehicle: slot 99 is not a battery"),
    (replace(P, projection=replace(P.projection, latitude=1 << 30)), "projection: latitude 1073741824 is not in"),
    (replace(P, projection=replace(P.projection, longitude=1 << 31)), "projection: longitude 2147483648 is not in"),
    (replace(P, projection=replace(P.projection, east=0)), "projection: east 0 is not in 1.."),
    (replace(P, projection=replace(P.projection, north=1 << 40)), "projection: north 1099511627776 is not in 1.."),
    (replace(P, zones=P.zones[:1] * (MAX_ZONES + 1)), f"number of zones {MAX_ZONES + 1} is not in 0..{MAX_ZONES}"),
    (replace(P, declared=7), "number of declared zones 7 is not in 0..6"),
    (zone(data=(0, 0) * (MAX_VERTICES + 1)), f"zone 0: number of vertices {MAX_VERTICES + 1} is not in 3..4096"),
    (replace(P, zones=(replace(P.zones[0], data=(0, 0) * 4096),) * 17), "number of vertices 69632 is not in 0..65536"),
    (zone(data=(0, 0, 1, 1)), "zone 0: number of vertices 2 is not in 3..4096"),
    (zone(data=(0, 0, 1, 1, 2, 0, 3)), "zone 0: a coordinate is missing"),
    (zone(data=(0, 0, 1, 1, 2, MAX_COORDINATE + 1)), f"zone 0: coordinate {MAX_COORDINATE + 1} is not in"),
    (zone(floor=1 << 31), "zone 0: floor 2147483648 is not in"),
    (zone(floor=10, ceiling=9), "zone 0: ceiling 9 is not in 10.."),
    (zone(shape=3), "zone 0: unknown shape 3"),
    (zone(shape=CIRCLE), "zone 0: a circle has a centre and a squared radius"),
    (zone(shape=CIRCLE, data=(0, 0, 0)), "zone 0: squared radius 0 is not in 1.."),
    (zone(shape=CIRCLE, data=(1 << 40, 0, 1)), f"zone 0: coordinate {1 << 40} is not in"),
    (replace(P, tables=((0,) * 3,) * 257), "number of tables 257 is not in 0..256"),
    (replace(P, tables=((0, 0),)), "table 0: 2 entries for 3 declared zones"),
    (replace(P, tables=((0, 0, 6),)), "table 0: there is no zone 6"),
    (replace(P, roles=("r",) * 65), "number of roles 65 is not in 0..64"),
    (replace(P, sets=((1,),) * 4097), "number of sets 4097 is not in 0..4096"),
    (replace(P, sets=((1,) * 4097, (2,))), "set 0: number of members 4097 is not in 0..4096"),
    (replace(P, contracts=P.contracts[1:2] * 257), "number of contracts 257 is not in 0..256"),
    (parameter(1, cell=2), "skill `inspect_area`: parameter `altitude`: cell 2 is out of sequence; expected 1"),
    (parameter(1, kind=4), "skill `inspect_area`: parameter `altitude`: kind 4 is not in 0..3"),
    (parameter(1, low=-(1 << 53)), "skill `inspect_area`: parameter `altitude`: low bound"),
    (parameter(1, low=5, high=4), "skill `inspect_area`: parameter `altitude`: high bound 4 is not in 5.."),
    (parameter(2, high=3), "skill `inspect_area`: parameter `pattern`: there is no label 3"),
    (parameter(2, low=-1), "skill `inspect_area`: parameter `pattern`: there is no label -1"),
    (parameter(0, high=3), "skill `inspect_area`: parameter `area`: there is no declared zone 3"),
    (parameter(0, low=-1), "skill `inspect_area`: parameter `area`: there is no declared zone -1"),
    (
        contract(HOVER, parameters=tuple(Parameter("p", PLACE, "", 2 * n, 0, 0, ()) for n in range(33))),
        "skill `hover`: number of parameters 33 is not in 0..32",
    ),
    (contract(HOVER, motion=Motion(6, -1, -1)), "skill `hover`: motion 6 is not in 0..5"),
    (contract(INSPECT, motion=Motion(3, 0, 3)), "skill `inspect_area`: motion: argument cell 0 is not a altitude"),
    (contract(INSPECT, motion=Motion(3, 1, 9)), "skill `inspect_area`: motion: argument cell 9 is not a speed"),
    (
        contract(INSPECT, motion=Motion(3, 1, 3, lowest=0)),
        "skill `inspect_area`: motion: argument cell 0 is not a lowest height",
    ),
    (contract(INSPECT, motion=Motion(3, 1, 3, facing=2)), "skill `inspect_area`: facing 2 is not in 0..1"),
    (
        contract(GOTO, motion=Motion(2, 2, -1, lowest=2)),
        "skill `goto`: motion: only a skill that covers a zone has several heights or faces inward",
    ),
    (
        contract(GOTO, motion=Motion(2, 2, -1, facing=1)),
        "skill `goto`: motion: only a skill that covers a zone has several heights or faces inward",
    ),
    (
        contract(INSPECT, motion=Motion(3, -1, 3)),
        "skill `inspect_area`: motion: a skill that moves the vehicle needs an altitude",
    ),
    (
        contract(INSPECT, motion=Motion(2, 1, 3)),
        "skill `inspect_area`: motion: a skill that flies to a place needs a place argument",
    ),
    (
        contract(GOTO, motion=Motion(3, 2, -1)),
        "skill `goto`: motion: a skill that covers a zone needs exactly one",
    ),
    (contract(HOVER, timing_class=3), "skill `hover`: timing class 3 is not in 0..2"),
    (contract(HOVER, deadline_us=-1), "skill `hover`: deadline -1 is not in 0.."),
    (contract(HOVER, validity_us=-1), "skill `hover`: validity -1 is not in 0.."),
    (contract(HOVER, duration_us=-1), "skill `hover`: duration -1 is not in 0.."),
    (contract(HOVER, grace_us=1 << 43), "skill `hover`: grace 8796093022208 is not in 0.."),
    (contract(HOVER, energy=10_001), "skill `hover`: energy 10001 is not in 0..10000"),
    (contract(HOVER, require=(BAD,) * 65), "skill `hover`: number of require clauses 65 is not in 0..64"),
    (contract(HOVER, require=(BAD,)), f"skill `hover`: require 0: {DEEP}"),
    (contract(HOVER, assume=(BAD,)), f"skill `hover`: assume 0: {DEEP}"),
    (contract(HOVER, maintain=(BAD,)), f"skill `hover`: maintain 0: {DEEP}"),
    (contract(HOVER, reads=()), "skill `hover`: `reads` differs from what the clauses read"),
    (contract(HOVER, fallback=(flat.link(7),)), "skill `hover`: fallback: link 0: there is no skill 7"),
    (contract(HOVER, fallback=(flat.link(-1),)), "skill `hover`: fallback: link 0: there is no skill -1"),
    (contract(HOVER, fallback=(flat.link(HOVER),) * 9), "skill `hover`: fallback: number of links 9 is not in 0..8"),
    (
        contract(HOVER, fallback=(flat.link(HOVER, limit_us=-1),)),
        "skill `hover`: fallback: link 0: limit -1 is not in 0..",
    ),
    (
        replace(P, contingency=(flat.link(INSPECT, 1, 20 * M, 0, 4 * M),)),
        "contingency: link 0: a link cannot call a skill that covers a zone, because links carry no path",
    ),
    (replace(P, contingency=(flat.link(GOTO, 0, 0),)), "contingency: link 0: 2 argument cells; the contract has 3"),
    (
        replace(P, contingency=(flat.link(GOTO, 0, 0, 4 * M),)),
        "contingency: link 0: argument `altitude` is out of range",
    ),
    (
        replace(P, contingency=(flat.link(GOTO, 0, MAX_COORDINATE + 1, 9 * M),)),
        "contingency: link 0: argument `to` is out of range",
    ),
    (replace(P, rules=P.rules[3:4] * (MAX_RULES + 1)), f"number of rules {MAX_RULES + 1} is not in 0..{MAX_RULES}"),
    (rule(kind=4), "rule 0: kind 4 is not in 0..3"),
    (rule(skills=(3, 3)), "rule 0: skill indexes are not ascending"),
    (rule(skills=(3, 7)), "rule 0: there is no skill 7"),
    (rule(roles=(2,)), "rule 0: there is no role 2"),
    (rule(roles=(-1,)), "rule 0: role indexes are not ascending"),
    (rule(sources=(4,)), "rule 0: there is no source 4"),
    (rule(when=BAD), f"rule 0: when: {DEEP}"),
    (rule(skills=()), "rule 0: when: instruction 0: an argument is named outside of a skill"),
    (rule(kind=RuleKind.CONFIRM), "rule 0: there is no role -1"),
    (rule(kind=RuleKind.CONFIRM, approver=0), "rule 0: within 0 is not in 1.."),
    (
        rule(kind=RuleKind.CONFIRM, approver=0, second=2, within_us=1),
        "rule 0: role of the second person 2 is not in -1..1",
    ),
    (rule(second=0), "rule 0: only a `confirm` rule can require a second person"),
    (rule(kind=RuleKind.DEGRADE), "rule 0: a `degrade` rule needs a target"),
    (rule(kind=RuleKind.DEGRADE, target=flat.link(9)), "rule 0: target: there is no skill 9"),
    (replace(P, airspace=Airspace((6,), (), "", 0, 0, 1)), "airspace: there is no zone 6"),
    (replace(P, airspace=Airspace((), (-1,), "", 0, 0, 1)), "airspace: there is no zone -1"),
    (contract(HOVER, record=("written", "synced")), "skill `hover`: recorded as both `written` and `synced`"),
    (contract(HOVER, record=("buffered",)), "skill `hover`: `record buffered` is only allowed for reflex skills"),
    (replace(P, without_evidence=2), "without evidence 2 is not in 0..1"),
    (replace(P, without_evidence=-1), "without evidence -1 is not in 0..1"),
    (lacking("b", "a"), "vehicle: the signals in `without` are not ascending"),
    (lacking("a", "a"), "vehicle: the signals in `without` are not ascending"),
    (lacking(P.signals[0].name), f"vehicle: the policy reads `{P.signals[0].name}`, which the vehicle is without"),
    (
        replace(P, left_out=(LeftOut(0, "assume", "x", 0, 0, 1),)),
        "vehicle: `x` is left out, but the vehicle is without no signal",
    ),
    (lacking("a", left_out=(LeftOut(99, "assume", "x", 0, 0, 1),)), "vehicle: there is no skill 99"),
    (
        lacking("a", left_out=(LeftOut(0, "permit", "x", 0, 0, 1),)),
        "vehicle: `x` is left out of `permit`, which is not",
    ),
    (
        lacking("a", left_out=(LeftOut(0, "degrade", "x", 0, 0, 1),)),
        "vehicle: `x` is left out of `degrade`, which is not",
    ),
    (replace(P, silence_us=0), f"silence 0 is not in 1..{MAX_SILENCE}"),
    (replace(P, silence_us=-1), f"silence -1 is not in 1..{MAX_SILENCE}"),
    (replace(P, silence_us=MAX_SILENCE + 1), f"silence {MAX_SILENCE + 1} is not in 1..{MAX_SILENCE}"),
    (replace(P, after_silence=2), "after silence 2 is not in 0..1"),
    (replace(P, after_silence=-1), "after silence -1 is not in 0..1"),
]


@rows(("policy", "what"), POLICIES, ids=[what for _, what in POLICIES])
def test_a_malformed_policy(policy: Policy, what: str) -> None:
    found = prepare(policy)
    assert isinstance(found, Refusal)
    assert found.text.startswith(what)


@pytest.mark.parametrize("part", ["require", "assume", "maintain"])
def test_a_clause_left_out_of_a_part_of_a_contract_is_accepted(part: str) -> None:
    left_out = tuple(LeftOut(skill, part, "x", 0, 0, 1) for skill in range(2))
    assert not isinstance(prepare(lacking("a", left_out=left_out)), Refusal)


@pytest.mark.parametrize("part", ["forbid", "confirm", "degrade"])
def test_a_rule_left_out_is_accepted(part: str) -> None:
    assert not isinstance(prepare(lacking("a", left_out=(LeftOut(-1, part, "x", 0, 0, 1),))), Refusal)


def test_more_combinations_of_skills_and_roles_than_fit() -> None:
    wide = replace(P.rules[3], skills=tuple(range(250)), roles=tuple(range(64)))
    policy = replace(P, contracts=P.contracts[1:2] * 250, roles=("r",) * 64, rules=(wide,) * 17)
    policy = replace(policy, contracts=tuple(replace(c, fallback=()) for c in policy.contracts), contingency=())
    what = "number of skills times roles in the rules 272000 is not in 0..262144"
    assert prepare(policy) == Refusal("malformed", what)


S = STEP


def step(**fields: Any) -> Invocation:
    return replace(S, **fields)


def plan(**fields: Any) -> Invocation:
    return replace(S, plan=replace(S.plan, **fields))


def mine(**fields: Any) -> Invocation:
    return replace(S, contract=replace(S.contract, **fields))


INVOCATIONS: list[tuple[Invocation, str]] = [
    (step(skill=7), "there is no skill 7"),
    (step(role=2), "there is no role 2"),
    (step(source=4), "source 4 is not in 0..3"),
    (step(on_inadmissible=4), "on inadmissible 4 is not in 0..3"),
    (step(issued_at_us=-1), "issued at -1 is not in 0.."),
    (step(phases=1 << 64), "phases 18446744073709551616 is not in 0.."),
    (step(arguments=S.arguments[:3]), "3 argument cells; the contract has 4"),
    (step(arguments=(1, 20 * M, 0, 1 << 53)), "argument 9007199254740992 is not in"),
    (mine(name="other"), "`name` is looser than in the policy"),
    (mine(motion=Motion(3, 1, -1)), "`motion` is looser than in the policy"),
    (mine(motion=Motion(3, 1, 3, lowest=1)), "`motion` is looser than in the policy"),
    (mine(motion=Motion(3, 1, 3, facing=1)), "`motion` is looser than in the policy"),
    (mine(timing_class=0), "`timing class` is looser than in the policy"),
    (mine(fallback=S.contract.fallback[:2]), "`fallback` is looser than in the policy"),
    (
        mine(fallback=(replace(S.contract.fallback[0], text="hover"), *S.contract.fallback[1:])),
        "`fallback` is looser than in the policy",
    ),
    (
        mine(maintain=(replace(S.contract.maintain[0], text="all is well"), *S.contract.maintain[1:])),
        "`maintain` is looser than in the policy",
    ),
    (mine(parameters=S.contract.parameters[:3]), "`parameters` is looser than in the policy"),
    (
        mine(parameters=(*S.contract.parameters[:3], replace(S.contract.parameters[3], high=9 * M))),
        "`parameters` is looser than in the policy",
    ),
    (
        mine(parameters=(*S.contract.parameters[:3], replace(S.contract.parameters[3], low=1))),
        "`parameters` is looser than in the policy",
    ),
    (
        mine(parameters=(*S.contract.parameters[:3], replace(S.contract.parameters[3], name="x"))),
        "`parameters` is looser than in the policy",
    ),
    (mine(phases=("departure",)), "`phases` is looser than in the policy"),
    (mine(phases=()), "`phases` is looser than in the policy"),
    (mine(deadline_us=S.contract.deadline_us + 1), "`deadline` is looser than in the policy"),
    (mine(validity_us=S.contract.validity_us + 1), "`validity` is looser than in the policy"),
    (mine(duration_us=S.contract.duration_us + 1), "`duration` is looser than in the policy"),
    (mine(duration_us=0), "`duration` is looser than in the policy"),  # which would be no limit
    (mine(grace_us=S.contract.grace_us + 1), "`grace` is looser than in the policy"),
    (mine(energy=S.contract.energy - 1), "`energy` is looser than in the policy"),
    (mine(require=S.contract.require[:1]), "`require` is looser than in the policy"),
    (mine(assume=()), "`assume` is looser than in the policy"),
    (mine(maintain=S.contract.maintain[1:]), "`maintain` is looser than in the policy"),
    (mine(maintain=(BAD, *S.contract.maintain[1:])), "`maintain` is looser than in the policy"),
    (mine(record=()), "`record` is looser than in the policy"),
    (mine(record=(*S.contract.record, "written")), "`durability` is looser than in the policy"),
    (mine(record=(*S.contract.record, "written", "synced")), "recorded as both `written` and `synced`"),
    (mine(assume=(*S.contract.assume, BAD)), f"assume 3: {DEEP}"),
    (
        # a clause of the mission's own is stricter, and may not be taken for one of the policy's
        mine(assume=(*S.contract.assume, replace(S.contract.assume[1], text=S.contract.assume[0].text))),
        f"clause `{S.contract.assume[0].text}` has the text of a policy clause but different code",
    ),
    (plan(kind=2), "plan: kind 2 differs from the skill's, 3"),
    (plan(speed=3 * M), "plan: speed 3000 differs from the argument, 4000"),
    (plan(speed=-1), "plan: speed -1 is not in 0.."),
    (plan(altitude=1 << 31), "plan: altitude 2147483648 is not in"),
    (plan(altitude=21 * M), "plan: altitude 21000 differs from the argument, 20000"),
    (plan(path=(1, 2, 3)), "plan: a coordinate is missing"),
    (plan(path=(0, 0) * 8193), "plan: number of points 8193 is not in 0..8192"),
    (plan(path=(0, MAX_COORDINATE + 1)), f"plan: coordinate {MAX_COORDINATE + 1} is not in"),
    (plan(path=(0, 0)), "plan: the path does not match the arguments"),  # not in the area
    (plan(path=(*flat.PATH[:2], 100 * M, 0)), "plan: the path does not match the arguments"),
    (plan(path=()), "plan: the path does not match the arguments"),
    (
        replace(flat.INVOCATIONS[1], plan=replace(flat.INVOCATIONS[1].plan, path=(0, 0))),
        "plan: the path does not match the arguments",
    ),
    (
        replace(flat.INVOCATIONS[0], plan=replace(flat.INVOCATIONS[0].plan, path=(0, 0))),
        "plan: the path does not match the arguments",
    ),
    (
        replace(flat.INVOCATIONS[3], plan=replace(flat.INVOCATIONS[3].plan, path=(0, 1))),
        "plan: the path does not match the arguments",
    ),
    (
        replace(flat.INVOCATIONS[3], plan=replace(flat.INVOCATIONS[3].plan, path=())),  # a return leads home
        "plan: the path does not match the arguments",
    ),
    (
        replace(flat.INVOCATIONS[3], plan=replace(flat.INVOCATIONS[3].plan, path=(0, 0, 0, 0))),
        "plan: the path does not match the arguments",
    ),
]


@rows(("invocation", "what"), INVOCATIONS, ids=[what for _, what in INVOCATIONS])
def test_a_malformed_invocation(invocation: Invocation, what: str) -> None:
    found = prepare_invocation(invocation, POLICY, flat.MISSION.phases)
    assert isinstance(found, Refusal)
    assert found.text.startswith(what)


@rows(
    "tighter",
    [
        S.contract,
        replace(S.contract, deadline_us=1, validity_us=1, duration_us=1, grace_us=0, energy=9_999),
        replace(
            S.contract,
            require=(*S.contract.require, S.contract.assume[0]),
            record=("intent", *S.contract.record),
        ),
        replace(S.contract, record=(*S.contract.record, "synced")),
        replace(S.contract, record=(*S.contract.record, "synced_first")),
        replace(S.contract, parameters=(*S.contract.parameters[:3], replace(S.contract.parameters[3], high=5 * M))),
    ],
)
def test_a_mission_may_tighten(tighter: Any) -> None:
    assert isinstance(prepare_invocation(replace(S, contract=tighter), POLICY, flat.MISSION.phases), PreparedInvocation)


def test_a_text_that_was_cut_may_begin_as_another_does() -> None:
    cut = "x" * (MAX_TEXT - 3) + "..."
    of = prepare(contract(INSPECT, assume=(replace(S.contract.assume[0], text=cut), *S.contract.assume[1:])))
    assert isinstance(of, PreparedPolicy)
    clauses = of.policy.contracts[INSPECT].assume
    own = replace(of.policy.contracts[INSPECT], assume=(*clauses, replace(clauses[1], text=cut)))
    assert isinstance(prepare_invocation(replace(S, contract=own), of, flat.MISSION.phases), PreparedInvocation)


def test_mission_may_restrict_phases_of_unrestricted_contract() -> None:
    goto = flat.INVOCATIONS[1]
    chosen = replace(goto, contract=replace(goto.contract, phases=("inspection",)))
    assert isinstance(prepare_invocation(chosen, POLICY, flat.MISSION.phases), PreparedInvocation)


MISSION = flat.MISSION


def phases(step: int, bits: int) -> Mission:
    changed = (replace(one, phases=bits) if one.step == step else one for one in MISSION.invocations)
    return replace(MISSION, invocations=tuple(changed))


def saying(text: str) -> Mission:
    """A mission with a clause of its own that has this text."""
    goto = MISSION.invocations[1]
    worded = replace(goto.contract, assume=(*goto.contract.assume, replace(S.contract.assume[0], text=text)))
    steps = (*MISSION.invocations[:1], replace(goto, contract=worded), *MISSION.invocations[2:])
    return replace(MISSION, invocations=steps)


@pytest.mark.parametrize(("step", "bits"), [(0, 0b111), (0, 0), (2, 0b010), (2, 0)])
def test_step_phases_are_a_subset_of_contract_phases(step: int, bits: int) -> None:
    assert isinstance(prepare_mission(phases(step, bits), POLICY), tuple)


INVALID = "invalid: use ASCII letters, digits, `_` and `.`"


@rows(
    ("mission", "what"),
    [
        (replace(MISSION, policy="other"), "mission policy `other` differs from the policy's `bridge_inspection`"),
        (replace(MISSION, policy_version=8), "mission policy version `8` differs from the policy's `7`"),
        *(
            (replace(MISSION, name=name), f"the name of the mission is {INVALID}")
            for name in ("", "low` on `quad-07`: `hover()", "a.", "1st", "caf\u00e9", "a b", "a\n")
        ),
        (replace(MISSION, phases=("departure", "x y", "recovery")), f"the name of the phase is {INVALID}"),
        (replace(MISSION, vehicle="quad-08"), "mission vehicle `quad-08` differs from the policy's `quad-07`"),
        (replace(MISSION, invocations=MISSION.invocations * 4097), "number of invocations 16388 is not in 0..16384"),
        (replace(MISSION, phases=("p",) * 65), "number of phases 65 is not in 0..64"),
        (replace(MISSION, invocations=MISSION.invocations[1:]), "step 1 has the number of step 2"),
        (replace(MISSION, phases=("departure",)), "step 2: there is no phase 1"),
        (
            replace(MISSION, invocations=(MISSION.invocations[0], replace(MISSION.invocations[0], step=1))),
            "two steps have the same id",
        ),
        (replace(MISSION, invocations=(replace(MISSION.invocations[0], role=9),)), "step 1: there is no role 9"),
        *(
            (saying(f" {each.text}\n"), f"clause `{each.text}` has the text of a policy clause but different code")
            for each in (P.rules[0], P.airspace)
        ),
        (phases(2, 0b011), "step 3 is valid in a phase that its contract does not name"),
        (phases(0, 0b1001), "step 1 is valid in a phase that its contract does not name"),
    ],
)
def test_a_malformed_mission(mission: Mission, what: str) -> None:
    found = prepare_mission(mission, POLICY)
    assert found == Refusal("malformed", what)


def test_a_bundle_needs_neither_rules_nor_zones() -> None:
    bare = replace(
        P,
        rules=(),
        zones=(),
        declared=0,
        tables=(),
        airspace=None,
        contingency=(),
        contracts=P.contracts[1:2],
    )
    bare = replace(bare, contracts=(replace(bare.contracts[0], fallback=()),))
    assert isinstance(prepare(bare), PreparedPolicy)


# ---------------------------------------------------------------------------------------------------- fuzzing

ODD = (-1, 0, 1, 2, 3, 5, 28, 255, -(1 << 53), 1 << 29, 1 << 53, (1 << 63) - 1)


def damaged(of: Random, value: Any) -> Any:
    """The same tree with one leaf, or one branch, changed."""
    if isinstance(value, list) and value and of.random() < 0.95:
        at = of.randrange(len(value))
        return [*value[:at], damaged(of, value[at]), *value[at + 1 :]]
    if isinstance(value, list):
        return of.choice([[], value * 2, value[::-1]])
    return of.choice(ODD) if isinstance(value, int) else value


def damage(of: Random, struct: Any) -> Any:
    raw = msgspec.to_builtins(struct)
    for _ in range(of.choice([1, 1, 2, 5])):
        raw = damaged(of, raw)
    try:
        return msgspec.convert(raw, type(struct))
    except msgspec.ValidationError:
        return struct


@settings(max_examples=settings().max_examples * 4)
@given(worlds.CHANCES)
def test_damaged_bundle_raises_nothing(of: Random) -> None:
    whole = of.choice([worlds.policy(of), flat.POLICY])
    policy = prepare(damage(of, whole) if of.random() < 0.7 else whole)
    if isinstance(policy, Refusal):
        return
    invocation = prepare_invocation(damage(of, worlds.invocation(of, whole)), policy, flat.MISSION.phases)
    if isinstance(invocation, Refusal):
        return
    state, now = damage(of, worlds.state(of, len(policy.monitors))), damage(of, worlds.now(of))
    context = damage(of, worlds.context(of, invocation.invocation))
    assert decide(invocation, state, policy, context, now).step in range(1, 9)
    watch(invocation, state, policy, now)
    choose_fallback(invocation, state, policy, now)
    choose_contingency(state, policy, now)


def test_kinds_of_parameters_are_those_of_the_model() -> None:
    assert (QUANTITY, CHOICE, ZONE, PLACE) == (0, 1, 2, 3)
    assert (MotionKind.COVER, POLYGON) == (3, 1)
    assert isinstance(P.zones[0], Zone)


def test_paths_that_take_long_to_decide_about_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    policy = prepare(flat.POLICY)
    assert isinstance(policy, PreparedPolicy)
    assert not isinstance(prepare_mission(flat.MISSION, policy), Refusal)
    monkeypatch.setattr("rtshcua.decision.prepare.MAX_COMPARED", 3)
    refused = prepare_mission(flat.MISSION, policy)
    assert isinstance(refused, Refusal)
    assert refused.text.endswith("compared with more than 3 edges of zones")
