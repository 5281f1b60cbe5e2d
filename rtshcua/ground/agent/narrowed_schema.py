"""The JSON Schema of the missions that an agent may propose under one policy.

It has the skills that a permit allows an agent, with the ranges and zones that some permit allows, and the names of the
policy, its vehicle and its roles. It accepts every mission that the policy permits, and some more: only the compiler
checks conditions on the state, paths, times and charge.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from rtshcua.ground.agent.specification_schema import DRAFT, FORMAT, RESERVED, VERSION, OverridesShape
from rtshcua.ground.agent.value_patterns import (
    COORDINATES,
    DURATION,
    SHARE,
    name_but,
    quantities,
    unit_of,
    whole,
    written,
)
from rtshcua.ground.checker.checks.contracts import RECORDS
from rtshcua.ground.lower.policy import LoweredPolicy
from rtshcua.model.flat.contract import CHOICE, PLACE, QUANTITY, ZONE, Contract, MotionKind, Parameter, SourceKind
from rtshcua.model.flat.policy import Rule, RuleKind
from rtshcua.model.ir.expression import Comparison, Condition, Inside, Junction, Quantity, Reference, Value, Within
from rtshcua.model.ir.program import Unit
from rtshcua.model.quantity import Dimension, display

AGENT = int(SourceKind.AGENT)
_MIRRORED = {"<": ">", "<=": ">=", ">": "<", ">=": "<="}


@dataclass(frozen=True, slots=True)
class PermittedArgument:
    """A parameter with its permitted range, or the names of its permitted zones, places or choices."""

    parameter: Parameter
    low: int = 0
    high: int = 0
    names: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class PermittedSkill:
    """A skill that an agent may request, in one of these roles."""

    contract: Contract
    roles: tuple[str, ...]
    allowed: tuple[PermittedArgument, ...]


def permitted_skills(lowered: LoweredPolicy, entries: Sequence[str]) -> tuple[PermittedSkill, ...]:
    """Return the skills that some permit allows an agent and that no rule always forbids; `entries` are the named
    places.
    """
    policy = lowered.policy
    found = []
    for number, contract in enumerate(policy.contracts):
        rules = [rule for rule in policy.rules if _about(rule, number)]
        permits = [rule for rule in rules if rule.kind == RuleKind.PERMIT]
        if not permits or any(_always_forbids(rule) for rule in rules):
            continue
        roles = {policy.roles[role] for rule in permits for role in rule.roles or range(len(policy.roles))}
        conditions = [lowered.written[rule].when for rule in permits]
        allowed = tuple(_allowed(lowered, parameter, conditions, entries) for parameter in contract.parameters)
        found.append(PermittedSkill(contract, tuple(sorted(roles)), allowed))
    return tuple(found)


def _about(rule: Rule, skill: int) -> bool:
    return (not rule.skills or skill in rule.skills) and (not rule.sources or AGENT in rule.sources)


def _always_forbids(rule: Rule) -> bool:
    return rule.kind == RuleKind.FORBID and rule.when is None and not rule.roles


def _allowed(
    lowered: LoweredPolicy, parameter: Parameter, conditions: Sequence[Condition | None], entries: Sequence[str]
) -> PermittedArgument:
    """Return the values of a parameter that at least one of the permits allows."""
    policy = lowered.policy
    match parameter.kind:
        case kind if kind == CHOICE:
            return PermittedArgument(parameter, names=parameter.labels[parameter.low : parameter.high + 1])
        case kind if kind == ZONE:
            every = [zone.name for zone in policy.zones[parameter.low : parameter.high + 1]]
            left = [_zones(lowered, parameter.name, each) for each in conditions]
            kept = [name for name in every if any(some is None or name in some for some in left)]
            return PermittedArgument(parameter, names=tuple(kept))
        case kind if kind == PLACE:
            return PermittedArgument(parameter, names=tuple(entries))
    ranges = [_range(parameter, each) for each in conditions]
    some = [(low, high) for low, high in ranges if low <= high] or [(parameter.low, parameter.high)]
    return PermittedArgument(parameter, min(low for low, _ in some), max(high for _, high in some))


def _range(parameter: Parameter, condition: Condition | None) -> tuple[int, int]:
    """Return the range, both ends included, in which the condition's comparisons with quantities hold."""
    low, high = parameter.low, parameter.high
    if parameter.kind != QUANTITY:
        return low, high
    for operator, bound in _bounds(parameter.name, condition):
        if operator in ("<", "<=", "=="):
            high = min(high, bound - (operator == "<"))
        if operator in (">", ">=", "=="):
            low = max(low, bound + (operator == ">"))
    return low, high


