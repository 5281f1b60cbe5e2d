"""Finds an allowed scene to start from: the requester, the arguments and the state.

The scene differs from a given state as little as possible. `ground.analysis` finds values with which every rule and
clause of the contract lets the request pass. Places from which the planned path passes too are found by trying
(`start_places`).
"""

from collections.abc import Iterator, Sequence
from itertools import islice
from typing import NamedTuple

from rtshcua.decision import tree
from rtshcua.decision.decide import CLASSES
from rtshcua.decision.prepare import PreparedInvocation, PreparedPolicy, prepare_invocation
from rtshcua.decision.values import FALSE, TRUE
from rtshcua.decision.volume import HOME
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.analysis.solve import Goal, Questions
from rtshcua.ground.analysis.witness import plainest
from rtshcua.ground.testing.boundaries.pivot import permitted, settled
from rtshcua.ground.testing.boundaries.scene import Scene, SceneChanges, SceneVariable, Value, parts_of
from rtshcua.model.flat.contract import PLACE, QUANTITY, ZONE, Facing, MotionKind, SourceKind
from rtshcua.model.flat.mission import ALONG, Invocation, OnInadmissible, Plan
from rtshcua.model.flat.policy import Policy, Rule, RuleKind
from rtshcua.model.flat.situation import Context, Now, State

#: the truth that each kind of condition should have; one permit is enough
_WANTED = {"forbid": FALSE, "confirm": FALSE, "degrade": FALSE}
#: a low height in the air, mm
_ALOFT = 20_000
#: a height and a distance that most skills permit, mm
_LOW = 10_000


class Requester(NamedTuple):
    """The numbers of a skill, and of the role and the source of a request for it."""

    skill: int
    role: int
    source: int


class SceneCandidate(NamedTuple):
    """A request and the changes of the state with which it may be allowed."""

    requester: Requester
    scene: Scene
    made: SceneChanges


def requesters(policy: Policy) -> Iterator[Requester]:
    """Yield a requester for each permit and skill, and for each other rule a permitted requester to whom it applies, if
    it applies to none of those before. No requester is repeated.
    """
    every = range(len(policy.contracts))
    permits = [rule for rule in policy.rules if rule.kind == RuleKind.PERMIT]
    seen: dict[Requester, None] = {}
    for rule in permits:
        for skill in rule.skills or every:
            seen |= dict.fromkeys(islice(_requesters(policy, [rule], skill), 1))
    for rule in policy.rules:
        for skill in () if rule.kind == RuleKind.PERMIT else rule.skills or every:
            if not any(each.skill == skill and _bears(rule, each) for each in seen):
                able = (each for each in _requesters(policy, permits, skill) if _bears(rule, each))
                seen |= dict.fromkeys(islice(able, 1))
    yield from seen


def _requesters(policy: Policy, permits: Sequence[Rule], skill: int) -> Iterator[Requester]:
    """Yield the requesters of a skill whom some permits allow, for each permit the most usual first."""
    timing_class = policy.contracts[skill].timing_class
    for rule in permits:
        for role in rule.roles or _roles(policy):
            for source in rule.sources or tuple(SourceKind):
                if skill in (rule.skills or (skill,)) and timing_class in CLASSES[source]:
                    yield Requester(skill, role, source)


def _roles(policy: Policy) -> tuple[int, ...]:
    """The roles that a policy names, the most usual first: `operator`, then those of permits, then the others.

    Every policy has an operator, but it is listed only if a rule names it or no rule names any role.
    """
    permitted = [role for rule in policy.rules if rule.kind == RuleKind.PERMIT for role in rule.roles]
    named = dict.fromkeys((*permitted, *(role for rule in policy.rules for role in rule.roles)))
    usual = policy.roles.index("operator")
    return tuple(sorted(named, key=lambda role: role != usual)) or (usual,)


def _bears(rule: Rule, requester: Requester) -> bool:
    """Whether a rule applies to a requester."""
    return requester.role in (rule.roles or (requester.role,)) and requester.source in (
        rule.sources or (requester.source,)
    )


def scene_candidate(
    requester: Requester,
    prepared: PreparedPolicy,
    analysis: Questions,
    state: State,
    now: Now,
    entries: Sequence[tuple[int, int]],
) -> SceneCandidate | None:
    """Return a candidate that no condition refuses; None if the analysis finds none.

    `entries` are places to which a vehicle may be sent, the most likely first.
    """
    best: SceneCandidate | None = None
    for place in (*entries, (0, 0)):
        scene = _sketch(requester, prepared, state, now, place, analysis)
        if scene is None:
            continue
        made = _passing(scene, analysis)
        if made is not None and (best is None or len(made) < len(best.made)):
            best = SceneCandidate(requester, scene, made)
        if best is not None and not any(variable.argument for variable in best.made):
            break
        if not any(parameter.kind == PLACE for parameter in prepared.policy.contracts[requester.skill].parameters):
            break
    return best


