"""Checks of a mission and its invocations, under a policy that is well-formed."""

from collections.abc import Iterator, Sequence

from rtshcua.decision.checks.contracts import contract, one_line, posing, tightens
from rtshcua.decision.checks.indexes import at, index, within
from rtshcua.decision.checks.zones import place
from rtshcua.decision.contracts import cells, first_cell
from rtshcua.decision.tree import scope_of
from rtshcua.decision.values import TRUE
from rtshcua.decision.volume import HOME
from rtshcua.decision.zones import NO_BOX, PreparedZone
from rtshcua.model.flat.contract import PLACE, ZONE, Contract, Facing, Motion, MotionKind, SourceKind
from rtshcua.model.flat.limits import MAX_INVOCATIONS, MAX_PATH, MAX_PHASES, MAX_SPEED, MAX_VALUE
from rtshcua.model.flat.mission import ALONG, TURN, Invocation, Mission, OnInadmissible, Plan
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.zone import HIGHEST, LOWEST, MAX_COORDINATE
from rtshcua.model.step_number import step_words


def mission(mission: Mission, policy: Policy) -> Iterator[str]:
    """Yield the problems of a mission, except those of its invocations."""
    for name, mine, policys in (
        ("policy", mission.policy, policy.name),
        ("policy version", mission.policy_version, policy.version),
        ("vehicle", mission.vehicle, policy.vehicle.identity),
    ):
        if mine != policys:
            yield f"mission {name} `{mine}` differs from the policy's `{policys}`"
    for what, name in (("mission", mission.name), *(("phase", phase) for phase in mission.phases)):
        # the name is displayed to people who sign and supervise, so it must not be able to imitate a sentence
        if not _is_name(name):
            yield f"the name of the {what} is invalid: use ASCII letters, digits, `_` and `.`"
    yield from within("number of invocations", len(mission.invocations), 0, MAX_INVOCATIONS)
    yield from within("number of phases", len(mission.phases), 0, MAX_PHASES)
    if len(set(mission.phases)) != len(mission.phases):
        yield "two phases have the same name"
    for step, one in enumerate(mission.invocations):
        if one.step != step:
            yield f"{step_words(step)} has the number of {step_words(one.step)}"
        yield from at(step_words(step), index("phase", one.phase, len(mission.phases)))
        if one.phases & ~_phases(one.contract, mission):
            yield f"{step_words(step)} is valid in a phase that its contract does not name"
    yield from _rules_words(mission, policy)
    if len({one.invocation_id for one in mission.invocations}) != len(mission.invocations):
        yield "two steps have the same id"


def _rules_words(mission: Mission, policy: Policy) -> Iterator[str]:
    """Texts that no condition may have, because a log identifies a rule by this text."""
    contracts = (one.contract for one in mission.invocations)
    clauses = {each.text: each for of in contracts for each in (*of.require, *of.assume, *of.maintain)}
    worded = {one_line(text): each for text, each in clauses.items()}
    airspace = () if policy.airspace is None else (policy.airspace,)
    for decisive in (*policy.rules, *airspace):
        found = worded.get(one_line(decisive.text))
        if found is not None:
            yield posing(found)


def _is_name(name: str) -> bool:
    """Whether a text has the form of a name in the language."""
    return name.isascii() and all(part.isidentifier() for part in name.split("."))


def _phases(contract: Contract, mission: Mission) -> int:
    """The bit set of the mission's phases in which a contract may be used."""
    return sum(1 << number for number, name in enumerate(mission.phases) if name in (contract.phases or (name,)))


