"""The shape of a mission specification, as pydantic models and as the JSON Schema that is published from them."""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, StringConstraints

from rtshcua.wire import names

#: the draft that the schema is of
DRAFT = "https://json-schema.org/draft/2020-12/schema"
FORMAT, VERSION = names.MISSION_SPEC.name, names.MISSION_SPEC.version

NAME = r"^[A-Za-z_][A-Za-z0-9_]*(\.[A-Za-z_][A-Za-z0-9_]*)*$"

Name = Annotated[str, StringConstraints(pattern=NAME, max_length=200)]
Text = Annotated[
    str,
    StringConstraints(max_length=200),
    Field(
        description="A value as the language writes it: `20 m`, `4 m/s`, `47.3977 N, 8.5456 E`, a zone such as "
        "`bridge_a`, its entry `bridge_a.entry`, or a choice such as `grid`. Altitudes are above home.",
        examples=["20 m", "4.5 m/s", "bridge_a.entry", "47.39927 N, 8.54572 E", "grid"],
    ),
]


class Shape(BaseModel):
    """The base: nothing beyond what is declared, and nothing taken for something else."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)


class PolicyName(Shape):
    """The policy that the mission is under, in the version that it was written for."""

    name: Name
    version: Annotated[int, Field(ge=0)]


class Proposer(Shape):
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


class OverridesShape(Shape):
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


class StepShape(Shape):
    """One step: a skill, its arguments by name, what the mission does when it is not admitted, and what it is held to
    beyond the skill's contract.
    """

    skill: Name
    arguments: dict[Name, Text] = {}
    on_inadmissible: Literal["abort", "hold", "skip", "replan"] = "abort"
    overrides: OverridesShape | None = None


class PhaseShape(Shape):
    """A named stretch of the mission; its steps run in order."""

    name: Name
    steps: list[StepShape]


class SpecificationShape(Shape):
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
