"""A mission to the flat form: one contract-bound invocation a step, still without its id and its binding.

The contract of a step is its skill's, made tighter by what the step says of its own. The policy is signed once for all
its missions, so a mission adds nothing to its tables: a step's own clauses may read the signals that the policy reads,
and zones, sets and monitors that it has (E0622). Its plan is where it will take the vehicle: path, altitude and speed.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from msgspec.structs import replace

from rtshcua.decision.tree import slots_read
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.context import Bound, Context
from rtshcua.ground.checker.symbols import suggestion
from rtshcua.ground.geometry.shapes import MultiPolygon, parts
from rtshcua.ground.geometry.survey import DEFAULT_PATTERN, survey
from rtshcua.ground.lower import lacking
from rtshcua.ground.lower.conditions import Place
from rtshcua.ground.lower.contracts import cells_of, recorded
from rtshcua.ground.lower.files import Files, Joint
from rtshcua.ground.lower.policy import LoweredPolicy
from rtshcua.ground.lower.trial import Trial
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import Contract, MotionKind, SourceKind
from rtshcua.model.flat.limits import MAX_CLAUSES, MAX_INVOCATIONS, MAX_PATH, MAX_PHASES
from rtshcua.model.flat.mission import Invocation, Mission, OnInadmissible, Plan
from rtshcua.model.ir.missions import MissionDecl, Overrides, Phase, Step
from rtshcua.model.ir.places import ZoneDecl
from rtshcua.model.ir.skills import Clause as ClauseDecl
from rtshcua.model.ir.skills import SkillDecl


class LoweredMission(NamedTuple):
    """A flat mission, and the files that its contracts' clauses refer to."""

    mission: Mission
    files: Joint


def lower_mission(
    context: Context, mission: MissionDecl, under: LoweredPolicy, names: Mapping[str, str], issued_at_us: int
) -> LoweredMission | None:
    """The mission under its lowered policy, issued at a UTC time in us; None after a finding."""
    assert mission.source is not None
    assert mission.role is not None
    before = len(context.report.found)
    steps = [(number, phase, step) for number, phase in enumerate(mission.phases) for step in phase.steps]
    role = under.roles.get(mission.role.text)
    if role is None:
        context.report.add(
            codes.NOT_PERMITTED,
            mission.role.span,
            f"no rule of `{mission.policy.text}` is about the role `{mission.role.text}`",
            help=suggestion(mission.role.text, under.roles)
            or "its rules are about " + ", ".join(f"`{each}`" for each in under.roles),
            labels=[(under.declaration.name.span, "the policy is declared here")],
        )
    if not _fits(context, mission, len(steps)) or role is None:
        return None
    files = Files(context.report, names)
    files.index(mission.span.file)
    joint = Joint(under.files, files)
    tightened = Tightened(context, under, joint)
    invocations: list[Invocation] = []
    for number, phase, step in steps:
        own = () if step.overrides is None else step.overrides.clauses
        if not lacking.check_step(context, under.vehicle, own) or not _known(context, step, under):
            continue
        skill = under.skills[step.skill.text]
        contract = tightened.contract(step)
        if contract is None:
            continue
        bound = context.bound(step)
        arguments = under.contracts.cells(bound)
        plan = _plan(context, step, bound, arguments, under)
        if plan is None or not _in_phase(context, mission, phase, step, contract):
            continue
        text, file, start, end = files.place(step.span)
        invocations.append(
            Invocation(
                invocation_id=b"",
                step=len(invocations),
                phase=number,
                skill=skill,
                source=int(SourceKind[mission.source.text.upper()]),
                role=role,
                arguments=arguments,
                issued_at_us=issued_at_us,
                phases=_phases(mission, contract),
                on_inadmissible=int(OnInadmissible[step.on_inadmissible.upper()]),
                contract=contract,
                plan=plan,
                text=text,
                file=file,
                start=start,
                end=end,
                binding=b"",
            )
        )
    if len(context.report.found) > before:
        return None
    flat = Mission(
        name=mission.name.text,
        intent=mission.intent or "",
        proposer="" if mission.proposer is None else mission.proposer.text,
        vehicle=under.policy.vehicle.identity,
        policy=under.policy.name,
        policy_version=under.policy.version,
        policy_digest=b"",
        issued_at_us=issued_at_us,
        phases=tuple(phase.name.text for phase in mission.phases),
        invocations=tuple(invocations),
        sources=files.names,
        source_digests=files.digests,
    )
    return LoweredMission(flat, joint)


def _fits(context: Context, mission: MissionDecl, steps: int) -> bool:
    good = True
    for code, count, limit, what in (
        (codes.MISSION_STEPS, steps, MAX_INVOCATIONS, "steps"),
        (codes.TOO_MANY, len(mission.phases), MAX_PHASES, "phases"),
    ):
        if count > limit:
            good = False
            context.report.add(
                code,
                mission.name.span,
                f"the mission has {count} {what}, and at most {limit} fit on board",
                help="split it into several missions",
            )
    return good


