"""Describes the steps of a mission from their bound form, with all arguments, including defaults."""

from collections.abc import Iterator

from rtshcua.ground.report.prose.phrases import degrees, listed, name, named
from rtshcua.model.flat.contract import CHOICE, PLACE, ZONE, Parameter, SourceKind
from rtshcua.model.flat.mission import Invocation, OnInadmissible
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.zone import unproject
from rtshcua.model.quantity import Dimension, display

_DIMENSIONS = {dimension.value: dimension for dimension in Dimension}
_OTHERWISE = {
    OnInadmissible.ABORT: "the mission ends: its fallback flies",
    OnInadmissible.HOLD: "it is waited for",
    OnInadmissible.SKIP: "it is skipped",
    OnInadmissible.REPLAN: "it is waited for, and its proposer is asked for a replacement",
}


def describe_step(step: Invocation, policy: Policy) -> str:
    """Describe the skill of a step with all its arguments."""
    contract = step.contract
    arguments = [f"{name(each.name)} {describe_cells(each, step.arguments, policy)}" for each in contract.parameters]
    return name(contract.name) + (f" with {listed(arguments)}" if arguments else "")


def describe_otherwise(step: Invocation) -> str:
    """Describe what happens if a step may not begin."""
    return _OTHERWISE[OnInadmissible(step.on_inadmissible)]


def describe_asker(step: Invocation, policy: Policy) -> str:
    """Describe the role and the source of a step."""
    return f"for the role {name(policy.roles[step.role])} through {name(SourceKind(step.source).name.lower())}"


def describe_tighter(step: Invocation, policy: Policy) -> Iterator[str]:
    """Yield the limits of a step that tighten its skill's contract, with conditions as written."""
    own, skill = step.contract, policy.contracts[step.skill]
    for words, mine, theirs in (
        ("it begins within {} of its turn", own.deadline_us, skill.deadline_us),
        ("the request is valid for {}", own.validity_us, skill.validity_us),
        ("it lasts at most {}", own.duration_us, skill.duration_us),
        ("what must hold may be unknown for at most {}", own.grace_us, skill.grace_us),
    ):
        if mine != theirs:
            yield words.format(display(mine, Dimension.DURATION))
    if own.energy != skill.energy:
        yield f"{display(own.energy, Dimension.RATIO)} of a full charge is kept for it"
    if own.phases != skill.phases:
        yield f"only in the phase {named(own.phases, 'or')}"
    for words, clauses, known in (
        ("before it begins", own.require, skill.require),
        ("before it begins and while it runs", own.assume, skill.assume),
        ("for the whole path and while it runs", own.maintain, skill.maintain),
    ):
        texts = {clause.text for clause in known}
        yield from (f"{words}: {name(clause.text)}" for clause in clauses if clause.text not in texts)
    more = [kind for kind in own.record if kind not in skill.record]
    if more:
        yield f"recorded too: {named(more)}"


def describe_cells(parameter: Parameter, cells: tuple[int, ...], policy: Policy) -> str:
    """An argument in its bound form."""
    value = cells[parameter.cell]
    if parameter.kind == CHOICE:
        return name(parameter.labels[value])
    if parameter.kind == ZONE:
        return name(policy.zones[value].name)
    if parameter.kind == PLACE:
        latitude, longitude = unproject(policy.projection, value, cells[parameter.cell + 1])
        return f"{degrees(latitude, 'N', 'S')}, {degrees(longitude, 'E', 'W')}"
    dimension = _DIMENSIONS.get(parameter.dimension)
    return str(value) if dimension is None else display(value, dimension)