def _bounds(name: str, condition: Condition | None) -> Iterator[tuple[str, int]]:
    """Yield the comparisons of a parameter with quantities, with the parameter on the left."""
    for each in _conjuncts(condition):
        if isinstance(each, Comparison):
            if _is(each.left, name) and isinstance(each.right, Quantity):
                yield each.operator, each.right.value
            elif _is(each.right, name) and isinstance(each.left, Quantity):
                yield _MIRRORED.get(each.operator, each.operator), each.left.value
        elif isinstance(each, Within) and _is(each.subject, name):
            if isinstance(each.range.low, Quantity):
                yield ">=", each.range.low.value
            if isinstance(each.range.high, Quantity):
                yield "<=", each.range.high.value


def _is(value: Value, name: str) -> bool:
    return isinstance(value, Reference) and value.name == name


def _zones(lowered: LoweredPolicy, name: str, condition: Condition | None) -> frozenset[str] | None:
    """Return the zones that a condition allows for the parameter; None if it does not limit them."""
    left: frozenset[str] | None = None
    for each in _conjuncts(condition):
        found = _within(lowered, name, each)
        if found is not None:
            left = found if left is None else left & found
    return left


def _within(lowered: LoweredPolicy, name: str, condition: Condition) -> frozenset[str] | None:
    if isinstance(condition, Junction) and condition.operator == "or":
        parts = [_within(lowered, name, each) for each in condition.operands]
        known = [part for part in parts if part is not None]
        return frozenset().union(*known) if len(known) == len(parts) else None
    if not isinstance(condition, Inside) or condition.negated or not isinstance(condition.region, Reference):
        return None
    if not isinstance(condition.subject, Reference) or condition.subject.name != name:
        return None
    if condition.region.name not in lowered.zones.index:
        return None
    inside = lowered.zones.within(condition.region.name, 0, smaller=False, span=condition.span)
    return frozenset(lowered.policy.zones[number].name for number in inside)


def _conjuncts(condition: Condition | None) -> Iterator[Condition]:
    if isinstance(condition, Junction) and condition.operator == "and":
        for each in condition.operands:
            yield from _conjuncts(each)
    elif condition is not None:
        yield condition


_DIMENSIONS = {dimension.value: dimension for dimension in Dimension}
_MOTIONS = {
    MotionKind.HOLD: "Stay in place.",
    MotionKind.CLIMB: "Climb straight up to the altitude.",
    MotionKind.FLY: "Fly to a place.",
    MotionKind.COVER: "Fly a survey path over a zone.",
    MotionKind.HOME: "Fly home and land there.",
    MotionKind.LAND: "Land here.",
}

Schema = dict[str, Any]


def narrowed(lowered: LoweredPolicy, units: Sequence[Unit], path: str | None) -> Schema:
    """Return the schema under a policy.

    `path` is the policy's source, if it is one of the shipped library. `units` are those of its program: they say which
    zones have an entry and which parameters have a default.
    """
    policy = lowered.policy
    known = {zone.name for zone in policy.zones[: policy.declared]}
    zones = [zone for unit in units for zone in unit.zones if zone.name.text in known]
    skills = permitted_skills(lowered, [f"{zone.name.text}.entry" for zone in zones if zone.entry is not None])
    defaults = _with_defaults(units)
    roles = sorted({role for skill in skills for role in skill.roles})
    name = {"type": "string", "pattern": name_but(RESERVED), "maxLength": 200}
    imports: Schema = {"type": "array", "items": {"type": "string", "enum": [path]}, "maxItems": 1} if path else {
        "type": "array", "items": {"type": "string"}, "maxItems": 0,
    }  # fmt: skip
    version = {"type": "integer", "const": policy.version}
    return {
        "$schema": DRAFT,
        "$id": f"urn:{FORMAT.replace('/', ':')}:{VERSION}:{policy.name}:{policy.version}",
        "title": f"Missions under the policy {policy.name}, version {policy.version}",
        "description": (
            f"A mission that an agent proposes under {policy.name}@{policy.version}. "
            "A mission that fits this schema may still be rejected: the compiler checks it in full."
        ),
        "$defs": {skill.contract.name: _step(skill, defaults) for skill in skills},
        **_object(
            {
                "format": _const(FORMAT),
                "version": {"type": "integer", "const": VERSION},
                "name": name | {"description": "The name of the mission."},
                "imports": imports,
                "policy": _object({"name": _const(policy.name), "version": version}),
                "vehicle": _const(policy.vehicle.name),
                "intent": {
                    "type": "string",
                    "maxLength": 1000,
                    "description": "The purpose of the mission, in one sentence, without invisible characters.",
                },
                "proposed_by": _object(
                    {"source": _const("agent"), "name": name, "role": {"type": "string", "enum": roles}}
                ),
                "phases": {
                    "type": "array",
                    "items": _object(
                        {
                            "name": name | {"description": _phases(skills)},
                            "steps": {
                                "type": "array",
                                "items": {"anyOf": [{"$ref": f"#/$defs/{each.contract.name}"} for each in skills]},
                            },
                        }
                    ),
                },
            },
            optional=("imports", "intent"),
        ),
    }


