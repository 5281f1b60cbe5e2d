"""A mission specification gives the same mission as the language does, and its findings point at the wrong values."""

import copy
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from rtshcua.diagnostics.diagnostic import Diagnostic, has_errors
from rtshcua.ground.agent.json_tree import MAX_BYTES, read_json
from rtshcua.ground.agent.specification_schema import schema
from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import Compiled, compile_program
from rtshcua.mavlink import dialect

CHECKOUT = Path(__file__).resolve().parents[4]

Compile = Callable[[str | bytes], tuple[Compiled, tuple[Diagnostic, ...]]]
Dump = Callable[[Any], str]

SAME_MISSION = """
import "lib:policies/bridge_inspection.rts"

mission standard under bridge_inspection@7 on quad {
  intent "Inspect bridge A."
  proposed by agent openclaw for role operator
  phase departure { takeoff(altitude = 20 m) }
  phase inspection {
    goto(bridge_a.entry, altitude = 20 m)
    inspect_area(bridge_a, altitude = 15 m, pattern = perimeter, speed = 2.5 m/s) on inadmissible skip
  }
  phase recovery { return_home() }
}
"""


def test_specification_compiles_like_the_same_mission_in_the_language(
    good: dict[str, Any], compile_text: Compile, dumped: Dump
) -> None:
    compiled, found = compile_text(dumped(good))
    assert not has_errors(found)

    def read(path: str) -> bytes:
        return SAME_MISSION.encode() if path == "m.rts" else Path(path).read_bytes()

    other = compile_program(load(["m.rts"], read, str(CHECKOUT)), dialect.load(), mission=None, issued_at_us=0)
    assert compiled.policy == other.policy
    assert compiled.mission is not None
    assert other.mission is not None
    fields = ("name", "intent", "proposer", "vehicle", "policy", "policy_version", "phases")
    assert [getattr(compiled.mission, f) for f in fields] == [getattr(other.mission, f) for f in fields]
    of_step = ("step", "phase", "skill", "source", "role", "arguments", "phases", "on_inadmissible", "contract", "plan")
    for mine, theirs in zip(compiled.mission.invocations, other.mission.invocations, strict=True):
        assert [getattr(mine, f) for f in of_step] == [getattr(theirs, f) for f in of_step]


def test_schema_is_valid_and_accepts_the_good_specification(good: dict[str, Any]) -> None:
    published = schema()
    jsonschema.Draft202012Validator.check_schema(published)
    jsonschema.validate(good, published)
    json.dumps(published)


#: the path of a value, its wrong value (None: removed), the code, the pointer, and the text under the span
SPOILED: list[tuple[tuple[str | int, ...], Any, str, str, str]] = [
    (("vehicle",), None, "E0902", "", "{"),
    (("vehicel",), "quad", "E0902", "/vehicel", '"vehicel"'),
    (("version",), 2, "E0902", "/version", "2"),
    (("version",), True, "E0902", "/version", "true"),
    (("name",), "two words", "E0902", "/name", '"two words"'),
    (("name",), "any", "E0902", "/name", '"any"'),
    (("proposed_by", "source"), "reflex", "E0902", "/proposed_by/source", '"reflex"'),
    (("phases", 0, "steps", 0, "arguments", "altitude"), 20, "E0902", "/phases/0/steps/0/arguments/altitude", "20"),
    (
        ("phases", 0, "steps", 0, "arguments", "altitude"),
        "20 ms",
        "E0310",
        "/phases/0/steps/0/arguments/altitude",
        "20 ms",
    ),
    (("phases", 0, "steps", 0, "arguments", "altitude"), "20", "E0310", "/phases/0/steps/0/arguments/altitude", "20"),
    (
        ("phases", 0, "steps", 0, "arguments", "altitude"),
        "20 qm",
        "E0301",
        "/phases/0/steps/0/arguments/altitude",
        "20 qm",
    ),
    (
        ("phases", 0, "steps", 0, "arguments", "altitude"),
        "50 m",
        "E0703",
        "/phases/0/steps/0/arguments/altitude",
        "50 m",
    ),
    (("phases", 0, "steps", 0, "arguments", "altitude"), "", "E0101", "/phases/0/steps/0/arguments/altitude", ""),
    (("phases", 0, "steps", 0, "arguments", "a/b~"), "1", "E0902", "/phases/0/steps/0/arguments/a~1b~0", '"a/b~"'),
    (
        ("phases", 0, "steps", 0, "arguments", "height"),
        "1 m",
        "E0601",
        "/phases/0/steps/0/arguments/height",
        '"height"',
    ),
    (("phases", 0, "steps", 0, "skill"), "take_off", "E0201", "/phases/0/steps/0/skill", '"take_off"'),
    (
        ("phases", 1, "steps", 1, "arguments", "pattern"),
        "spiral",
        "E0313",
        "/phases/1/steps/1/arguments/pattern",
        "spiral",
    ),
    (("phases", 1, "steps", 1, "arguments", "area"), "school", "E0703", "/phases/1/steps/1/arguments/area", "school"),
    (("phases", 1, "steps", 1, "on_inadmissible"), "retry", "E0902", "/phases/1/steps/1/on_inadmissible", '"retry"'),
    (("phases", 2, "steps"), {}, "E0902", "/phases/2/steps", "{}"),
    (("policy", "version"), 6, "E0701", "/policy", None),
    (("proposed_by", "role"), "visitor", "E0702", "/proposed_by/role", '"visitor"'),
    (("imports",), ["../../etc/passwd"], "E0902", "/imports/0", '"../../etc/passwd"'),
    (("imports",), ["lib:policies/none.rts"], "E0108", "/imports/0", '"lib:policies/none.rts"'),
]  # type: ignore[list-item]


