"""Check missions: their policy, vehicle and skills exist, and overrides only tighten contracts."""

from rtshcua.decision.durability import recorded_as
from rtshcua.diagnostics import codes
from rtshcua.ground.checker.arguments import bind_arguments
from rtshcua.ground.checker.checks.contracts import RECORDS, durability, more_than_full
from rtshcua.ground.checker.conditions import check_condition
from rtshcua.ground.checker.context import CheckContext
from rtshcua.ground.checker.fields import one_of, quantity
from rtshcua.ground.checker.lookup import find_policy, find_skill, find_vehicle
from rtshcua.model.durability import WORDS
from rtshcua.model.ir.expression import Quantity
from rtshcua.model.ir.missions import MissionDecl, Overrides, Step
from rtshcua.model.ir.skills import SkillDecl
from rtshcua.model.quantity import Dimension, display

#: sources that may propose a mission; the others decide on board
PROPOSERS = ("agent", "operator")


def check_missions(context: CheckContext) -> None:
    """Report every mission with unknown parts."""
    for mission in context.symbols.missions.values():
        _header(context, mission)
        if not any(phase.items for phase in mission.phases):
            context.report.add(
                codes.EMPTY_MISSION,
                mission.name.span,
                f"the mission `{mission.name.text}` has no step",
                help="add a phase with a step, as in `phase recovery { return_home() }`",
            )
    for mission in context.missions():
        for phase in mission.phases:
            for step in phase.steps:
                _step(context, step)


def _header(context: CheckContext, mission: MissionDecl) -> None:
    policy = find_policy(context, mission.policy)
    find_vehicle(context, mission.vehicle)
    if policy is not None and policy.version != mission.policy_version:
        context.report.add(
            codes.POLICY_VERSION,
            mission.policy.span,
            f"the mission names version {mission.policy_version} of `{policy.name.text}`, which has version "
            f"{policy.version}",
            help=f"write `{policy.name.text}@{policy.version}` if the mission fits that version",
            labels=[(policy.name.span, "the policy is declared here")],
        )
    quantity(context, mission.most_time, Dimension.DURATION)
    quantity(context, mission.most_energy, Dimension.RATIO)
    if mission.source is None or mission.role is None:
        context.report.add(
            codes.NO_PROPOSER,
            mission.name.span,
            f"the mission `{mission.name.text}` lacks `proposed by`",
            help="add `proposed by agent NAME for role operator`, or `proposed by operator NAME for role operator`",
        )
    if mission.source is not None:
        one_of(context, codes.UNKNOWN_SOURCE, mission.source, PROPOSERS, "source of missions")


def _step(context: CheckContext, step: Step) -> None:
    skill = find_skill(context, step.skill)
    if skill is not None:
        bound = bind_arguments(context, skill, step.arguments, step.span)
        if bound is not None:
            context.bind(step, bound)
        if step.overrides is not None:
            check_overrides(context, skill, step.overrides)


#: the default grace: how long a clause may be unknown (us)
DEFAULT_GRACE_US = 500_000


def check_overrides(context: CheckContext, skill: SkillDecl, overrides: Overrides) -> None:
    """Report invalid overrides of a step of `skill`."""
    for field in (overrides.deadline, overrides.validity, overrides.duration):
        quantity(context, field, Dimension.DURATION)
    quantity(context, overrides.grace, Dimension.DURATION, positive=False)
    quantity(context, overrides.energy, Dimension.RATIO, positive=False)
    more_than_full(context, overrides.energy, "step")
    _shorter(context, skill, overrides)
    _phases(context, skill, overrides)
    for name in overrides.record:
        one_of(context, codes.UNKNOWN_RECORD, name, RECORDS, "kind of evidence")
    _durable(context, skill, overrides)
    scope = context.scope_of(skill)
    for clause in overrides.clauses:
        check_condition(scope, clause.condition)


def _shorter(context: CheckContext, skill: SkillDecl, overrides: Overrides) -> None:
    """Report times above those of the skill, and an energy below it."""
    for words, mine, skills, most in (
        ("deadline", overrides.deadline, skill.deadline, None),
        ("valid for", overrides.validity, skill.validity, None),
        ("lasts at most", overrides.duration, skill.duration, None),
        ("grace", overrides.grace, skill.grace, DEFAULT_GRACE_US),
    ):
        limit = skills.value if skills is not None else most
        if mine is not None and limit is not None and mine.value > limit:
            _looser(context, skill, words, mine, skills, display(limit, Dimension.DURATION), "at most")
    energy, kept = overrides.energy, skill.energy
    if energy is not None and kept is not None and energy.value < kept.value:
        _looser(context, skill, "energy at most", energy, kept, display(kept.value, Dimension.RATIO), "at least")


def _looser(
    context: CheckContext, skill: SkillDecl, words: str, mine: Quantity, skills: Quantity | None, limit: str, side: str
) -> None:
    at = (skill.name.span, f"`{skill.name.text}` is declared here; the default is {limit}")
    context.report.add(
        codes.NOT_TIGHTER,
        mine.span,
        f"`{words} {context.report.text(mine.span)}` is looser than `{limit}` of the contract of `{skill.name.text}`",
        help=f"a step may only tighten the contract: write {side} `{limit}`, or remove it",
        labels=[at if skills is None else (skills.span, "the skill's own")],
        fix=(mine.span, limit, f"write `{limit}`"),
    )


def _durable(context: CheckContext, skill: SkillDecl, overrides: Overrides) -> None:
    """Report records that are less durable than those of the skill."""
    mine = durability(context, overrides.record)
    least = recorded_as(tuple(name.text for name in skill.record))
    if mine is None or WORDS.index(mine.text) >= least:
        return
    skills = next((name for name in skill.record if name.text == WORDS[least]), skill.name)
    label = "the skill's own" if skills is not skill.name else f"declared here; the default is `{WORDS[least]}`"
    context.report.add(
        codes.NOT_TIGHTER,
        mine.span,
        f"`{mine.text}` is less durable than the records of `{skill.name.text}`, which are `{WORDS[least]}`",
        help=f"a step may only tighten the contract: write `{WORDS[least]}` or a more durable word, or remove it",
        labels=[(skills.span, label)],
        fix=(mine.span, WORDS[least], f"write `{WORDS[least]}`"),
    )


def _phases(context: CheckContext, skill: SkillDecl, overrides: Overrides) -> None:
    """Report phases in which the skill is not valid."""
    valid = {name.text for name in skill.phases}
    for name in overrides.phases:
        if valid and name.text not in valid:
            words = ", ".join(f"`{phase.text}`" for phase in skill.phases)
            context.report.add(
                codes.NOT_TIGHTER,
                name.span,
                f"the step is valid during `{name.text}`, but `{skill.name.text}` only during {words}",
                help="a step may only tighten the contract: remove the phase",
                labels=[(phase.span, "the skill's own") for phase in skill.phases],
            )
