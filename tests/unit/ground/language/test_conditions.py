"""All forms of conditions and values, and their precedence."""

from collections.abc import Callable
from typing import Any

import pytest

from rtshcua.model.ir.program import Unit

Read = Callable[[str], Unit]
Plain = Callable[[Any], Any]


def condition(plain: Plain, unit: Read, text: str) -> Any:
    (clause,) = unit(f"skill s() {{ require {text} }}").skills[0].require
    return plain(clause.condition)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a < b", {"kind": "comparison", "operator": "<", "left": "&a", "right": "&b"}),
        ("a <= -3 m", {"kind": "comparison", "operator": "<=", "left": "&a", "right": (-3_000, "length")}),
        (
            "a in 22:00 .. 06:30",
            {"kind": "within", "subject": "&a", "range": {"kind": "range", "low": "1320 min", "high": "390 min"}},
        ),
        (
            "local \t time in 5..6",
            {
                "kind": "within",
                "subject": "&local time",
                "range": {"kind": "range", "low": (5, "count"), "high": (6, "count")},
            },
        ),
        ("a in {b, c}", {"kind": "one-of", "subject": "&a", "names": ["b", "c"]}),
        ("a inside z", {"kind": "inside", "subject": "&a", "region": "&z", "negated": False}),
        (
            "1 N, 2 W outside grow(z, -5 m)",
            {
                "kind": "inside",
                "subject": (10_000_000, -20_000_000),
                "region": {"kind": "grow", "zone": "&z", "margin": (-5_000, "length")},
                "negated": True,
            },
        ),
        (
            "a inside grow(z, margin)",
            {
                "kind": "inside",
                "subject": "&a",
                "region": {"kind": "grow", "zone": "&z", "margin": "&margin"},
                "negated": False,
            },
        ),
        (
            "abs(a) < max(1, b,)",
            {
                "kind": "comparison",
                "operator": "<",
                "left": {"kind": "function", "name": "abs", "operands": ["&a"]},
                "right": {"kind": "function", "name": "max", "operands": [(1, "count"), "&b"]},
            },
        ),
        ("phase == inspection", {"kind": "comparison", "operator": "==", "left": "&phase", "right": "&inspection"}),
        ("phase in {a, b}", {"kind": "one-of", "subject": "&phase", "names": ["a", "b"]}),
    ],
)
def test_condition(plain: Plain, unit: Read, text: str, expected: dict[str, Any]) -> None:
    assert condition(plain, unit, text) == expected


def shape(found: Any) -> Any:
    """The nesting of operators, with each comparison as the name on its left."""
    if found["kind"] == "junction":
        return (found["operator"], *(shape(operand) for operand in found["operands"]))
    if found["kind"] in ("not", "for-last", "within-last"):
        return (found["kind"], *found.get("window", ())[:1], shape(found["operand"]))
    if found["kind"] == "edge":
        return ("rising" if found["rising"] else "falling", shape(found["operand"]))
    if found["kind"] == "near":
        return ("near", found["window"][0], shape(found["left"]), shape(found["right"]))
    return found["left"].removeprefix("&")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a>1 or b>1 and c>1", ("or", "a", ("and", "b", "c"))),
        ("a>1 and b>1 or c>1", ("or", ("and", "a", "b"), "c")),
        ("a>1 or b>1 or c>1", ("or", "a", "b", "c")),
        ("not a>1 or b>1", ("or", ("not", "a"), "b")),
        ("not (a>1 or b>1)", ("not", ("or", "a", "b"))),
        ("not not a>1", ("not", ("not", "a"))),
        ("(a>1 or (b>1 or c>1)) or d>1", ("or", ("or", "a", ("or", "b", "c")), "d")),
        ("a>1 for the last 1 us", ("for-last", 1, "a")),
        ("a>1 within the last 2 us", ("within-last", 2, "a")),
        ("a>1 within 3 us of b>1", ("near", 3, "a", "b")),
        ("rising a>1", ("rising", "a")),
        ("rising a>1 within the last 2 us", ("within-last", 2, ("rising", "a"))),
        ("rising falling rising a>1", ("rising", ("falling", ("rising", "a")))),
        ("rising(a>1 for the last 1 us)", ("rising", ("for-last", 1, "a"))),
        ("not a>1 for the last 3 us", ("not", ("for-last", 3, "a"))),
        ("(not a>1) for the last 3 us", ("for-last", 3, ("not", "a"))),
        ("not rising a>1", ("not", ("rising", "a"))),
        ("a>1 or b>1 for the last 3 us", ("or", "a", ("for-last", 3, "b"))),
        ("(a>1 and b>1) for the last 3 us", ("for-last", 3, ("and", "a", "b"))),
        ("a>1 or b>1 within 1 us of c>1 and d>1", ("or", "a", ("and", ("near", 1, "b", "c"), "d"))),
        ("a>1 for the last 1 us within the last 2 us", ("within-last", 2, ("for-last", 1, "a"))),
        ("a>1 within 1 us of b>1 within 2 us of c>1", ("near", 2, ("near", 1, "a", "b"), "c")),
        ("a>1 within 1 us of (b>1 within 2 us of c>1)", ("near", 1, "a", ("near", 2, "b", "c"))),
        ("a>1 within 1 us of rising b>1 for the last 2 us", ("for-last", 2, ("near", 1, "a", ("rising", "b")))),
    ],
)
def test_precedence_of_conditions(plain: Plain, unit: Read, text: str, expected: Any) -> None:
    assert shape(condition(plain, unit, text)) == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a + b * c", ("+", "a", ("*", "b", "c"))),
        ("a * b - c", ("-", ("*", "a", "b"), "c")),
        ("a - b - c", ("-", ("-", "a", "b"), "c")),
        ("a - (b - c)", ("-", "a", ("-", "b", "c"))),
        ("((a))", "a"),
        ("a / b / c", ("/", ("/", "a", "b"), "c")),
        ("a / b * c", ("*", ("/", "a", "b"), "c")),
        ("a * (b / c)", ("*", "a", ("/", "b", "c"))),
        ("a/ b - c /d", ("-", ("/", "a", "b"), ("/", "c", "d"))),
        ("a / // comments divide nothing\n b /* nor here */", ("/", "a", "b")),
        ("min(a - b, max(c, d) * e) / f", ("/", ("min", ("-", "a", "b"), ("*", ("max", "c", "d"), "e")), "f")),
        ("abs(abs((a))) + b", ("+", ("abs", ("abs", "a")), "b")),
    ],
)
def test_precedence_of_values(plain: Plain, unit: Read, text: str, expected: Any) -> None:
    def nested(found: Any) -> Any:
        if isinstance(found, str):
            return found.removeprefix("&")
        if found["kind"] == "function":
            return (found["name"], *map(nested, found["operands"]))
        return (found["operator"], nested(found["left"]), nested(found["right"]))

    assert nested(condition(plain, unit, f"x > {text}")["right"]) == expected