@pytest.mark.parametrize(("path", "value", "code", "pointer", "text"), SPOILED)
def test_finding_points_at_the_value_to_correct(
    good: dict[str, Any],
    compile_text: Compile,
    dumped: Dump,
    path: tuple[str | int, ...],
    value: Any,
    code: str,
    pointer: str,
    text: str | None,
) -> None:
    spoiled: Any = copy.deepcopy(good)
    parent = spoiled
    for part in path[:-1]:
        parent = parent[part]
    if value is None:
        del parent[path[-1]]
    else:
        parent[path[-1]] = value
    written = dumped(spoiled)
    compiled, found = compile_text(written)
    assert compiled.mission is None
    first = found[0]
    assert (first.code.id, first.pointer) == (code, pointer)
    assert first.span is not None
    if text is not None:
        assert written[first.span.start : first.span.end] == text
    assert all(each.pointer is not None for each in found if each.span is not None and each.span.file == "spec.json")


def test_value_cannot_inject_syntax_of_the_language(good: dict[str, Any], compile_text: Compile, dumped: Dump) -> None:
    for hostile in (
        "20 m) goto(altitude = 5 m",
        "20 m, altitude = 5 m",
        "20 m) } phase b { hover(",
        "20 m) } } mission n under p@1 on v { phase a { s(x = 1",
        "20 m // and more",
        "20 m /* ) } }",
        '20 m"',
        "20 m\n) } } skill x() {",
        "hover()",
    ):
        good["phases"][0]["steps"][0]["arguments"]["altitude"] = hostile
        _, found = compile_text(dumped(good))
        assert found, hostile
        assert {each.pointer for each in found} == {"/phases/0/steps/0/arguments/altitude"}, found


def test_span_is_right_in_a_string_with_escapes(good: dict[str, Any], compile_text: Compile, dumped: Dump) -> None:
    text = dumped(good).replace('"perimeter"', '"per\\u0069meteer"')
    _, found = compile_text(text)
    assert found[0].span is not None
    assert text[found[0].span.start : found[0].span.end] == "per\\u0069meteer"


BROKEN: list[tuple[str | bytes, str]] = [
    ("", "E0901"),
    ("{", "E0901"),
    ('{"a": }', "E0901"),
    ('{"a": NaN}', "E0901"),
    ('{"a": Infinity}', "E0901"),
    ('{"a": 1.5}', "E0901"),
    ('{"a": 1e5}', "E0901"),
    ('{"a": 01}', "E0901"),
    ('{"a": "\\ud800"}', "E0901"),
    ('{"a": "\x01"}', "E0901"),
    ("{'a': 1}", "E0901"),
    ('{"a": 1} x', "E0901"),
    (b"\xff\xfe", "E0901"),
    ("[1]", "E0902"),
    ('"text"', "E0902"),
    ("null", "E0902"),
    ('{"a": 1, "a": 2}', "E0903"),
    ("[" * 100_000, "E0904"),
    ('{"a":' * 100_000, "E0904"),
    ('{"a": ' + "9" * 5_000 + "}", "E0904"),
    (b" " * (MAX_BYTES + 1), "E0904"),
]


@pytest.mark.parametrize(("text", "code"), BROKEN)
def test_malformed_specification_is_one_finding(compile_text: Compile, text: str | bytes, code: str) -> None:
    compiled, found = compile_text(text)
    assert compiled.mission is None
    assert [each.code.id for each in found if each.code.id != "E0206"][:1] == [code]
    assert found[0].pointer is not None


@example(value=-(10**17))
@given(
    st.recursive(
        st.none() | st.booleans() | st.integers(-(10**17), 10**17) | st.text(),
        lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
        max_leaves=12,
    )
)
def test_reader_agrees_with_the_json_module(value: Any) -> None:
    try:
        data = json.dumps(value, ensure_ascii=False).encode()
    except UnicodeEncodeError:
        return
    source, tree, found = read_json("a.json", data)
    assert not has_errors(found)
    assert tree is not None
    assert tree.value == value
    for path, span in tree.spans.items():
        part: Any = value
        for key in path:
            part = part[key]
        assert json.loads(source.slice(span)) == part


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_mutated_specification_compiles_or_has_errors(
    good: dict[str, Any], compile_text: Compile, dumped: Dump, data: st.DataObject
) -> None:
    text = dumped(good)
    for _ in range(data.draw(st.integers(1, 3))):
        start = data.draw(st.integers(0, len(text)))
        end = min(len(text), start + data.draw(st.integers(0, 6)))
        text = (
            text[:start]
            + data.draw(st.sampled_from(["", '"', "}", ",", "20 m", "null", "[", "\\", "é", "7", "any"]))
            + text[end:]
        )
    compiled, found = compile_text(text)
    assert (compiled.mission is None) == has_errors(found)
