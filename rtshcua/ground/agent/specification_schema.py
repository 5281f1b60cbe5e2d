"""The schema of a mission specification: pydantic models, their JSON Schema, and violations as findings."""

import re
from collections.abc import Iterator, Mapping
from itertools import islice
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, ValidationError, field_validator
from pydantic_core import ErrorDetails, PydanticCustomError

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic, Fix
from rtshcua.diagnostics.span import Span
from rtshcua.diagnostics.suggest import nearest
from rtshcua.ground.agent.json_tree import JsonTree, Path, pointer
from rtshcua.wire import names

#: the draft of JSON Schema
DRAFT = "https://json-schema.org/draft/2020-12/schema"
FORMAT, VERSION = names.MISSION_SPEC.name, names.MISSION_SPEC.version
#: the keywords of the language that cannot be names
RESERVED = frozenset({"and", "or", "not", "in", "inside", "outside", "any"})

NAME = r"^[A-Za-z_][A-Za-z0-9_]*(\.[A-Za-z_][A-Za-z0-9_]*)*$"

Name = Annotated[str, StringConstraints(pattern=NAME, max_length=200)]
ArgumentText = Annotated[
    str,
    StringConstraints(max_length=200),
    Field(
        description="A value in the language's form: `20 m`, `4 m/s`, `47.3977 N, 8.5456 E`, a zone such as "
        "`bridge_a`, its entry `bridge_a.entry`, or a choice such as `grid`. Altitudes are above home.",
        examples=["20 m", "4.5 m/s", "bridge_a.entry", "47.39927 N, 8.54572 E", "grid"],
    ),
]


class SpecificationPart(BaseModel):
    """The base of all parts: no undeclared keys, and no conversion between types."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)


class PolicyName(SpecificationPart):
    """The policy of the mission, and the version of the policy for which the mission was written."""

    name: Name
    version: Annotated[int, Field(ge=0)]


class Proposer(SpecificationPart):
    """The proposer of the mission, and the human role for which it is proposed."""

    source: Literal["agent", "operator"]
    name: Name
    role: Name


Duration = Annotated[
    str, StringConstraints(max_length=200), Field(description="A duration.", examples=["2 s", "500 ms", "10 min"])
]
Conditions = Annotated[
    list[Annotated[str, StringConstraints(max_length=1000)]],
    Field(
        description="Conditions in the language's form, over signals that the policy reads.",
        examples=[["battery > 50 %", "wind.speed < 8 m/s"]],
    ),
]


class OverridesShape(SpecificationPart):
    """Limits of this step that tighten its skill's contract: shorter times, a larger energy reserve, fewer phases,
    additional clauses and kinds of evidence.
    """

    deadline: Duration | None = None
    valid_for: Duration | None = None
    during: list[Name] = []
    lasts_at_most: Duration | None = None
    grace: Duration | None = None
    energy_at_most: Annotated[
        str | None, Field(description="A share of a full charge, not below the skill's value.", examples=["6 %"])
    ] = None
    require: Conditions = []
    assume: Conditions = []
    maintain: Conditions = []
    record: list[Name] = []


class StepShape(SpecificationPart):
    """One step: a skill, its arguments by name, what the mission does if the step is not admitted, and limits that
    tighten the skill's contract.
    """

    skill: Name
    arguments: dict[Name, ArgumentText] = {}
    on_inadmissible: Literal["abort", "hold", "skip", "replan"] = "abort"
    overrides: OverridesShape | None = None


class PhaseShape(SpecificationPart):
    """A named phase of the mission; its steps run in order."""

    name: Name
    steps: list[StepShape]


class SpecificationShape(SpecificationPart):
    """A mission that an agent proposes. It passes the same checks as a mission in the language."""

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

    @field_validator("version", mode="before")
    @classmethod
    def _not_true(cls, value: Any) -> Any:
        """Refuse `true`, which is equal to 1 in Python."""
        if isinstance(value, bool):
            raise PydanticCustomError("literal_error", "value not accepted", {"expected": str(VERSION)})
        return value


def schema() -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of a mission specification."""
    return {
        "$schema": DRAFT,
        "$id": f"urn:{FORMAT.replace('/', ':')}:{VERSION}",
        **SpecificationShape.model_json_schema(),
    }


_UNLISTED = re.compile(r"([0-9]+) more findings are not listed")
_EXPECTED_TYPES: Mapping[str, str] = {
    "string_type": "a string",
    "int_type": "a whole number",
    "list_type": "a list",
    "dict_type": "an object",
    "model_type": "an object",
}
_FOUND_TYPES: Mapping[type, str] = {
    str: "a string",
    bool: "true or false",
    int: "a number",
    list: "a list",
    dict: "an object",
    type(None): "null",
}


def shape_errors(error: ValidationError, tree: JsonTree, most: int) -> tuple[Diagnostic, ...]:
    """Return a finding for each violation of the schema: the first `most`, and the number of further ones."""
    found = tuple(islice(_shape_errors(error, tree), most))
    more = error.error_count() - len(found)
    return (*found, more_findings(more, tree.spans[()].file)) if more else found


def more_findings(more: int, file: str) -> Diagnostic:
    """Return the finding that says how many findings are not listed."""
    message = f"{more} more findings are not listed"
    return Diagnostic(codes.SPECIFICATION_SIZE, message, Span(file, 0, 0), "correct the listed findings and try again")


def uncounted_findings(found: Diagnostic) -> int:
    """The number in a finding of `more_findings`; 0 for any other finding."""
    matched = _UNLISTED.fullmatch(found.message) if found.code is codes.SPECIFICATION_SIZE else None
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
    """A missing key. The span is the bracket of the object that lacks it."""
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
    listed = "known keys: " + ", ".join(f"`{key}`" for key in known)
    return Diagnostic(
        codes.SPECIFICATION_SHAPE,
        f"unknown key `{path[-1]}`",
        place,
        listed if near is None else f"did you mean `{near}`?",
        fixes=() if near is None else (Fix(place, f'"{near}"', f"write `{near}`"),),
        pointer=pointer(path),
    )


def _wrong_value(path: Path, tree: JsonTree, error: ErrorDetails) -> Diagnostic:
    kind, value = error["type"], error["input"]
    help: str | None = None
    if kind in _EXPECTED_TYPES:
        message = f"expected {_EXPECTED_TYPES[kind]}; found {_FOUND_TYPES.get(type(value), 'another type')}"
        if kind == "string_type" and {"arguments", "overrides"} & set(path):
            help = 'write the value as a string with its unit, such as "20 m"'
    elif kind == "literal_error":
        message, help = "value not accepted", f"accepted: {error.get('ctx', {}).get('expected', '')}"
    elif kind == "string_pattern_mismatch" and "imports" in path:
        message = "a specification may import from the shipped library only"
        help = "write `lib:` and a path; name the policy's own files on the command line"
    elif kind == "string_pattern_mismatch":
        message, help = "not a valid name", "a name has letters, digits, `_`, and `.` between its parts"
    else:
        message = error["msg"][0].lower() + error["msg"][1:]
    span = tree.keys[path] if "[key]" in error["loc"] else tree.spans[path]
    return Diagnostic(codes.SPECIFICATION_SHAPE, message, span, help, pointer=pointer(path))


def _shape_at(path: Path) -> type[BaseModel]:
    """The model of the object at a path."""
    if not path:
        return SpecificationShape
    if path[0] == "phases":
        return PhaseShape if len(path) < 4 else OverridesShape if "overrides" in path else StepShape
    return PolicyName if path[0] == "policy" else Proposer
