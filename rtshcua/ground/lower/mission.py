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
from rtshcua.ground.checker.context import Bound, CheckContext
from rtshcua.ground.checker.symbols import suggestion
from rtshcua.ground.geometry.shapes import MultiPolygon, parts
from rtshcua.ground.geometry.survey import DEFAULT_PATTERN, survey
from rtshcua.ground.lower.conditions import ConditionPlace
from rtshcua.ground.lower.contracts import cells_of, recorded
from rtshcua.ground.lower.fixed_tables import FixedTables, knows_zone
from rtshcua.ground.lower.policy import LoweredPolicy
from rtshcua.ground.lower.policy_checks import check_step_fitted
from rtshcua.ground.lower.tables import JointSourceTable, SourceTable
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import Contract, MotionKind, SourceKind
from rtshcua.model.flat.limits import MAX_CLAUSES, MAX_INVOCATIONS, MAX_PATH, MAX_PHASES
from rtshcua.model.flat.mission import Invocation, Mission, OnInadmissible, Plan
from rtshcua.model.ir.missions import MissionDecl, Overrides, Phase, Step
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.places import ZoneDecl
from rtshcua.model.ir.skills import ClauseDecl as ClauseDecl
from rtshcua.model.ir.skills import SkillDecl


class LoweredMission(NamedTuple):
    """A flat mission, and the files that its contracts' clauses refer to."""

    mission: Mission
    files: JointSourceTable


def lower_mission(
    context: CheckContext, mission: MissionDecl, under: LoweredPolicy, names: Mapping[str, str], issued_at_us: int
) -> LoweredMission | None:
    """The mission under its lowered policy, issued at a UTC time in us; None after a finding."""
    assert mission.role is not None
    before = len(context.report.found)
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
    if not _fits(context, mission) or role is None:
        return None
    files = SourceTable(context.report, names)
    files.index(mission.span.file)
    joint = JointSourceTable(under.files, files)
    invocations = StepLowering(context, mission, under, joint).invocations(files, role, issued_at_us)
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


def _fits(context: CheckContext, mission: MissionDecl) -> bool:
    good = True
    steps = sum(len(phase.steps) for phase in mission.phases)
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


def argument_span(context: CheckContext, step: Step, parameter: str) -> Span:
    """Where the argument of a parameter is written in a step; the step itself where the default holds."""
    skill = context.symbols.skills[step.skill.text]
    for position, argument in enumerate(step.arguments):
        name = skill.parameters[position].name.text if argument.name is None else argument.name.text
        if name == parameter:
            return argument.value.span
    return step.span


