"""The schema under a policy accepts only specifications, and no value that the policy never permits."""

import re
from copy import deepcopy
from json import dumps, loads
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtshcua.diagnostics.excerpt import hiding
from rtshcua.ground.agent.narrowed_schema import RESERVED, narrowed
from rtshcua.ground.agent.specification import parse_specification
from rtshcua.ground.agent.specification_schema import schema as general
from rtshcua.ground.agent.tool_forms import FORMS, strict
from rtshcua.ground.agent.value_patterns import digits, name_but
from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import examine_program
from rtshcua.mavlink import dialect
from virtual.rows import rows

CHECKOUT = Path(__file__).resolve().parents[4]
POLICY = CHECKOUT / "policies" / "bridge_inspection.rts"
PROPOSAL = loads((CHECKOUT / "missions" / "proposal.json").read_text(encoding="utf-8"))


def narrow() -> dict[str, Any]:
    program = load([str(POLICY)], lambda name: Path(name).read_bytes(), str(CHECKOUT))
    (lowered,) = examine_program(program, dialect.load()).policies
    return narrowed(lowered, program.units, "lib:policies/bridge_inspection.rts")


SCHEMA = narrow()
CHECK = jsonschema.Draft202012Validator(SCHEMA)
STRICT = jsonschema.Draft202012Validator(strict(SCHEMA))


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("narrow", [False, True])
def test_every_form_contains_a_schema(form: str, narrow: bool) -> None:
    tool = FORMS[form](deepcopy(SCHEMA) if narrow else general(), narrow=narrow)
    inner = tool.get("function", tool)
    found = next((inner[key] for key in ("parameters", "input_schema", "inputSchema") if key in inner), tool)
    jsonschema.Draft202012Validator.check_schema(found)
    assert found["type"] == "object"
    if form != "schema":
        assert re.fullmatch(r"[a-zA-Z0-9_-]{1,64}", inner["name"])
        assert inner["description"]


def test_shipped_proposal_fits() -> None:
    CHECK.validate(PROPOSAL)
    jsonschema.Draft202012Validator(general()).validate(PROPOSAL)


def filled(proposal: dict[str, Any]) -> dict[str, Any]:
    """The proposal with every optional key, as the strict forms require."""
    whole: dict[str, Any] = deepcopy(proposal)
    for phase in whole["phases"]:
        for step in phase["steps"]:
            step.setdefault("on_inadmissible", "abort")
            given = step.setdefault("arguments", {})
            for name in SCHEMA["$defs"][step["skill"]]["properties"]["arguments"]["properties"]:
                given.setdefault(name, {"speed": "4 m/s", "pattern": "grid"}.get(name))
    return whole


def test_proposal_with_every_key_fits_the_strict_forms() -> None:
    assert not STRICT.is_valid(PROPOSAL)
    STRICT.validate(filled(PROPOSAL))
    CHECK.validate(filled(PROPOSAL))


def test_strict_form_has_only_the_keywords_of_strict_mode() -> None:
    """Every property is required, there is no other one, and no keyword that the providers refuse."""
    refused = {"allOf", "not", "if", "oneOf", "maxLength", "minLength", "default", "examples", "maxItems", "$schema"}

    def walk(value: Any, name: str = "") -> None:
        if isinstance(value, dict):
            if name not in ("properties", "$defs"):
                assert not refused & set(value)
            if value.get("type") == "object":
                assert value["additionalProperties"] is False
                assert value["required"] == list(value["properties"])
            for key, each in value.items():
                walk(each, key)
        elif isinstance(value, list):
            for each in value:
                walk(each)

    walk(strict(SCHEMA))
    assert "overrides" not in dumps(strict(SCHEMA))


