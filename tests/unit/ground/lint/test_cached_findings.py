"""Cached findings survive a round trip, and malformed lists are refused."""

import json

import pytest

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Applicability, Diagnostic, Fix, Label
from rtshcua.diagnostics.span import Span
from rtshcua.ground.lint.cached_findings import findings_as_lists, findings_from_lists
from virtual.rows import rows

WHOLE = Diagnostic(
    codes.NAMING,
    "it is so",
    Span("a.rts", 1, 3),
    "do it",
    (Label(Span("b.rts", 0, 0), "here"),),
    (Fix(Span("a.rts", 1, 2), "x", "write `x`", Applicability.SAFE),),
    "/a",
)
LEAST = Diagnostic(codes.NAMING, "it is so")


def test_findings_survive_a_round_trip() -> None:
    assert findings_from_lists(json.loads(json.dumps(findings_as_lists((WHOLE, LEAST))))) == (WHOLE, LEAST)


@rows(
    "harm",
    [
        {0: "E9999"}, {0: []}, {1: 1}, {1: None}, {2: ["a.rts", "1", "3"]}, {2: ["a.rts", 3, 1]}, {2: ["a.rts", -1, 3]},
        {2: ["a.rts", True, 3]}, {2: ["a.rts", 1]}, {2: [1, 1, 3]}, {2: "a13"}, {2: ["a.rts", 1.0, 3]}, {3: 1},
        {4: [[["b.rts", 0, 0], 1]]}, {4: [[None, "here"]]}, {4: "ab"}, {5: [[["a.rts", 1, 2], None, "x", "safe"]]},
        {5: [[["a.rts", 1, 2], "x", 1, "safe"]]}, {5: [[["a.rts", 1, 2], "x", "x", "sure"]]},
        {5: [[None, "x", "x", "safe"]]}, {6: 1},
    ],
    ids=str,
)  # fmt: skip
def test_malformed_lists_are_refused(harm: dict[int, object]) -> None:
    (lists,) = json.loads(json.dumps(findings_as_lists((WHOLE,))))
    for place, found in harm.items():
        lists[place] = found
    with pytest.raises((ValueError, KeyError, TypeError)):
        findings_from_lists([lists])