def _known(context: Context, step: Step, under: LoweredPolicy) -> bool:
    """Whether the policy knows the skill and all the zones of a step."""
    policy = under.declaration
    if step.skill.text not in under.skills:
        context.report.add(
            codes.NOT_PERMITTED,
            step.skill.span,
            f"no rule of `{policy.name.text}` is about `{step.skill.text}`",
            help="its rules are about " + ", ".join(f"`{name}`" for name in under.skills),
            labels=[(policy.name.span, "the policy is declared here")],
        )
        return False
    good = True
    for bound, span in zip(context.bound(step), _spans(context, step), strict=True):
        if isinstance(bound, ZoneDecl) and bound.name.text not in under.zones.index:
            good = False
            context.report.add(
                codes.NOT_IN_POLICY,
                span,
                f"the zone `{bound.name.text}` is not one that the policy `{policy.name.text}` imports",
                help="its zones are " + ", ".join(f"`{name}`" for name in under.zones.index),
                labels=[(bound.name.span, "declared here")],
            )
    return good


def argument_span(context: Context, step: Step, parameter: str) -> Span:
    """Where the argument of a parameter is written in a step; the step itself where the default holds."""
    skill = context.symbols.skills[step.skill.text]
    for position, argument in enumerate(step.arguments):
        name = skill.parameters[position].name.text if argument.name is None else argument.name.text
        if name == parameter:
            return argument.value.span
    return step.span


def _spans(context: Context, step: Step) -> list[Span]:
    skill = context.symbols.skills[step.skill.text]
    return [argument_span(context, step, parameter.name.text) for parameter in skill.parameters]


def _in_phase(context: Context, mission: MissionDecl, phase: Phase, step: Step, contract: Contract) -> bool:
    """Whether the step stands in a phase in which its skill is valid."""
    if not contract.phases or phase.name.text in contract.phases:
        return True
    skill = context.symbols.skills[step.skill.text]
    names = [each.name.text for each in mission.phases]
    valid = ", ".join(f"`{name}`" for name in contract.phases)
    own = () if step.overrides is None else step.overrides.phases
    labels = [(name.span, "valid in this phase") for name in own or skill.phases]
    if set(contract.phases).isdisjoint(names):
        context.report.add(
            codes.UNKNOWN_PHASE,
            step.skill.span,
            f"`{contract.name}` is valid only during {valid}, and the mission has no such phase",
            help=suggestion(contract.phases[0], names) or f"put the step into a phase `{contract.phases[0]}`",
            labels=[*labels, *((each.name.span, "a phase of the mission") for each in mission.phases)],
        )
    else:
        context.report.add(
            codes.STEP_OUTSIDE_PHASES,
            step.skill.span,
            f"`{contract.name}` is valid only during {valid}, and this step is in the phase `{phase.name.text}`",
            help="move the step there",
            labels=[*labels, (phase.name.span, "the step's phase")],
        )
    return False


def _phases(mission: MissionDecl, contract: Contract) -> int:
    """The phases in which a decision on the step means something, as a bit set."""
    bits = 0
    for number, phase in enumerate(mission.phases):
        if not contract.phases or phase.name.text in contract.phases:
            bits |= 1 << number
    return bits


# ---------------------------------------------------------------- its contract


class Tightened:
    """Makes the contracts of one mission's steps; `files` are the policy's and the mission's."""

    def __init__(self, context: Context, under: LoweredPolicy, files: Files) -> None:
        self._context = context
        self._under = under
        self._trial = Trial(context, under, files)
        self._made: dict[tuple[str, Overrides], Contract | None] = {}

    def contract(self, step: Step) -> Contract | None:
        """The contract of a step; None after a finding."""
        skills = self._under.policy.contracts[self._under.skills[step.skill.text]]
        if step.overrides is None:
            return skills
        key = step.skill.text, step.overrides  # a repeated step has the same
        if key not in self._made:
            self._made[key] = self._tightened(step, step.overrides, skills)
        return self._made[key]

    def _tightened(self, step: Step, own: Overrides, skills: Contract) -> Contract | None:
        skill = self._context.symbols.skills[step.skill.text]
        place = Place(self._context.scope_of(skill), cells_of(skill), True)
        found = [
            self._clauses(own_clauses, of_skill, place, words)
            for words, own_clauses, of_skill in (
                ("require", own.require, skills.require),
                ("assume", own.assume, skills.assume),
                ("maintain", own.maintain, skills.maintain),
            )
        ]
        if None in found:
            return None
        require, assume, maintain = (clauses or () for clauses in found)
        clauses = (*require, *assume, *maintain)
        return replace(
            _timed(skills, own),
            require=require,
            assume=assume,
            maintain=maintain,
            reads=slots_read(clauses, self._under.policy.vehicle, self._under.policy.monitors),
        )

    def _clauses(
        self, own: Sequence[ClauseDecl], of_skill: tuple[Clause, ...], place: Place, words: str
    ) -> tuple[Clause, ...] | None:
        """The skill's clauses, and the step's own."""
        if own and len(own) + len(of_skill) > MAX_CLAUSES:
            self._context.report.add(
                codes.TOO_MANY,
                own[0].span.to(own[-1].span),
                f"with its skill's the step has {len(own) + len(of_skill)} `{words}` clauses, and at most "
                f"{MAX_CLAUSES} fit on board",
            )
            return None
        lowered = [self._clause(clause, place) for clause in own]
        known = [clause for clause in lowered if clause is not None]
        return None if len(known) < len(lowered) else (*of_skill, *known)

    def _clause(self, clause: ClauseDecl, place: Place) -> Clause | None:
        lowered = self._trial.clause(clause.condition, place, clause.span)
        if not isinstance(lowered, list):
            return lowered
        for unobserved in lowered:
            self._report(*unobserved)
        return None

    def _report(self, span: Span, what: str, has: str) -> None:
        policy = self._under.policy
        self._context.report.add(
            codes.NOT_OBSERVED,
            span,
            f"a clause of a step {what}: `{policy.name}` is signed as it is for all its missions",
            help=f"use what its rules and contracts use, or let one of them use this; {has}",
            labels=[(self._under.declaration.name.span, "the policy is declared here")],
        )