@rows(
    ("where", "value"),
    [
        (("phases", 0, "steps", 0, "skill"), "fly_away"),
        (("phases", 0, "steps", 0, "arguments", "altitude"), "41 m"),
        (("phases", 0, "steps", 0, "arguments", "altitude"), "40.5 m"),
        (("phases", 0, "steps", 0, "arguments", "altitude"), "2 m"),
        (("phases", 0, "steps", 0, "arguments", "altitude"), "20"),
        (("phases", 0, "steps", 0, "arguments", "altitude"), "20 km"),
        (("phases", 0, "steps", 0, "arguments", "height"), "20 m"),
        (("phases", 1, "steps", 0, "arguments", "target"), "school.entry"),
        (("phases", 1, "steps", 0, "arguments", "speed"), "9 m/s"),
        (("phases", 1, "steps", 1, "arguments", "area"), "school"),
        (("phases", 1, "steps", 1, "arguments", "area"), "city"),
        (("phases", 1, "steps", 1, "arguments", "altitude"), "31 m"),
        (("phases", 1, "steps", 1, "arguments", "pattern"), "spiral"),
        (("policy", "version"), 8),
        (("vehicle",), "another"),
        (("proposed_by", "source"), "operator"),
        (("proposed_by", "role"), "captain"),
        (("name",), "inside"),
        (("imports", 0), "lib:policies/training_field.rts"),
    ],
)
def test_value_that_the_policy_never_permits_does_not_fit(where: tuple[Any, ...], value: Any) -> None:
    proposal = deepcopy(PROPOSAL)
    place: Any = proposal
    for key in where[:-1]:
        place = place[key]
    place[where[-1]] = value
    assert not CHECK.is_valid(proposal)


def made(schema: dict[str, Any]) -> st.SearchStrategy[Any]:
    """Values that fit a schema, for the keywords of the narrowed schema."""
    if "$ref" in schema:
        return made(SCHEMA["$defs"][schema["$ref"].removeprefix("#/$defs/")])
    if "const" in schema:
        return st.just(schema["const"])
    if "enum" in schema:
        return st.sampled_from(schema["enum"])
    if "anyOf" in schema:
        return st.one_of(*map(made, schema["anyOf"]))
    if "pattern" in schema:
        return st.from_regex(re.compile(schema["pattern"], re.ASCII), fullmatch=True).filter(
            lambda text: len(text) <= 200
        )
    if schema["type"] == "array":
        return st.lists(made(schema["items"]), max_size=min(schema.get("maxItems", 2), 2))
    if schema["type"] == "object":
        fixed = {name: made(each) for name, each in schema["properties"].items() if name in schema["required"]}
        free = {name: made(each) for name, each in schema["properties"].items() if name not in schema["required"]}
        # the schema does not limit the texts of conditions; the language's parser checks them
        free = {name: each for name, each in free.items() if name not in ("require", "assume", "maintain")}
        return st.fixed_dictionaries(fixed, optional=free)
    # JSON Schema cannot exclude hiding or reordering characters: the compiler refuses them
    plain = st.characters(exclude_categories=["Cs", "Cc", "Cf", "Zl", "Zp"])
    return st.text(plain, max_size=20).filter(lambda text: hiding(text) is None)


@settings(max_examples=settings().max_examples // 5)
@given(value=made(SCHEMA))
def test_value_that_fits_the_schema_is_a_specification(value: Any) -> None:
    CHECK.validate(value)
    specification = parse_specification("spec.json", dumps(value).encode())
    assert specification.diagnostics == ()
    (mission,) = specification.unit.missions
    assert [len(phase.items) for phase in mission.phases] == [len(phase["steps"]) for phase in value["phases"]]


@given(low=st.integers(0, 3000), span=st.integers(0, 3000), data=st.data())
def test_range_pattern_accepts_exactly_its_numbers(low: int, span: int, data: st.DataObject) -> None:
    pattern = re.compile(f"(?:{digits(low, low + span)})")
    number = data.draw(st.integers(0, 2 * (low + span) + 10))
    assert bool(pattern.fullmatch(str(number))) == (low <= number <= low + span)
    assert not pattern.fullmatch(f"0{number}")


@given(name=st.one_of(st.sampled_from(sorted(RESERVED)), st.from_regex(r"[a-z]{1,8}", fullmatch=True)))
def test_name_pattern_excludes_exactly_the_reserved_words(name: str) -> None:
    for each in (name, f"{name}s", name[:-1] or "a", f"{name}_1", name.upper()):
        assert bool(re.search(name_but(RESERVED), each)) == (each not in RESERVED)
    assert not re.search(name_but(RESERVED), "1a")
