"""What a test asks for, as a real request: a mission of one step, lowered, bound and prepared as any other.

The proofs of missions are left out, so that what they would refuse can be asked: a test says what becomes of it.
"""

from collections.abc import Mapping, Sequence

from msgspec.structs import replace

from rtshcua.decision.prepare import PreparedInvocation, prepare_mission
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.checker.arguments import bind_value, pair
from rtshcua.ground.checker.checks.tables import unranged
from rtshcua.ground.checker.context import Bound, Context
from rtshcua.ground.checker.report import Report
from rtshcua.ground.checker.scope import Scope
from rtshcua.ground.checker.starts import Start
from rtshcua.ground.lower.mission import lower_mission
from rtshcua.ground.testing.case import Tested
from rtshcua.model.flat.contract import Contract
from rtshcua.model.flat.mission import Mission
from rtshcua.model.ir.expression import Coordinates
from rtshcua.model.ir.missions import MissionDecl, Phase, Step
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.places import ZoneDecl
from rtshcua.model.ir.skills import ArgumentValue, SkillDecl
from rtshcua.model.ir.tests import Request, TestDecl
from rtshcua.wire.binding import bind
from rtshcua.wire.bundle import policy_digest, policy_payload

#: who speaks for a role where nothing says it, as in a `permit`
OWN_SOURCE = "operator"


class Requests:
    """The requests of the tests under one policy; those that are the same are made once. `names` are for spans."""

    def __init__(self, context: Context, policy: Tested, names: Mapping[str, str]) -> None:
        self._context = context
        self._policy = policy
        self._names = names
        self._digest = policy_digest(policy_payload(policy.lowered.policy))
        self._made: dict[tuple[object, ...], PreparedInvocation] = {}

    def of(
        self, test: TestDecl, request: Request, start: Start, columns: Sequence[ArgumentValue], issued_at_us: int
    ) -> PreparedInvocation | None:
        """A request with the arguments that it says and those of a row; None after a finding."""
        skill = self._context.symbols.skills[request.skill.text]
        arguments = (*request.arguments, *columns)
        bound = self._bound(skill, arguments, request)
        phase = None if bound is None else self._phase(request, start)
        if bound is None or phase is None:
            return None
        assert start.role is not None
        source = start.source or Name(span=request.span, text=OWN_SOURCE)
        order = tuple(name.text for name in start.order)
        key = (skill.name.text, tuple(map(_key, bound)), start.role.text, source.text, order, phase, issued_at_us)
        if key not in self._made:
            step = Step(span=request.span, skill=request.skill, arguments=arguments, on_inadmissible="abort")
            mission = MissionDecl(
                span=test.span,
                name=Name(span=test.name.span, text="test"),  # what a test is called is a sentence, and no name
                policy=start.nominal.policy,
                policy_version=self._policy.lowered.policy.version,
                vehicle=start.nominal.vehicle,
                intent=None,
                source=source,
                proposer=None,
                role=start.role,
                phases=tuple(
                    Phase(span=name.span, name=name, items=(step,) if name.text == phase else ())
                    for name in start.order
                ),
            )
            made = self._lowered(mission, step, skill, bound, issued_at_us)
            if made is None:
                return None
            self._made[key] = made
        return self._made[key]

    def _bound(self, skill: SkillDecl, arguments: Sequence[ArgumentValue], request: Request) -> list[Bound] | None:
        """The value of every parameter, which was found to be of its type; it may be out of its range."""
        context = self._context
        pairs = pair(context, skill, arguments, request.span)
        known = context.arguments(skill)
        unheard = Scope(context.symbols, Report(context.report.sources))
        bound: list[Bound] = []
        for parameter in skill.parameters:
            value = None if pairs is None else pairs.get(parameter.name.text, parameter.default)
            found = None if value is None else bind_value(unheard, unranged(known[parameter.name.text]), value)
            if found is None:
                return None
            bound.append(found)
        return bound

    def _phase(self, request: Request, start: Start) -> str | None:
        """The phase that the step stands in: the mission's own, or else the first in which the skill is valid."""
        assert start.phase is not None
        valid = [name.text for name in self._context.symbols.skills[request.skill.text].phases]
        order = [name.text for name in start.order]
        if not valid or start.phase.phase.text in valid:
            return start.phase.phase.text
        found = next((name for name in order if name in valid), None)
        if found is None:
            words = ", ".join(f"`{name}`" for name in valid)
            current = start.phase.phase.text
            self._context.report.add(
                codes.UNKNOWN_PHASE,
                request.skill.span,
                f"`{request.skill.text}` is valid only during {words}, and the test knows no such phase",
                help=f"say the phases in their order, as in `phase {current} of {current}, {valid[0]}`",
                labels=[(start.phase.span, "the phase is said here")],
            )
        return found

    def _lowered(
        self, mission: MissionDecl, step: Step, skill: SkillDecl, bound: list[Bound], issued_at_us: int
    ) -> PreparedInvocation | None:
        context, under = self._context, self._policy.lowered
        context.bind(step, self._within(skill, bound))
        lowered = lower_mission(context, mission, under, self._names, issued_at_us)
        if lowered is None:
            return None
        flat = _with(lowered.mission, under.contracts.cells(bound))
        prepared = prepare_mission(bind(flat, self._digest), self._policy.prepared)
        if not isinstance(prepared, Refusal):
            return prepared[0]
        context.report.add(
            codes.REFUSED_ON_BOARD,
            step.span,
            f"this request would be refused before anything is decided on it: {prepared.text}",
            help="ask for what is nearer to what the skill takes",
        )
        return None

    def _within(self, skill: SkillDecl, bound: list[Bound]) -> tuple[Bound, ...]:
        """The arguments, the nearest in its range for one that is out of it: for that there is a plan."""
        known = self._context.arguments(skill)
        found: list[Bound] = []
        for parameter, value in zip(skill.parameters, bound, strict=True):
            argument = known[parameter.name.text]
            if isinstance(value, int) and argument.low is not None and argument.high is not None:
                value = min(max(value, argument.low), argument.high)
            found.append(value)
        return tuple(found)


def _with(mission: Mission, arguments: tuple[int, ...]) -> Mission:
    """The mission with these arguments of its one step, which flies as high and as fast as they say."""
    (invocation,) = mission.invocations
    if arguments == invocation.arguments:
        return mission
    plan, contract = invocation.plan, invocation.contract
    plan = replace(
        plan, altitude=_cell(contract, arguments, "altitude", plan.altitude),
        speed=_cell(contract, arguments, "speed", plan.speed),
    )  # fmt: skip
    return replace(mission, invocations=(replace(invocation, arguments=arguments, plan=plan),))


def _cell(contract: Contract, arguments: tuple[int, ...], name: str, otherwise: int) -> int:
    cell: int = getattr(contract.motion, name)
    return otherwise if cell == -1 else arguments[cell]


def _key(bound: Bound) -> object:
    if isinstance(bound, ZoneDecl):
        return bound.name.text
    return (bound.latitude, bound.longitude) if isinstance(bound, Coordinates) else bound