class StepLowering:
    """Lowers the steps of one mission; `files` are the policy's and the mission's."""

    def __init__(self, context: CheckContext, mission: MissionDecl, under: LoweredPolicy, files: SourceTable) -> None:
        self._context = context
        self._mission = mission
        self._under = under
        self._tables = FixedTables(context, under, files)
        self._contracts: dict[tuple[str, Overrides], Contract | None] = {}

    def invocations(self, files: SourceTable, role: int, issued_at_us: int) -> list[Invocation]:
        """The steps in order, with the mission's own `files`; those with a finding are left out."""
        assert self._mission.source is not None
        source = int(SourceKind[self._mission.source.text.upper()])
        found: list[Invocation] = []
        for number, phase in enumerate(self._mission.phases):
            for step in phase.steps:
                own = () if step.overrides is None else step.overrides.clauses
                if not check_step_fitted(self._context, self._under.vehicle, own) or not self._known(step):
                    continue
                contract = self._contract(step)
                plan = None if contract is None else self._plan(step)
                if contract is None or plan is None or not self._in_phase(phase, step, contract):
                    continue
                text, file, start, end = files.place(step.span)
                invocation = Invocation(
                    invocation_id=b"",
                    step=len(found),
                    phase=number,
                    skill=self._under.skills[step.skill.text],
                    source=source,
                    role=role,
                    arguments=self._under.contracts.cells(self._context.bound(step)),
                    issued_at_us=issued_at_us,
                    phases=self._phases(contract),
                    on_inadmissible=int(OnInadmissible[step.on_inadmissible.upper()]),
                    contract=contract,
                    plan=plan,
                    text=text,
                    file=file,
                    start=start,
                    end=end,
                    binding=b"",
                )
                found.append(invocation)
        return found

    def _known(self, step: Step) -> bool:
        """Whether the policy knows the skill and all the zones of a step."""
        policy = self._under.declaration
        if step.skill.text not in self._under.skills:
            self._context.report.add(
                codes.NOT_PERMITTED,
                step.skill.span,
                f"no rule of `{policy.name.text}` is about `{step.skill.text}`",
                help="its rules are about " + ", ".join(f"`{name}`" for name in self._under.skills),
                labels=[(policy.name.span, "the policy is declared here")],
            )
            return False
        skill = self._context.symbols.skills[step.skill.text]
        zones = [
            Name(span=argument_span(self._context, step, parameter.name.text), text=bound.name.text)
            for bound, parameter in zip(self._context.bound(step), skill.parameters, strict=True)
            if isinstance(bound, ZoneDecl)
        ]
        known = [knows_zone(self._context, self._under, zone) for zone in zones]  # all, so that each is reported
        return all(known)

    def _in_phase(self, phase: Phase, step: Step, contract: Contract) -> bool:
        """Whether the step stands in a phase in which its skill is valid."""
        if not contract.phases or phase.name.text in contract.phases:
            return True
        skill = self._context.symbols.skills[step.skill.text]
        names = [each.name.text for each in self._mission.phases]
        valid = ", ".join(f"`{name}`" for name in contract.phases)
        own = () if step.overrides is None else step.overrides.phases
        labels = [(name.span, "valid in this phase") for name in own or skill.phases]
        if set(contract.phases).isdisjoint(names):
            self._context.report.add(
                codes.UNKNOWN_PHASE,
                step.skill.span,
                f"`{contract.name}` is valid only during {valid}, and the mission has no such phase",
                help=suggestion(contract.phases[0], names) or f"put the step into a phase `{contract.phases[0]}`",
                labels=[*labels, *((each.name.span, "a phase of the mission") for each in self._mission.phases)],
            )
        else:
            self._context.report.add(
                codes.STEP_OUTSIDE_PHASES,
                step.skill.span,
                f"`{contract.name}` is valid only during {valid}, and this step is in the phase `{phase.name.text}`",
                help="move the step there",
                labels=[*labels, (phase.name.span, "the step's phase")],
            )
        return False

    def _phases(self, contract: Contract) -> int:
        """The phases in which a decision on the step means something, as a bit set."""
        return sum(
            1 << number
            for number, phase in enumerate(self._mission.phases)
            if not contract.phases or phase.name.text in contract.phases
        )

    # ---------------------------------------------------------------- its contract

    def _contract(self, step: Step) -> Contract | None:
        """The contract of a step, its skill's made tighter; None after a finding."""
        of_skill = self._under.policy.contracts[self._under.skills[step.skill.text]]
        if step.overrides is None:
            return of_skill
        key = step.skill.text, step.overrides  # a repeated step has the same
        if key not in self._contracts:
            self._contracts[key] = self._tightened(step, step.overrides, of_skill)
        return self._contracts[key]

    def _tightened(self, step: Step, own: Overrides, of_skill: Contract) -> Contract | None:
        skill = self._context.symbols.skills[step.skill.text]
        place = ConditionPlace(self._context.scope_of(skill), cells_of(skill), True)
        require = self._clauses(own.require, of_skill.require, place, "require")
        assume = self._clauses(own.assume, of_skill.assume, place, "assume")
        maintain = self._clauses(own.maintain, of_skill.maintain, place, "maintain")
        if require is None or assume is None or maintain is None:
            return None
        return replace(
            _timed(of_skill, own),
            require=require,
            assume=assume,
            maintain=maintain,
            reads=slots_read((*require, *assume, *maintain), self._under.policy.vehicle, self._under.policy.monitors),
        )

    def _clauses(
        self, own: Sequence[ClauseDecl], of_skill: tuple[Clause, ...], place: ConditionPlace, words: str
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

    def _clause(self, clause: ClauseDecl, place: ConditionPlace) -> Clause | None:
        lowered = self._tables.clause(clause.condition, place, clause.span)
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

    # ---------------------------------------------------------------- its plan

    def _plan(self, step: Step) -> Plan | None:
        """The plan of a step; None after a finding."""
        bound = self._context.bound(step)
        arguments = self._under.contracts.cells(bound)
        skill = self._context.symbols.skills[step.skill.text]
        contract = self._under.policy.contracts[self._under.skills[step.skill.text]]
        motion = contract.motion
        altitude = 0 if motion.altitude < 0 else arguments[motion.altitude]
        speed = 0 if motion.speed < 0 else arguments[motion.speed]
        path: tuple[int, ...] | None = ()
        if motion.kind == MotionKind.HOME:
            path = (0, 0)
        elif motion.kind == MotionKind.FLY:
            cell = next(each.cell for each in contract.parameters if each.name == _target(skill))
            path = tuple(arguments[cell : cell + 2])
        elif motion.kind == MotionKind.COVER:
            path = self._survey_path(step, skill, bound, altitude)
        return None if path is None else Plan(kind=motion.kind, path=path, altitude=altitude, speed=speed)

    def _survey_path(
        self, step: Step, skill: SkillDecl, bound: Sequence[Bound], altitude: int
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
        region = self._under.zones.regions[self._under.zones.index[zone.name.text]]
        start = None if zone.entry is None else self._under.zones.place(zone.entry)
        points = survey(region.shape, pattern, altitude, self._under.policy.vehicle.position_error, start)
        if points is None:
            shape = region.shape
            several = len(parts(shape)) if isinstance(shape, MultiPolygon) else 1
            self._context.report.add(
                codes.AREA_TOO_SMALL,
                step.span,
                f"`{zone.name.text}` is in {several} parts, and a path lies in one"
                if several > 1
                else f"`{zone.name.text}` is too small or too bent for the pattern `{pattern}`",
                help="declare each part as a zone, and fly over one after the other"
                if several > 1
                else "the path keeps the vehicle's position error away from the edge; a `perimeter` needs the least "
                "room",
                labels=[(zone.name.span, "declared here")],
            )
            return None
        if len(points) > MAX_PATH:
            self._context.report.add(
                codes.TOO_MANY,
                step.span,
                f"the path over `{zone.name.text}` has {len(points)} points, and at most {MAX_PATH} fit on board",
                labels=[(zone.name.span, "declared here")],
            )
            return None
        return tuple(coordinate for point in points for coordinate in point)


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


def _target(skill: SkillDecl) -> str:
    assert skill.motion is not None
    assert skill.motion.target is not None
    return skill.motion.target.text
