"""The cases of X3: what troubles a step, and what is decided then. Each troubles one thing; everything else is as a
step needs it, and varies within what is admissible.

The paper names only the normal allow, expired slack, missing GPS, policy violations and replay. The other names, and
all figures, are ours.
"""

from collections.abc import Mapping, Sequence
from random import Random
from types import MappingProxyType
from typing import Final, NamedTuple

from msgspec.structs import replace

from rtshcua.evaluation.worlds import FlatProgram
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.mission import Invocation, Mission
from rtshcua.model.flat.policy import Policy, RuleKind
from rtshcua.model.flat.signal import Signal
from rtshcua.model.flat.situation import Now, State
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.wire.request import STEP, Request

#: the skills at which a case strikes: the first of these that the mission has, at its first step
STRUCK: Final = ("inspect_area", "hover")

M: Final = 1_000  # mm
_ON_GROUND, _IN_AIR = 1, 2  # of the signal `landed`
_NONE: Final[Mapping[str, int | None]] = MappingProxyType({})


class EvaluationCase(NamedTuple):
    """A case: its number in the table, and the outcome and the reason that it must have.

    `values` are troubled signals in canonical units, None for unknown; `stale` is one that is too old. `scope` is an
    argument of the struck step that its permit does not cover. The other cases trouble the request (`struck`), the
    session or the policy.
    """

    number: int
    name: str
    outcome: Outcome
    reason: Reason
    values: Mapping[str, int | None] = _NONE
    stale: str = ""


_ALLOW, _DENY, _DEFER, _FALLBACK = Outcome
ALLOWED: Final = EvaluationCase(1, "normal allow", _ALLOW, Reason.ADMITTED)
EXPIRED_SLACK: Final = EvaluationCase(2, "expired slack", _FALLBACK, Reason.NO_SLACK)
NOT_PERMITTED: Final = EvaluationCase(9, "skill not permitted", _DENY, Reason.NOT_PERMITTED)
OUT_OF_SCOPE: Final = EvaluationCase(10, "argument out of scope", _DENY, Reason.OUT_OF_SCOPE)
TAMPERED: Final = EvaluationCase(11, "binding tampered", _DENY, Reason.BINDING_MISMATCH)
REPLAY: Final = EvaluationCase(12, "replay", _DENY, Reason.REPLAYED)
#: A request cannot name a version: its binding covers it, and so a runtime under another version has another binding.
OTHER_VERSION: Final = EvaluationCase(13, "policy version mismatch", _DENY, Reason.BINDING_MISMATCH)
VALIDITY_OVER: Final = EvaluationCase(14, "validity over", _DENY, Reason.EXPIRED)
CASES: Final = (
    ALLOWED,
    EXPIRED_SLACK,
    EvaluationCase(3, "low battery", _FALLBACK, Reason.STATE_VIOLATED, {"battery": 3_000}),
    EvaluationCase(4, "degraded link", _FALLBACK, Reason.STATE_VIOLATED, {"link.quality": 1_000}),
    EvaluationCase(5, "obstacle near", _FALLBACK, Reason.STATE_VIOLATED, {"obstacle.distance": 2 * M}),
    EvaluationCase(6, "wind over limit", _FALLBACK, Reason.STATE_VIOLATED, {"wind.speed": 12 * M}),
    EvaluationCase(7, "GPS missing", _DEFER, Reason.STATE_UNKNOWN, {"gps.fix": None}),
    EvaluationCase(8, "stale state", _DEFER, Reason.SAFETY_UNKNOWN, stale="position"),
    NOT_PERMITTED,
    OUT_OF_SCOPE,
    TAMPERED,
    REPLAY,
)
#: two that the design lists besides; they do not count in the headline
EXTRAS: Final = (OTHER_VERSION, VALIDITY_OVER)
BY_NAME: Final[Mapping[str, EvaluationCase]] = {each.name: each for each in (*CASES, *EXTRAS)}

#: what signals have in admissible situations, from and to, in canonical units
_USUAL: Final[Mapping[str, tuple[int, int]]] = {
    "battery": (7_500, 9_800),
    "battery.drain": (300, 500),
    "battery.voltage": (15_400, 16_600),
    "battery.cell": (3_850, 4_150),
    "gps.fix": (3, 6),
    "gps.accuracy": (500, 1_500),
    "link.quality": (6_000, 10_000),
    "obstacle.distance": (30 * M, 60 * M),
    "wind.speed": (0, 4 * M),
    "velocity.north": (-100, 100),
    "velocity.east": (-100, 100),
    "velocity.down": (-50, 50),
}
#: mm: how far from its place a vehicle is
_OFF: Final = 300
#: us: since the release, and the greatest `L_rem`: together less than the shortest deadline
_SINCE_RELEASE: Final = (0, 40_000)
_REMAINING: Final = (1_000, 20_000)


def struck_step(mission: Mission) -> int:
    """The index of the step at which the cases strike. Raises LookupError where the mission has none."""
    names = [each.contract.name for each in mission.invocations]
    return next(names.index(skill) for skill in STRUCK if skill in names)


