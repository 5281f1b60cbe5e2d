"""A mission to the flat form: one contract-bound invocation a step, still without its id and its binding."""

from collections.abc import Mapping
from typing import NamedTuple

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.context import Context
from rtshcua.ground.checker.symbols import suggestion
from rtshcua.ground.compiler import lacking
from rtshcua.ground.compiler.files import Files, Joint
from rtshcua.ground.compiler.plan import plan_of
from rtshcua.ground.compiler.policy import LoweredPolicy
from rtshcua.ground.compiler.tightened import Tightened
from rtshcua.model.flat.contract import Contract, SourceKind
from rtshcua.model.flat.limits import MAX_INVOCATIONS, MAX_PHASES
from rtshcua.model.flat.mission import Invocation, Mission, OnInadmissible
from rtshcua.model.ir.missions import MissionDecl, Phase, Step
from rtshcua.model.ir.places import ZoneDecl


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
        plan = plan_of(context, step, bound, arguments, under)
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
