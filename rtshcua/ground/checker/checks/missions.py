"""E0701, E0709, E0711, E0712: a mission names a policy, a vehicle and skills that exist, and who proposes it."""

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.arguments import bind_arguments
from rtshcua.ground.checker.checks.overrides import check_overrides
from rtshcua.ground.checker.context import Context
from rtshcua.ground.checker.fields import one_of, quantity
from rtshcua.ground.checker.lookup import find_policy, find_skill, find_vehicle
from rtshcua.model.ir.missions import MissionDecl, Step
from rtshcua.model.quantity import Dimension

#: who may propose a mission; the other sources decide on board
PROPOSERS = ("agent", "operator")


def check_missions(context: Context) -> None:
    """Report every mission whose parts do not exist."""
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


def _header(context: Context, mission: MissionDecl) -> None:
    policy = find_policy(context, mission.policy)
    find_vehicle(context, mission.vehicle)
    if policy is not None and policy.version != mission.policy_version:
        context.report.add(
            codes.POLICY_VERSION,
            mission.policy.span,
            f"`{policy.name.text}` has version {policy.version}, and the mission is under version "
            f"{mission.policy_version}",
            help=f"write `{policy.name.text}@{policy.version}`, if the mission fits the newer policy",
            labels=[(policy.name.span, "the policy is declared here")],
        )
    quantity(context, mission.most_time, Dimension.DURATION)
    quantity(context, mission.most_energy, Dimension.RATIO)
    if mission.source is None or mission.role is None:
        context.report.add(
            codes.NO_PROPOSER,
            mission.name.span,
            f"the mission `{mission.name.text}` does not say who proposes it and for which role",
            help="add `proposed by agent NAME for role operator`, or `proposed by operator NAME for role operator`",
        )
    if mission.source is not None:
        one_of(context, codes.UNKNOWN_SOURCE, mission.source, PROPOSERS, "source of missions")


def _step(context: Context, step: Step) -> None:
    skill = find_skill(context, step.skill)
    if skill is not None:
        bound = bind_arguments(context, skill, step.arguments, step.span)
        if bound is not None:
            context.bind(step, bound)
        if step.overrides is not None:
            check_overrides(context, skill, step.overrides)
