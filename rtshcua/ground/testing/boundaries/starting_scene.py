"""A scene to start from: who asks for a skill, with which arguments, in which state, so that it is allowed.

As much as possible stays as a given state has it. The analysis of `ground.analysis` finds values for which every rule
and every clause of the contract is content; from where the planned path is content too is tried (`start_places`).
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
from rtshcua.model.flat.contract import PLACE, QUANTITY, ZONE, MotionKind, SourceKind
from rtshcua.model.flat.mission import Invocation, OnInadmissible, Plan
from rtshcua.model.flat.policy import Policy, Rule, RuleKind
from rtshcua.model.flat.situation import Context, Now, State

#: the truth that each kind of condition should have; of permits one is enough
_WANTED = {"forbid": FALSE, "confirm": FALSE, "degrade": FALSE}
#: a height to begin from that is low and in the air, mm
_ALOFT = 20_000
#: a height that most skills may fly at, and a way that most may go, mm
_LOW = 10_000


class Requester(NamedTuple):
    """A skill, and the role and the source that ask for it, by their numbers."""

    skill: int
    role: int
    source: int


class SceneCandidate(NamedTuple):
    """What to ask for, and what to change of the state; it remains to be tried whether it is allowed."""

    asker: Requester
    scene: Scene
    made: SceneChanges


def requesters(policy: Policy) -> Iterator[Requester]:
    """For each permit and skill someone whom it names, and for each other rule someone permitted on whom it bears where
    it bears on none of these; nobody twice for one skill.
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
    """Everybody who may ask for a skill by some permits, for each permit the likeliest first."""
    timing_class = policy.contracts[skill].timing_class
    for rule in permits:
        for role in rule.roles or _roles(policy):
            for source in rule.sources or tuple(SourceKind):
                if skill in (rule.skills or (skill,)) and timing_class in CLASSES[source]:
                    yield Requester(skill, role, source)


def _roles(policy: Policy) -> tuple[int, ...]:
    """The roles that a policy names, the likeliest first: `operator`, then those that something is permitted to. Every
    policy has an operator; where it names other roles and not that one, nobody is asked to sign off on it.
    """
    permitted = [role for rule in policy.rules if rule.kind == RuleKind.PERMIT for role in rule.roles]
    named = dict.fromkeys((*permitted, *(role for rule in policy.rules for role in rule.roles)))
    usual = policy.roles.index("operator")
    return tuple(sorted(named, key=lambda role: role != usual)) or (usual,)


def _bears(rule: Rule, asker: Requester) -> bool:
    """Whether a rule is about someone's requests."""
    return asker.role in (rule.roles or (asker.role,)) and asker.source in (rule.sources or (asker.source,))


def scene_candidate(
    asker: Requester,
    prepared: PreparedPolicy,
    asked: Questions,
    state: State,
    now: Now,
    entries: Sequence[tuple[int, int]],
) -> SceneCandidate | None:
    """Values for which nothing refuses; `entries` are places that a vehicle may be sent to, the likeliest first. None
    where the analysis finds none.
    """
    best: SceneCandidate | None = None
    for place in (*entries, (0, 0)):
        scene = _sketch(asker, prepared, state, now, place, asked)
        if scene is None:
            continue
        made = _content(scene, asked)
        if made is not None and (best is None or len(made) < len(best.made)):
            best = SceneCandidate(asker, scene, made)
        if best is not None and not any(variable.argument for variable in best.made):
            break
        if not any(parameter.kind == PLACE for parameter in prepared.policy.contracts[asker.skill].parameters):
            break
    return best


def _content(scene: Scene, asked: Questions) -> SceneChanges | None:
    """What is changed so that each condition is content; if need be, but for those that a person is to confirm."""
    every = list(parts_of(scene.invocation))
    space = asked.space(scene.invocation.invocation.skill)
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
    asker: Requester, prepared: PreparedPolicy, state: State, now: Now, place: tuple[int, int], asked: Questions
) -> Scene | None:
    """A scene with some arguments; the survey of an area is one place of it."""
    policy = prepared.policy
    contract = policy.contracts[asker.skill]
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
        path = asked.space(asker.skill).plane.place({zone: True}, lambda _: True) or (0, 0)
    elif motion.kind == MotionKind.HOME:
        path = HOME
    altitude = 0 if motion.altitude == -1 else arguments[motion.altitude]
    speed = 0 if motion.speed == -1 else arguments[motion.speed]
    flat = Invocation(
        invocation_id=b"",
        step=0,
        phase=0,
        skill=asker.skill,
        source=asker.source,
        role=asker.role,
        arguments=tuple(arguments),
        issued_at_us=now.utc_us,
        phases=1,
        on_inadmissible=int(OnInadmissible.ABORT),
        contract=contract,
        plan=Plan(motion.kind, path, altitude, speed),
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
    """Places and heights (local mm) from where the planned path may well be content: where the scene is, where the
    path begins, and home; as high as the scene, as the plan, low over the ground, and on it.
    """
    invocation, vehicle = scene.invocation.invocation, scene.invocation.policy.policy.vehicle
    x, y, height = (scene.state.values[slot] for slot in (vehicle.position, vehicle.position + 1, vehicle.height))
    places = [*([] if x is None or y is None else [(x, y)]), invocation.plan.path[:2], (0, 0)]
    heights = [*([] if height is None else [height]), invocation.plan.altitude, _ALOFT, 0]
    for place in dict.fromkeys(tuple(each) for each in places if each):
        for high in dict.fromkeys(heights):
            yield place[0], place[1], high


def other_arguments(scene: Scene, entries: Sequence[tuple[int, int]]) -> Iterator[SceneChanges]:
    """The same arguments, and then one that the planned path depends on otherwise: as low as can be, another area, a
    place nearer to home.
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
