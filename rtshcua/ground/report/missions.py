"""The missions under a policy: their steps, their ways, and what they take at most."""

from collections.abc import Iterator, Mapping

from rtshcua.ground.prove.mission_bounds import Bounds, rounded_energy, rounded_time
from rtshcua.ground.report.model import Fact, MissionTold, StepTold
from rtshcua.ground.report.words.missions import told_asker, told_otherwise, told_step, told_tighter
from rtshcua.model.flat.mission import Invocation, Mission
from rtshcua.model.flat.policy import Policy


def mission_told(mission: Mission, policy: Policy, bounds: Bounds | None, values: Mapping[str, str]) -> MissionTold:
    """A mission; `values` are those of its parameters that its way is drawn for."""
    first = mission.invocations[0]
    by = f"Proposed by {mission.proposer or 'a person'}, {told_asker(first, policy)}."
    drawn = ", ".join(f"`{name}` = {value}" for name, value in values.items())
    return MissionTold(
        name=mission.name,
        intent=mission.intent,
        proposed=by,
        bounds=() if bounds is None else tuple(_bounds(bounds)),
        values=drawn,
        steps=tuple(_step(step, mission, policy) for step in mission.invocations),
    )


def _bounds(bounds: Bounds) -> Iterator[Fact]:
    yield Fact("Steps", f"at most {bounds.invocations}")
    yield Fact("Time", f"at most {rounded_time(bounds.time_us)} from issue to end")
    yield Fact("Charge", f"at most {rounded_energy(bounds.energy)} of a full one, as a sum of all that it may take")


def _step(step: Invocation, mission: Mission, policy: Policy) -> StepTold:
    path = step.plan.path
    return StepTold(
        number=step.step + 1,
        phase=mission.phases[step.phase],
        told=told_step(step, policy),
        otherwise=told_otherwise(step),
        tighter=tuple(told_tighter(step, policy)),
        path=tuple(zip(path[::2], path[1::2], strict=True)),
        altitude=step.plan.altitude,
    )
