"""The JSON Schema of the missions that an agent may propose under one policy: nothing else fits.

It has the skills that are permitted to an agent, with their parameters, the zones and the ranges that some permit
leaves, and the names of the policy, its vehicle and its roles. What fits may still be refused: conditions that depend
on the state, ways, times and charge are the compiler's.
"""

from collections.abc import Sequence
from typing import Any, Final

from rtshcua.ground.agent.patterns import COORDINATES, name_but, quantities, unit_of, whole, written
from rtshcua.ground.agent.permitted import Allowed, Permitted, permitted
from rtshcua.ground.agent.schema import DRAFT, FORMAT, VERSION, OverridesShape
from rtshcua.ground.checker.checks.contracts import RECORDS
from rtshcua.ground.lower.policy import LoweredPolicy
from rtshcua.model.flat.contract import CHOICE, PLACE, ZONE, Contract, MotionKind
from rtshcua.model.ir.program import Unit
from rtshcua.model.quantity import Dimension, display

#: the words of the language that are no names
RESERVED: Final = frozenset({"and", "or", "not", "in", "inside", "outside", "any"})
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
    """The schema under a policy; `path` is that of its source in the shipped library, where it is one of that.

    `units` are those of its program: they say which zones have an entry, and which parameters a default.
    """
    policy = lowered.policy
    known = {zone.name for zone in policy.zones[: policy.declared]}
    zones = [zone for unit in units for zone in unit.zones if zone.name.text in known]
    skills = permitted(lowered, [f"{zone.name.text}.entry" for zone in zones if zone.entry is not None])
    defaults = frozenset(
        (skill.name.text, parameter.name.text)
        for unit in units
        for skill in unit.skills
        for parameter in skill.parameters
        if parameter.default is not None
    )
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
            f"A mission as an agent proposes it under {policy.name}@{policy.version}. "
            "It is checked in full when it is handed in."
        ),
        "$defs": {skill.contract.name: _step(skill, defaults) for skill in skills},
        **_object(
            {
                "format": _const(FORMAT),
                "version": {"type": "integer", "const": VERSION},
                "name": name | {"description": "What the mission is called."},
                "imports": imports,
                "policy": _object({"name": _const(policy.name), "version": version}),
                "vehicle": _const(policy.vehicle.name),
                "intent": {"type": "string", "maxLength": 1000, "description": "What it is for, in a sentence."},
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


def _phases(skills: Sequence[Permitted]) -> str:
    bound = [f"{each.contract.name} in {' or '.join(each.contract.phases)}" for each in skills if each.contract.phases]
    return "The name of a stretch of the mission." + (f" Only in these phases: {'; '.join(bound)}." if bound else "")


def _step(skill: Permitted, defaults: frozenset[tuple[str, str]]) -> Schema:
    """One step of a skill."""
    contract = skill.contract
    given = {each.parameter.name: _argument(each) for each in skill.allowed}
    left = [name for name in given if (contract.name, name) in defaults]
    step = _object(
        {
            "skill": _const(contract.name),
            "arguments": _object(given, optional=left),
            "on_inadmissible": {"type": "string", "enum": ["abort", "hold", "skip", "replan"]},
            "overrides": _overrides(),
        },
        optional=("on_inadmissible", "overrides", *(() if len(left) < len(given) else ("arguments",))),
    )
    return step | {"description": _told(contract)}


def _overrides() -> Schema:
    """What may be tightened; whether it is tighter, and whether its conditions hold water, the compiler says."""
    duration = {"type": "string", "pattern": r"^[1-9][0-9]{0,4} (?:ms|s|min)$"}
    names = {"type": "array", "items": {"type": "string", "pattern": name_but(RESERVED)}}
    kinds = {"type": "array", "items": {"type": "string", "enum": list(RECORDS)}}
    own: Schema = {
        name: field | {"description": field.get("description", "")}
        for name, field in OverridesShape.model_json_schema()["properties"].items()
        if name in ("require", "assume", "maintain")
    }
    times = ("deadline", "valid_for", "lasts_at_most", "grace")
    energy = {"type": "string", "pattern": r"^[1-9][0-9]? %$"}
    fields = dict.fromkeys(times, duration) | own | {"energy_at_most": energy, "during": names, "record": kinds}
    return _object(fields, optional=tuple(fields))


def _told(contract: Contract) -> str:
    during = f" Only in the phase {' or '.join(contract.phases)}." if contract.phases else ""
    lasts, energy = display(contract.duration_us, Dimension.DURATION), display(contract.energy, Dimension.RATIO)
    return f"{_MOTIONS[MotionKind(contract.motion.kind)]}{during} It lasts at most {lasts} and takes at most {energy}."


def _argument(allowed: Allowed) -> Schema:
    """What may be given for a parameter."""
    parameter = allowed.parameter
    if parameter.kind in (CHOICE, ZONE):
        return {"type": "string", "enum": list(allowed.names)}
    if parameter.kind == PLACE:
        named = [name.replace(".", r"\.") for name in allowed.names]
        known = f": {', '.join(allowed.names)}" if allowed.names else ""
        words = f"A place: `47.39927 N, 8.54572 E` (WGS 84), or one that has a name{known}."
        return {"type": "string", "pattern": whole(*named, COORDINATES), "description": words}
    dimension = _DIMENSIONS[parameter.dimension]
    low, high = (written(end, dimension) for end in (allowed.low, allowed.high))
    above = " above home" if dimension is Dimension.ALTITUDE else ""
    unit = unit_of(dimension)
    form = f"a number, a space and {unit}" if unit else "a whole number in a text"
    words = f"From {low} to {high}{above}, as {form}."
    pattern = quantities(allowed.low, allowed.high, dimension)
    return {"type": "string", "pattern": pattern, "description": words, "examples": [high]}


def _const(text: str) -> Schema:
    return {"type": "string", "const": text}


def _object(properties: Schema, optional: Sequence[str] = ()) -> Schema:
    required = [name for name in properties if name not in optional]
    return {"type": "object", "properties": properties, "required": required, "additionalProperties": False}
