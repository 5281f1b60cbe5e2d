"""The schema of a mission specification: pydantic models, JSON Schema, and violations as findings (E0902)."""

import re
from collections.abc import Iterator, Mapping
from itertools import islice
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, ValidationError
from pydantic_core import ErrorDetails

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic, Fix
from rtshcua.diagnostics.span import Span
from rtshcua.diagnostics.suggest import nearest
from rtshcua.ground.agent.json_tree import JsonTree, Path, pointer
from rtshcua.wire import names

#: the draft that the schema is of
DRAFT = "https://json-schema.org/draft/2020-12/schema"
FORMAT, VERSION = names.MISSION_SPEC.name, names.MISSION_SPEC.version
#: the words of the language that are no names
RESERVED = frozenset({"and", "or", "not", "in", "inside", "outside", "any"})

NAME = r"^[A-Za-z_][A-Za-z0-9_]*(\.[A-Za-z_][A-Za-z0-9_]*)*$"

Name = Annotated[str, StringConstraints(pattern=NAME, max_length=200)]
ArgumentText = Annotated[
    str,
    StringConstraints(max_length=200),
    Field(
        description="A value as the language writes it: `20 m`, `4 m/s`, `47.3977 N, 8.5456 E`, a zone such as "
        "`bridge_a`, its entry `bridge_a.entry`, or a choice such as `grid`. Altitudes are above home.",
        examples=["20 m", "4.5 m/s", "bridge_a.entry", "47.39927 N, 8.54572 E", "grid"],
    ),
]


class SpecificationPart(BaseModel):
    """The base: nothing beyond what is declared, and nothing taken for something else."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)


class PolicyName(SpecificationPart):
    """The policy that the mission is under, in the version that it was written for."""

    name: Name
    version: Annotated[int, Field(ge=0)]


class Proposer(SpecificationPart):
    """Who proposes the mission, and for which human role."""

    source: Literal["agent", "operator"]
    name: Name
    role: Name


Duration = Annotated[
    str, StringConstraints(max_length=200), Field(description="A duration.", examples=["2 s", "500 ms", "10 min"])
]
Conditions = Annotated[
    list[Annotated[str, StringConstraints(max_length=1000)]],
    Field(
        description="Conditions as the language writes them, over what the policy reads.",
        examples=[["battery > 50 %", "wind.speed < 8 m/s"]],
    ),
]


class OverridesShape(SpecificationPart):
    """What holds of this step beyond its skill's contract. It may only tighten: shorter times, more energy kept ready,
    fewer phases, further clauses and kinds of evidence.
    """

    deadline: Duration | None = None
    valid_for: Duration | None = None
    during: list[Name] = []
    lasts_at_most: Duration | None = None
    grace: Duration | None = None
    energy_at_most: Annotated[
        str | None, Field(description="A part of a full charge, not less than the skill's.", examples=["6 %"])
    ] = None
    require: Conditions = []
    assume: Conditions = []
    maintain: Conditions = []
    record: list[Name] = []


class StepShape(SpecificationPart):
    """One step: a skill, its arguments by name, what the mission does when it is not admitted, and what it is held to
    beyond the skill's contract.
    """

    skill: Name
    arguments: dict[Name, ArgumentText] = {}
    on_inadmissible: Literal["abort", "hold", "skip", "replan"] = "abort"
    overrides: OverridesShape | None = None


class PhaseShape(SpecificationPart):
    """A named stretch of the mission; its steps run in order."""

    name: Name
    steps: list[StepShape]


class SpecificationShape(SpecificationPart):
    """A mission as an agent proposes it. The same checks apply as to a mission in the language."""

    model_config = ConfigDict(title="RT-SHCUA mission specification")

    format: Literal["rtshcua/mission-spec"]
    version: Literal[1]
    name: Name
    imports: Annotated[
        list[Annotated[str, StringConstraints(pattern=r"^lib:")]],
        Field(description="Files of the shipped library, such as `lib:policies/bridge_inspection.rts`."),
    ] = []
    policy: PolicyName
    vehicle: Name
    intent: Annotated[str, StringConstraints(max_length=1000)] | None = None
    proposed_by: Proposer
    phases: list[PhaseShape]


def schema() -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of a mission specification."""
    return {
        "$schema": DRAFT,
        "$id": f"urn:{FORMAT.replace('/', ':')}:{VERSION}",
        **SpecificationShape.model_json_schema(),
    }