def _passing(scene: Scene, analysis: Questions) -> SceneChanges | None:
    """Return changes with which every condition lets the request pass; if need be, except `confirm` rules."""
    every = list(parts_of(scene.invocation))
    space = analysis.space(scene.invocation.invocation.skill)
    for without in ((), ("confirm",)):
        goals: list[Goal] = [
            (part.node, _WANTED.get(part.role, TRUE))
            for part in every
            if part.node is not None and part.role != "permit" and part.role not in without
        ]
        goals += [*permitted(every, scene), *_in_airspace(scene.invocation)]
        found = settled(goals, space, scene)
        if found is not None:
            return found
    return None


def _in_airspace(invocation: PreparedInvocation) -> Iterator[Goal]:
    airspace = invocation.policy.policy.airspace
    if airspace is not None:
        yield from ((tree.InsideZone(zone), TRUE) for zone in airspace.inside)
        yield from ((tree.InsideZone(zone), FALSE) for zone in airspace.outside)


def _sketch(
    requester: Requester, prepared: PreparedPolicy, state: State, now: Now, place: tuple[int, int], analysis: Questions
) -> Scene | None:
    """Return a scene with plain arguments. The path of a survey is one place in its area."""
    policy = prepared.policy
    contract = policy.contracts[requester.skill]
    arguments: list[int] = []
    zone = 0
    for parameter in contract.parameters:
        if parameter.kind == PLACE:
            arguments += place
        elif parameter.kind == QUANTITY:
            arguments.append(plainest((parameter.low, parameter.high, 0, None)))
        else:
            zone = parameter.low if parameter.kind == ZONE else zone
            arguments.append(parameter.low)
    motion = contract.motion
    path: tuple[int, ...] = ()
    if motion.kind == MotionKind.FLY:
        path = place
    elif motion.kind == MotionKind.COVER:
        path = analysis.space(requester.skill).plane.place({zone: True}, lambda _: True) or (0, 0)
    elif motion.kind == MotionKind.HOME:
        path = HOME
    altitude = 0 if motion.altitude == -1 else arguments[motion.altitude]
    speed = 0 if motion.speed == -1 else arguments[motion.speed]
    if motion.lowest != -1:
        arguments[motion.lowest] = min(arguments[motion.lowest], altitude)
    headings = (ALONG,) * (len(path) // 2) if motion.facing != Facing.ALONG else ()
    flat = Invocation(
        invocation_id=b"",
        step=0,
        phase=0,
        skill=requester.skill,
        source=requester.source,
        role=requester.role,
        arguments=tuple(arguments),
        issued_at_us=now.utc_us,
        phases=1,
        on_inadmissible=int(OnInadmissible.ABORT),
        contract=contract,
        plan=Plan(motion.kind, path, altitude, speed, headings=headings),
        text="",
        file=0,
        start=0,
        end=0,
        binding=b"",
    )
    phases = contract.phases[:1] or ("flight",)
    invocation = prepare_invocation(flat, prepared, phases)
    if isinstance(invocation, Refusal):
        return None
    context = Context(b"", policy.vehicle.identity, policy.version, 0, 0, 0, 0, ())
    return Scene(invocation, state, context, now)


def start_places(scene: Scene) -> Iterator[tuple[int, int, int]]:
    """Yield places and heights (local mm) from which the planned path may be allowed.

    Places are that of the scene, the begin of the path, and home; heights are those of the scene and the plan, a low
    one, and the ground.
    """
    invocation, vehicle = scene.invocation.invocation, scene.invocation.policy.policy.vehicle
    x, y, height = (scene.state.values[slot] for slot in (vehicle.position, vehicle.position + 1, vehicle.height))
    places = [*([] if x is None or y is None else [(x, y)]), invocation.plan.path[:2], (0, 0)]
    heights = [*([] if height is None else [height]), invocation.plan.altitude, _ALOFT, 0]
    for place in dict.fromkeys(tuple(each) for each in places if each):
        for high in dict.fromkeys(heights):
            yield place[0], place[1], high


def other_arguments(scene: Scene, entries: Sequence[tuple[int, int]]) -> Iterator[SceneChanges]:
    """Yield changes of one argument on which the path depends: a lower altitude, another area, another place; first no
    change.
    """
    flat, policy = scene.invocation.invocation, scene.invocation.policy.policy
    yield {}
    for parameter in flat.contract.parameters:
        values: list[Value] = []
        if parameter.cell == flat.contract.motion.altitude:
            values += dict.fromkeys((max(_LOW, parameter.low), parameter.low))
        elif parameter.kind == ZONE:
            values += (zone for zone in range(policy.declared) if zone != flat.arguments[parameter.cell])
        elif parameter.kind == PLACE:
            values += (*entries, (0, 0), (_LOW, 0))
        yield from ({SceneVariable(True, parameter.cell): value} for value in values)