def invocation(invocation: Invocation, policy: Policy, zones: Sequence[PreparedZone]) -> Iterator[str]:
    """Yield the problems of an invocation. `decide` refuses arguments that are out of range, so that the refusal is
    recorded.
    """
    yield from index("skill", invocation.skill, len(policy.contracts))
    yield from index("role", invocation.role, len(policy.roles))
    yield from within("source", invocation.source, SourceKind.AGENT, SourceKind.REFLEX)
    yield from within("on inadmissible", invocation.on_inadmissible, OnInadmissible.ABORT, OnInadmissible.REPLAN)
    yield from within("issued at", invocation.issued_at_us, 0, MAX_VALUE)
    yield from within("phases", invocation.phases, 0, (1 << MAX_PHASES) - 1)
    mine, policys = invocation.contract, policy.contracts[invocation.skill]
    if mine != policys:  # checks of the policy already cover the policy's own contract
        yield from tightens(mine, policys)
        yield from contract(mine, policy, scope_of(policy))
    if len(invocation.arguments) != cells(mine):
        yield f"{len(invocation.arguments)} argument cells; the contract has {cells(mine)}"
    for argument in invocation.arguments:
        yield from within("argument", argument, -MAX_VALUE, MAX_VALUE)
    yield from at("plan", _plan(invocation.plan, mine, invocation.arguments))
    if not _leads_right(invocation.plan, mine, invocation.arguments, zones[: policy.declared]):
        yield "plan: the path does not match the arguments"
    for x, y in zip(invocation.plan.path[::2], invocation.plan.path[1::2], strict=True):
        yield from at("plan", place(policy.projection, x, y))


def _plan(plan: Plan, contract: Contract, arguments: tuple[int, ...]) -> Iterator[str]:
    """Yield the differences between a plan and its arguments: the path that is checked must be the path that is
    flown.
    """
    motion = contract.motion
    if plan.kind != motion.kind:
        yield f"kind {plan.kind} differs from the skill's, {motion.kind}"
    yield from within("speed", plan.speed, 0, MAX_SPEED)
    yield from within("altitude", plan.altitude, LOWEST, HIGHEST)
    for name, cell, value in (("altitude", motion.altitude, plan.altitude), ("speed", motion.speed, plan.speed)):
        said = (
            0 if cell == -1 else arguments[cell]
        )  # the plan must not contain anything that the arguments do not specify
        if said != value:
            yield f"{name} {value} differs from the argument, {said}"
    if len(plan.path) % 2:
        yield "a coordinate is missing"
    yield from within("number of points", len(plan.path) // 2, 0, MAX_PATH)
    for coordinate in plan.path:
        yield from within("coordinate", coordinate, -MAX_COORDINATE, MAX_COORDINATE)
    yield from _levels(plan, motion, arguments)


def _levels(plan: Plan, motion: Motion, arguments: tuple[int, ...]) -> Iterator[str]:
    """Yield the problems of the heights and headings of a path. Rules and clauses judge the arguments, so no height is
    outside of them.
    """
    points, lowest = len(plan.path) // 2, plan.altitude if motion.lowest == -1 else arguments[motion.lowest]
    if plan.heights:
        if motion.lowest == -1:
            yield "the skill has one height"
        if len(plan.heights) != points:
            yield f"{len(plan.heights)} heights; the path has {points} points"
        for height in plan.heights:
            yield from within("height", height, max(lowest, LOWEST), plan.altitude)
    elif lowest > plan.altitude:
        yield f"lowest height {lowest} is above the altitude"
    if bool(plan.headings) != (motion.facing != Facing.ALONG):
        yield "the headings do not match the skill's"
    if plan.headings and len(plan.headings) != points:
        yield f"{len(plan.headings)} headings; the path has {points} points"
    for heading in plan.headings:
        yield from within("heading", heading, ALONG, TURN - 1)


def _leads_right(plan: Plan, contract: Contract, arguments: tuple[int, ...], declared: Sequence[PreparedZone]) -> bool:
    """Whether the path leads where the arguments say. Rules and clauses judge the arguments, so the path must follow
    them.
    """
    match plan.kind:
        case MotionKind.COVER:
            zone = arguments[first_cell(contract, ZONE)]
            if not 0 <= zone < len(declared):
                return bool(plan.path)  # `decide` refuses these
            return bool(plan.path) and declared[zone].along(plan.path, NO_BOX) == TRUE
        case MotionKind.FLY:
            cell = first_cell(contract, PLACE)
            return plan.path == arguments[cell : cell + 2]
        case MotionKind.HOME:
            return plan.path == HOME
        case _:
            return not plan.path
