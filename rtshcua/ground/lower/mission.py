"""Lower a mission to the flat form: one invocation with a contract for each step, without its id and its binding.

The contract of a step is that of its skill, tightened by the step's own block. The policy is signed once for all its
missions, so a mission cannot add to its tables: the step's own clauses may only read signals that the policy reads, and
use its zones, sets and monitors (E0622). The plan of a step is its path, altitude and speed.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from msgspec.structs import replace

from rtshcua.decision.contracts import first_cell
from rtshcua.decision.tree import slots_read
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.context import Bound, CheckContext
from rtshcua.ground.checker.symbols import suggestion
from rtshcua.ground.geometry.levels import LEAST_STEP, heights_between, levelled
from rtshcua.ground.geometry.polygons import Point
from rtshcua.ground.geometry.shapes import MultiPolygon, parts
from rtshcua.ground.lower.conditions import ConditionPlace
from rtshcua.ground.lower.contracts import cells_of, recorded
from rtshcua.ground.lower.fixed_tables import FixedTables, knows_zone
from rtshcua.ground.lower.policy import LoweredPolicy
from rtshcua.ground.lower.policy_checks import check_step_fitted
from rtshcua.ground.lower.survey_plan import SurveyPlan, survey_plan
from rtshcua.ground.lower.tables import JointSourceTable, SourceTable
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import PLACE, Contract, Facing, MotionKind, SourceKind
from rtshcua.model.flat.limits import MAX_CLAUSES, MAX_INVOCATIONS, MAX_PATH, MAX_PHASES
from rtshcua.model.flat.mission import Invocation, Mission, OnInadmissible, Plan
from rtshcua.model.ir.missions import MissionDecl, Overrides, Phase, Step
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.places import ZoneDecl
from rtshcua.model.ir.skills import ClauseDecl as ClauseDecl
from rtshcua.model.ir.skills import SkillDecl
from rtshcua.model.quantity import Dimension, display

#: what an area needs for a pattern
_NEEDED = {
    "corridor": "declare the zone as in `corridor(a, b, c, width 40 m)`, or use a `grid`",
    "face": "declare the zone along the face, as in `corridor(a, b, width 60 m)`: the path is left of `a` to `b`",
    "around": "leave the structure out of the zone, as in `difference(circle(a, 60 m), circle(a, 8 m))`",
}
_EDGE = "the path stays the vehicle's position error away from the edge"
#: what to do if an area has too little room for a pattern
_ROOM = dict.fromkeys(("grid", "perimeter", "orbit"), f"use a `perimeter`, which needs the least room; {_EDGE}") | {
    "corridor": f"declare a wider corridor; {_EDGE}",
    "face": f"declare a wider corridor, or fly nearer to the face; {_EDGE}",
    "around": f"declare a larger zone around the structure, or fly nearer to it; {_EDGE}",
}


class LoweredMission(NamedTuple):
    """A flat mission, and the files to which the clauses of its contracts refer."""

    mission: Mission
    files: JointSourceTable


def lower_mission(
    context: CheckContext, mission: MissionDecl, under: LoweredPolicy, names: Mapping[str, str], issued_at_us: int
) -> LoweredMission | None:
    """Lower a mission under its lowered policy, issued at a UTC time in us. Returns None after a finding."""
    assert mission.role is not None
    before = len(context.report.found)
    role = under.roles.get(mission.role.text)
    if role is None:
        context.report.add(
            codes.NOT_PERMITTED,
            mission.role.span,
            f"no rule of `{mission.policy.text}` names the role `{mission.role.text}`",
            help=suggestion(mission.role.text, under.roles)
            or "its roles are " + ", ".join(f"`{each}`" for each in under.roles),
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
    for code, count, limit, kind in (
        (codes.MISSION_STEPS, steps, MAX_INVOCATIONS, "steps"),
        (codes.TOO_MANY, len(mission.phases), MAX_PHASES, "phases"),
    ):
        if count > limit:
            good = False
            context.report.add(
                code,
                mission.name.span,
                f"the mission has {count} {kind}, but at most {limit} fit on board",
                help="split it into several missions",
            )
    return good


def argument_span(context: CheckContext, step: Step, parameter: str) -> Span:
    """Return the span of the argument for a parameter in a step, or the span of the step if the default applies."""
    skill = context.symbols.skills[step.skill.text]
    for position, argument in enumerate(step.arguments):
        name = skill.parameters[position].name.text if argument.name is None else argument.name.text
        if name == parameter:
            return argument.value.span
    return step.span


def straight_plan(contract: Contract, arguments: Sequence[int]) -> Plan:
    """Return the plan of a step with these argument cells; that of a `cover` motion is without its survey path."""
    motion = contract.motion
    path: tuple[int, ...] = ()
    if motion.kind == MotionKind.HOME:
        path = (0, 0)
    elif motion.kind == MotionKind.FLY:
        cell = first_cell(contract, PLACE)
        path = tuple(arguments[cell : cell + 2])
    return Plan(
        kind=motion.kind,
        path=path,
        altitude=0 if motion.altitude < 0 else arguments[motion.altitude],
        speed=0 if motion.speed < 0 else arguments[motion.speed],
    )


class StepLowering:
    """Lowers the steps of one mission. `files` are those of the policy and of the mission."""

    def __init__(self, context: CheckContext, mission: MissionDecl, under: LoweredPolicy, files: SourceTable) -> None:
        self._context = context
        self._mission = mission
        self._under = under
        self._tables = FixedTables(context, under, files)
        self._contracts: dict[tuple[str, Overrides], Contract | None] = {}

    def invocations(self, files: SourceTable, role: int, issued_at_us: int) -> list[Invocation]:
        """Return the steps in order, without those that have a finding. `files` are the mission's own."""
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
        """Whether the policy has the skill and all the zones of a step. Reports those that are missing."""
        policy = self._under.declaration
        if step.skill.text not in self._under.skills:
            self._context.report.add(
                codes.NOT_PERMITTED,
                step.skill.span,
                f"no rule of `{policy.name.text}` names the skill `{step.skill.text}`",
                help="its skills are " + ", ".join(f"`{name}`" for name in self._under.skills),
                labels=[(policy.name.span, "the policy is declared here")],
            )
            return False
        skill = self._context.symbols.skills[step.skill.text]
        zones = [
            Name(span=argument_span(self._context, step, parameter.name.text), text=bound.name.text)
            for bound, parameter in zip(self._context.bound(step), skill.parameters, strict=True)
            if isinstance(bound, ZoneDecl)
        ]
        known = [knows_zone(self._context, self._under, zone) for zone in zones]  # a list, to report every zone
        return all(known)

    def _in_phase(self, phase: Phase, step: Step, contract: Contract) -> bool:
        """Whether the step is in a phase for which its skill is valid. Reports it otherwise."""
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
                f"`{contract.name}` is valid only during {valid}, but the mission has no such phase",
                help=suggestion(contract.phases[0], names) or f"put the step into a phase `{contract.phases[0]}`",
                labels=[*labels, *((each.name.span, "a phase of the mission") for each in self._mission.phases)],
            )
        else:
            self._context.report.add(
                codes.STEP_OUTSIDE_PHASES,
                step.skill.span,
                f"`{contract.name}` is valid only during {valid}, but this step is in the phase `{phase.name.text}`",
                help=f"move the step to {valid}",
                labels=[*labels, (phase.name.span, "the step's phase")],
            )
        return False

    def _phases(self, contract: Contract) -> int:
        """Return the phases in which the step is valid, as a bit set."""
        return sum(
            1 << number
            for number, phase in enumerate(self._mission.phases)
            if not contract.phases or phase.name.text in contract.phases
        )

    # ---------------------------------------------------------------- its contract

    def _contract(self, step: Step) -> Contract | None:
        """Return the contract of a step, tightened by its own block; None after a finding."""
        of_skill = self._under.policy.contracts[self._under.skills[step.skill.text]]
        if step.overrides is None:
            return of_skill
        key = step.skill.text, step.overrides  # repetitions of a step share a contract
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
        self, own: Sequence[ClauseDecl], of_skill: tuple[Clause, ...], place: ConditionPlace, kind: str
    ) -> tuple[Clause, ...] | None:
        """Return the skill's clauses and the step's own; None after a finding."""
        if own and len(own) + len(of_skill) > MAX_CLAUSES:
            self._context.report.add(
                codes.TOO_MANY,
                own[0].span.to(own[-1].span),
                f"the step has {len(own) + len(of_skill)} `{kind}` clauses, including those of its skill, but at most "
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

    def _report(self, span: Span, need: str, available: str) -> None:
        policy = self._under.policy
        self._context.report.add(
            codes.NOT_OBSERVED,
            span,
            f"this clause of a step {need}, and a mission cannot add to the signed policy `{policy.name}`",
            help=f"use what the policy's rules and contracts use, or add this to one of them; {available}",
            labels=[(self._under.declaration.name.span, "the policy is declared here")],
        )

    # ---------------------------------------------------------------- its plan

    def _plan(self, step: Step) -> Plan | None:
        """Return the plan of a step, or None after a finding."""
        bound = self._context.bound(step)
        arguments = self._under.contracts.cells(bound)
        skill = self._context.symbols.skills[step.skill.text]
        contract = self._under.policy.contracts[self._under.skills[step.skill.text]]
        plan = straight_plan(contract, arguments)
        if plan.kind != MotionKind.COVER:
            return plan
        lowest = self._lowest(skill, bound, plan.altitude)
        survey = survey_plan(skill, bound, lowest, self._under.zones, self._under.vehicle)
        heights = self._heights(step, skill, bound, plan.altitude, survey)
        if heights is None:
            return None
        points = self._survey_path(step, survey)
        if points is None:
            return None
        path = levelled(points, heights, survey.facing(points) if contract.motion.facing == Facing.INWARD else ())
        if len(path.points) > MAX_PATH:
            assert skill.motion is not None
            assert skill.motion.target is not None
            zone = argument_span(self._context, step, skill.motion.target.text)
            self._context.report.add(
                codes.TOO_MANY,
                step.span,
                f"its path has {len(path.points)} points, but at most {MAX_PATH} fit on board",
                labels=[(zone, "the area")],
            )
            return None
        flat = tuple(coordinate for point in path.points for coordinate in point)
        return replace(plan, path=flat, heights=path.heights, headings=path.headings)

    @staticmethod
    def _lowest(skill: SkillDecl, bound: Sequence[Bound], altitude: int) -> int:
        """Return the lowest height of a `cover` motion."""
        assert skill.motion is not None
        if skill.motion.lowest is None:
            return altitude
        lowest = bound[[parameter.name.text for parameter in skill.parameters].index(skill.motion.lowest.text)]
        assert isinstance(lowest, int)
        return lowest

    def _heights(
        self, step: Step, skill: SkillDecl, bound: Sequence[Bound], altitude: int, survey: SurveyPlan
    ) -> tuple[int, ...] | None:
        """Return the heights of a `cover` motion at several heights, or None after a finding; empty for one at its
        altitude. They are as far apart as the motion says, or else as the overlap of the pictures of a face allows.
        """
        assert skill.motion is not None
        if skill.motion.lowest is None:
            return ()
        names = [parameter.name.text for parameter in skill.parameters]
        lowest = survey.height
        every = survey.levels_apart if skill.motion.every is None else bound[names.index(skill.motion.every.text)]
        assert every is None or isinstance(every, int)
        if lowest > altitude:
            what = f"the lowest height, {display(lowest, Dimension.LENGTH)}, is above the highest"
            at = skill.motion.lowest
        elif every is not None and every < LEAST_STEP:
            at, least = skill.motion.every or skill.motion.lowest, display(LEAST_STEP, Dimension.LENGTH)
            what = f"its heights are {display(every, Dimension.LENGTH)} apart; the least distance is {least}"
        else:
            same = lowest == altitude
            return () if same else heights_between(lowest, altitude, every or altitude - lowest)
        self._context.report.add(codes.BAD_LEVELS, argument_span(self._context, step, at.text), what)
        return None

    def _survey_path(self, step: Step, plan: SurveyPlan) -> tuple[Point, ...] | None:
        """Return the survey path of a `cover` motion at one height, or None after a finding."""
        zone, shape, pattern = plan.zone, plan.shape, plan.pattern
        if plan.missing:
            self._context.report.add(
                codes.PATTERN_AREA,
                step.span,
                f"`{zone.name.text}` {plan.missing}",
                help=_NEEDED[pattern],
                labels=[(zone.name.span, "declared here")],
            )
            return None
        points = plan.path(self._under.policy.vehicle.position_error)
        if points is None:
            several = len(parts(shape)) if isinstance(shape, MultiPolygon) else 1
            self._context.report.add(
                codes.AREA_TOO_SMALL,
                step.span,
                f"`{zone.name.text}` has {several} parts, but a survey path covers only one"
                if several > 1
                else f"`{zone.name.text}` is too small or too curved for the pattern `{pattern}`",
                help="declare each part as a zone, and survey one after the other" if several > 1 else _ROOM[pattern],
                labels=[(zone.name.span, "declared here")],
            )
            return None
        return points


def _timed(skills: Contract, own: Overrides) -> Contract:
    """Return a contract with the step's own times, energy, phases and records."""
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