_UNTOLD = re.compile(r"and ([0-9]+) more findings, which are not told")
_EXPECTED_TYPES: Mapping[str, str] = {
    "string_type": "a text",
    "int_type": "a whole number",
    "list_type": "a list",
    "dict_type": "an object",
    "model_type": "an object",
}
_FOUND_TYPES: Mapping[type, str] = {
    str: "a text",
    bool: "true or false",
    int: "a number",
    list: "a list",
    dict: "an object",
    type(None): "null",
}


def shape_errors(error: ValidationError, tree: JsonTree, most: int) -> tuple[Diagnostic, ...]:
    """One finding for each place where the specification is not what its schema asks; of many, the first `most`, and
    how many more there are.
    """
    found = tuple(islice(_shape_errors(error, tree), most))
    more = error.error_count() - len(found)
    return (*found, more_findings(more, tree.spans[()].file)) if more else found


def more_findings(more: int, file: str) -> Diagnostic:
    """That there is more to find than is told, and how much."""
    message = f"and {more} more findings, which are not told"
    return Diagnostic(codes.SPECIFICATION_SIZE, message, Span(file, 0, 0), "mend those that are told, and try again")


def uncounted_findings(found: Diagnostic) -> int:
    """How many findings one of `more_findings` stands for; 0 for any other finding."""
    matched = _UNTOLD.fullmatch(found.message) if found.code is codes.SPECIFICATION_SIZE else None
    return 0 if matched is None else int(matched[1])


def _shape_errors(error: ValidationError, tree: JsonTree) -> Iterator[Diagnostic]:
    for each in error.errors(include_url=False):
        path = tuple(part for part in each["loc"] if part != "[key]")
        if each["type"] == "missing":
            yield _missing(path, tree)
        elif each["type"] == "extra_forbidden":
            yield _unknown_key(path, tree)
        else:
            yield _wrong_value(path, tree, each)


def _missing(path: Path, tree: JsonTree) -> Diagnostic:
    """A key that is not there: the bracket of the object that lacks it is shown."""
    place = tree.spans[path[:-1]]
    return Diagnostic(
        codes.SPECIFICATION_SHAPE,
        f"the key `{path[-1]}` is missing",
        Span(place.file, place.start, place.start + 1),
        f'add `"{path[-1]}": ...` to this object',
        pointer=pointer(path[:-1]),
    )


def _unknown_key(path: Path, tree: JsonTree) -> Diagnostic:
    place = tree.keys[path]
    known = list(_shape_at(path[:-1]).model_fields)
    near = nearest(str(path[-1]), known)
    listed = "its keys are " + ", ".join(f"`{key}`" for key in known)
    return Diagnostic(
        codes.SPECIFICATION_SHAPE,
        f"there is no key `{path[-1]}` here",
        place,
        listed if near is None else f"did you mean `{near}`?",
        fixes=() if near is None else (Fix(place, f'"{near}"', f"write `{near}`"),),
        pointer=pointer(path),
    )


def _wrong_value(path: Path, tree: JsonTree, error: ErrorDetails) -> Diagnostic:
    kind, value = error["type"], error["input"]
    help: str | None = None
    if kind in _EXPECTED_TYPES:
        message = f"expected {_EXPECTED_TYPES[kind]}; this is {_FOUND_TYPES.get(type(value), 'something else')}"
        if kind == "string_type" and {"arguments", "overrides"} & set(path):
            help = 'write the value as a text with its unit, such as "20 m"'
    elif kind == "literal_error":
        message, help = "this value is not accepted", f"accepted: {error.get('ctx', {}).get('expected', '')}"
    elif kind == "string_pattern_mismatch" and "imports" in path:
        message = "a specification imports from the shipped library only"
        help = "write `lib:` and a path; name the policy's own files on the command line"
    elif kind == "string_pattern_mismatch":
        message, help = "this is not a name", "a name has letters, digits, `_`, and `.` between its parts"
    else:
        message = error["msg"][0].lower() + error["msg"][1:]
    span = tree.keys[path] if "[key]" in error["loc"] else tree.spans[path]
    return Diagnostic(codes.SPECIFICATION_SHAPE, message, span, help, pointer=pointer(path))


def _shape_at(path: Path) -> type[BaseModel]:
    """The shape of the object at a path."""
    if not path:
        return SpecificationShape
    if path[0] == "phases":
        return PhaseShape if len(path) < 4 else OverridesShape if "overrides" in path else StepShape
    return PolicyName if path[0] == "policy" else Proposer