def _with_defaults(units: Sequence[Unit]) -> frozenset[tuple[str, str]]:
    """The pairs of skill and parameter that have a default."""
    skills = [skill for unit in units for skill in unit.skills]
    return frozenset(
        (skill.name.text, parameter.name.text)
        for skill in skills
        for parameter in skill.parameters
        if parameter.default is not None
    )


def _phases(skills: Sequence[PermittedSkill]) -> str:
    bound = [f"{each.contract.name} in {' or '.join(each.contract.phases)}" for each in skills if each.contract.phases]
    limits = f" Some skills are permitted in some phases only: {'; '.join(bound)}." if bound else ""
    return f"The name of the phase.{limits}"


def _step(skill: PermittedSkill, defaults: frozenset[tuple[str, str]]) -> Schema:
    """The schema of a step that requests a skill."""
    contract = skill.contract
    arguments = {each.parameter.name: _argument(each) for each in skill.allowed}
    optional = [name for name in arguments if (contract.name, name) in defaults]
    step = _object(
        {
            "skill": _const(contract.name),
            "arguments": _object(arguments, optional=optional),
            "on_inadmissible": {"type": "string", "enum": ["abort", "hold", "skip", "replan"]},
            "overrides": _overrides(),
        },
        optional=("on_inadmissible", "overrides", *(() if len(optional) < len(arguments) else ("arguments",))),
    )
    return step | {"description": _described(contract)}


def _overrides() -> Schema:
    """The schema of a step's overrides. The compiler checks that they are tighter, and their conditions."""
    duration = {"type": "string", "pattern": DURATION}
    names = {"type": "array", "items": {"type": "string", "pattern": name_but(RESERVED)}}
    kinds = {"type": "array", "items": {"type": "string", "enum": list(RECORDS)}}
    own: Schema = {
        name: field | {"description": field.get("description", "")}
        for name, field in OverridesShape.model_json_schema()["properties"].items()
        if name in ("require", "assume", "maintain")
    }
    times = ("deadline", "valid_for", "lasts_at_most", "grace")
    energy = {"type": "string", "pattern": SHARE}
    fields = dict.fromkeys(times, duration) | own | {"energy_at_most": energy, "during": names, "record": kinds}
    return _object(fields, optional=tuple(fields))


def _described(contract: Contract) -> str:
    during = f" Only in the phase {' or '.join(contract.phases)}." if contract.phases else ""
    lasts, energy = display(contract.duration_us, Dimension.DURATION), display(contract.energy, Dimension.RATIO)
    return f"{_MOTIONS[MotionKind(contract.motion.kind)]}{during} It lasts at most {lasts} and uses at most {energy}."


def _argument(allowed: PermittedArgument) -> Schema:
    """The schema of an argument."""
    parameter = allowed.parameter
    if parameter.kind in (CHOICE, ZONE):
        return {"type": "string", "enum": list(allowed.names)}
    if parameter.kind == PLACE:
        named = [name.replace(".", r"\.") for name in allowed.names]
        known = f": {', '.join(allowed.names)}" if allowed.names else ""
        words = f"A place: coordinates such as `47.39927 N, 8.54572 E` (WGS 84), or a named place{known}."
        return {"type": "string", "pattern": whole(*named, COORDINATES), "description": words}
    dimension = _DIMENSIONS[parameter.dimension]
    low, high = (written(end, dimension) for end in (allowed.low, allowed.high))
    above = " above home" if dimension is Dimension.ALTITUDE else ""
    unit = unit_of(dimension)
    form = f"a number, a space and {unit}" if unit else "a whole number in a string"
    words = f"From {low} to {high}{above}. Write {form}."
    pattern = quantities(allowed.low, allowed.high, dimension)
    return {"type": "string", "pattern": pattern, "description": words, "examples": [high]}


def _const(text: str) -> Schema:
    return {"type": "string", "const": text}


def _object(properties: Schema, optional: Sequence[str] = ()) -> Schema:
    required = [name for name in properties if name not in optional]
    return {"type": "object", "properties": properties, "required": required, "additionalProperties": False}