def _timed(skills: Contract, own: Overrides) -> Contract:
    """The contract with the step's own times, energy, phases and records."""
    return replace(
        skills,
        deadline_us=skills.deadline_us if own.deadline is None else own.deadline.value,
        validity_us=skills.validity_us if own.validity is None else own.validity.value,
        duration_us=skills.duration_us if own.duration is None else own.duration.value,
        grace_us=skills.grace_us if own.grace is None else own.grace.value,
        energy=skills.energy if own.energy is None else own.energy.value,
        phases=tuple(name.text for name in own.phases) or skills.phases,
        record=recorded((*skills.record, *(name.text for name in own.record))),
    )


# ---------------------------------------------------------------- its plan


def _plan(
    context: Context, step: Step, bound: Sequence[Bound], arguments: Sequence[int], under: LoweredPolicy
) -> Plan | None:
    """The plan of a step with its arguments (`bound`, and as cells); None after a finding."""
    skill = context.symbols.skills[step.skill.text]
    contract = under.policy.contracts[under.skills[step.skill.text]]
    motion = contract.motion
    altitude = 0 if motion.altitude < 0 else arguments[motion.altitude]
    speed = 0 if motion.speed < 0 else arguments[motion.speed]
    path: tuple[int, ...] = ()
    if motion.kind == MotionKind.HOME:
        path = (0, 0)
    elif motion.kind == MotionKind.FLY:
        cell = next(each.cell for each in contract.parameters if each.name == _target(skill))
        path = tuple(arguments[cell : cell + 2])
    elif motion.kind == MotionKind.COVER:
        covered = _covered(context, step, skill, bound, altitude, under)
        if covered is None:
            return None
        path = covered
    return Plan(kind=motion.kind, path=path, altitude=altitude, speed=speed)


def _target(skill: SkillDecl) -> str:
    assert skill.motion is not None
    assert skill.motion.target is not None
    return skill.motion.target.text


def _covered(
    context: Context, step: Step, skill: SkillDecl, bound: Sequence[Bound], altitude: int, under: LoweredPolicy
) -> tuple[int, ...] | None:
    """The survey path of a `cover` motion."""
    assert skill.motion is not None
    names = [parameter.name.text for parameter in skill.parameters]
    zone = bound[names.index(_target(skill))]
    assert isinstance(zone, ZoneDecl)
    pattern = DEFAULT_PATTERN
    if skill.motion.pattern is not None:
        at = names.index(skill.motion.pattern.text)
        ordinal = bound[at]
        assert isinstance(ordinal, int)
        pattern = skill.parameters[at].choices[ordinal].text
    region = under.zones.regions[under.zones.index[zone.name.text]]
    start = None if zone.entry is None else under.zones.place(zone.entry)
    points = survey(region.shape, pattern, altitude, under.policy.vehicle.position_error, start)
    if points is None:
        shape = region.shape
        several = len(parts(shape)) if isinstance(shape, MultiPolygon) else 1
        context.report.add(
            codes.AREA_TOO_SMALL,
            step.span,
            f"`{zone.name.text}` is in {several} parts, and a path lies in one"
            if several > 1
            else f"`{zone.name.text}` is too small or too bent for the pattern `{pattern}`",
            help="declare each part as a zone, and fly over one after the other"
            if several > 1
            else "the path keeps the vehicle's position error away from the edge; a `perimeter` needs the least room",
            labels=[(zone.name.span, "declared here")],
        )
        return None
    if len(points) > MAX_PATH:
        context.report.add(
            codes.TOO_MANY,
            step.span,
            f"the path over `{zone.name.text}` has {len(points)} points, and at most {MAX_PATH} fit on board",
            labels=[(zone.name.span, "declared here")],
        )
        return None
    return tuple(coordinate for point in points for coordinate in point)