def honest(policy: Policy, mission: Mission, step: int, now: Now, chance: Random, *, at: int | None = None) -> Request:
    """The request of an honest runtime for a step in its turn, in a situation in which step `at`, by default the same,
    is admissible; `mission` is bound.
    """
    invocation = mission.invocations[step]
    return Request(
        STEP, step, -1, invocation.binding, now,
        admissible(policy, mission.invocations, step if at is None else at, chance),
        now.monotonic_us - chance.randint(*_SINCE_RELEASE), invocation.phase, chance.randint(*_REMAINING),
    )  # fmt: skip


def admissible(policy: Policy, steps: Sequence[Invocation], step: int, chance: Random | None = None) -> State:
    """A state in which a step may begin where its predecessors end; without `chance` the same each time. Raises
    LookupError for a signal without a range.
    """
    chance = chance or Random(0)
    values: list[int | None] = [None] * policy.slots
    ages = [0] * policy.slots
    for signal in policy.signals:
        for slot, value in zip(signal.slots, _value(signal, steps[:step], chance), strict=True):
            values[slot], ages[slot] = value, chance.randint(0, signal.stale_us // 4)
    return State(tuple(values), tuple(ages), (1,) * len(policy.monitors))


def _value(signal: Signal, before: Sequence[Invocation], chance: Random) -> tuple[int, ...]:
    match signal.name:
        case "position":
            path = next((each.plan.path for each in reversed(before) if len(each.plan.path) > 1), (0, 0))
            return tuple(at + chance.randint(-_OFF, _OFF) for at in path[-2:])
        case "height":
            if not before:
                return (chance.randint(-_OFF, _OFF),)
            rises = (MotionKind.CLIMB, MotionKind.FLY, MotionKind.COVER)
            return (next(each.plan.last_height for each in reversed(before) if each.plan.kind in rises),)
        case "landed":
            return (_IN_AIR if before else _ON_GROUND,)
    return (chance.randint(*_USUAL[signal.name]),)


def troubled(case: EvaluationCase, request: Request, policy: Policy, mission: Mission, other_binding: bytes) -> Request:
    """An honest request with the trouble of a case, as far as that is in the request. `other_binding` is that of the
    same step under another version of the policy.
    """
    invocation, now = mission.invocations[request.step], request.now
    if case is EXPIRED_SLACK:
        return replace(request, released_us=now.monotonic_us - invocation.contract.deadline_us)
    if case is TAMPERED:
        binding = request.binding
        return replace(request, binding=binding[:-1] + bytes([binding[-1] ^ 1]))
    if case is OTHER_VERSION:
        return replace(request, binding=other_binding)
    values, ages = list(request.state.values), list(request.state.ages)
    signals = {each.name: each for each in policy.signals}
    for name, value in case.values.items():
        values[signals[name].slot] = value
    if case.stale:
        for slot in signals[case.stale].slots:
            ages[slot] = signals[case.stale].stale_us + 1
    return replace(request, state=replace(request.state, values=tuple(values), ages=tuple(ages)))


def program_of(case: EvaluationCase, program: FlatProgram, step: int | None = None) -> FlatProgram:
    """The policy and mission of a case that strikes at a step, by default the usual one. Those of two cases differ:
    the compiler refuses them, so they are signed by a proposer whose compiler is not ours.
    """
    step = struck_step(program.mission) if step is None else step
    if case is NOT_PERMITTED:
        later = next_version(program)
        return later._replace(policy=_forgetting(later.policy, program.mission.invocations[step].skill))
    if case is OUT_OF_SCOPE:
        steps = [*program.mission.invocations]
        steps[step] = _beyond(steps[step])
        return program._replace(mission=replace(program.mission, invocations=tuple(steps)))
    return program


def _forgetting(policy: Policy, skill: int) -> Policy:
    """A policy without what permits a skill."""
    rules = []
    for rule in policy.rules:
        if rule.kind != RuleKind.PERMIT or skill not in rule.skills:
            rules.append(rule)
        elif len(rule.skills) > 1:
            rules.append(replace(rule, skills=tuple(each for each in rule.skills if each != skill)))
    return replace(policy, rules=tuple(rules))


#: arguments that no permit covers, in canonical units: 40 m where 30 m are permitted, and 25 s where 20 s are
_BEYOND: Final[Mapping[str, int]] = {"altitude": 40 * M, "time": 25_000_000}
#: the altitude of a takeoff, for which 40 m are permitted
_HIGH: Final = 41 * M


def _beyond(step: Invocation) -> Invocation:
    cells = {each.name: each.cell for each in step.contract.parameters}
    name = next(each for each in _BEYOND if each in cells)
    value = _HIGH if step.plan.kind == MotionKind.CLIMB else _BEYOND[name]
    arguments = tuple(value if cell == cells[name] else each for cell, each in enumerate(step.arguments))
    plan = replace(step.plan, altitude=value) if name == "altitude" else step.plan
    return replace(step, arguments=arguments, plan=plan)


def repeated(program: FlatProgram, times: int) -> FlatProgram:
    """The program with its struck step so many times in a row, each with an id of its own."""
    mission = program.mission
    at = struck_step(mission)
    steps = (*mission.invocations[:at], *mission.invocations[at : at + 1] * times, *mission.invocations[at + 1 :])
    numbered = tuple(replace(each, step=number) for number, each in enumerate(steps))
    return program._replace(mission=replace(mission, invocations=numbered))


def next_version(program: FlatProgram) -> FlatProgram:
    """The same under the next version of the policy."""
    version = program.policy.version + 1
    return FlatProgram(replace(program.policy, version=version), replace(program.mission, policy_version=version))
