"""Policies and templates, and the IR that they become."""

from collections.abc import Callable
from typing import Any

from rtshcua.model.ir.program import Unit

Read = Callable[[str], Unit]
Plain = Callable[[Any], Any]


def test_policy(plain: Plain, unit: Read) -> None:
    text = """policy p version 7 {
      permit a, b by role operator, pilot through agent, operator when x < 3 m
      permit any by any
      forbid c by any through agent
      confirm a when x < 1 m by role supervisor within 30 s
      confirm b by role supervisor
      degrade any when battery < 25 % to hover for 5 s
      degrade a to land
      airspace inside city, field outside school
      contingency hover for 10 s, land
    }
    policy q version 1 { airspace outside z  without evidence refuse  without link for 1 min continue }
    """
    first, second = plain(unit(text).policies)
    assert second == {
        "name": "q",
        "version": 1,
        "airspace": {"outside": ["z"]},
        "without_evidence": "refuse",
        "without_link": {"limit": (60_000_000, "duration"), "then": "continue"},
    }
    less = {"kind": "comparison", "operator": "<", "left": "&x"}
    assert first == {
        "name": "p",
        "version": 7,
        "rules": [
            {
                "kind": "permit",
                "where_fitted": False,
                "skills": ["a", "b"],
                "roles": ["operator", "pilot"],
                "through": ["agent", "operator"],
                "when": less | {"right": (3_000, "length")},
            },
            {"kind": "permit", "where_fitted": False},
            {"kind": "forbid", "where_fitted": False, "skills": ["c"], "through": ["agent"]},
            {
                "kind": "confirm",
                "where_fitted": False,
                "skills": ["a"],
                "when": less | {"right": (1_000, "length")},
                "approver": "supervisor",
                "within": (30_000_000, "duration"),
            },
            {"kind": "confirm", "where_fitted": False, "skills": ["b"], "approver": "supervisor"},
            {
                "kind": "degrade",
                "where_fitted": False,
                "when": {"kind": "comparison", "operator": "<", "left": "&battery", "right": (2_500, "ratio")},
                "target": {"skill": "hover", "limit": (5_000_000, "duration")},
            },
            {"kind": "degrade", "where_fitted": False, "skills": ["a"], "target": {"skill": "land"}},
        ],
        "airspace": {"inside": ["city", "field"], "outside": ["school"]},
        "contingency": [{"skill": "hover", "limit": (10_000_000, "duration")}, {"skill": "land"}],
        "without_evidence": "land",
    }


def test_template(plain: Plain, unit: Read) -> None:
    text = """template low(area: zone, top: altitude in 5 m .. 60 m = 30 m, who: role) {
      permit goto by role who through agent when target inside area
      forbid goto by any
      confirm goto by role who
      degrade goto to land
    }
    template none() { }
    """
    first, second = plain(unit(text).templates)
    assert second == {"name": "none"}
    assert first["parameters"] == [
        {"name": "area", "type": "zone"},
        {
            "name": "top",
            "type": "altitude",
            "range": {"kind": "range", "low": (5_000, "length"), "high": (60_000, "length")},
            "default": (30_000, "length"),
        },
        {"name": "who", "type": "role"},
    ]
    assert [rule["kind"] for rule in first["rules"]] == ["permit", "forbid", "confirm", "degrade"]
    assert first["rules"][0] == {
        "kind": "permit",
        "where_fitted": False,
        "skills": ["goto"],
        "roles": ["who"],
        "through": ["agent"],
        "when": {"kind": "inside", "subject": "&target", "region": "&area", "negated": False},
    }


def test_use_and_delegate(plain: Plain, unit: Read) -> None:
    text = """policy p version 1 {
      use low(bridge_a, top = 20 m + 1 m, who = operator)
      permit goto by any
      delegate goto, hover by role operator to role trainee through agent, operator when height < 3 m
      use none()
      delegate any by role operator to role x
    }"""
    policy = plain(unit(text).policies[0])
    assert [rule["kind"] for rule in policy["rules"]] == ["permit"]
    assert policy["uses"] == [
        {
            "template": "low",
            "arguments": [
                {"value": "&bridge_a"},
                {
                    "name": "top",
                    "value": {
                        "kind": "arithmetic",
                        "operator": "+",
                        "left": (20_000, "length"),
                        "right": (1_000, "length"),
                    },
                },
                {"name": "who", "value": "&operator"},
            ],
        },
        {"template": "none"},
    ]
    assert policy["delegations"] == [
        {
            "skills": ["goto", "hover"],
            "grantor": "operator",
            "grantee": "trainee",
            "through": ["agent", "operator"],
            "when": {"kind": "comparison", "operator": "<", "left": "&height", "right": (3_000, "length")},
        },
        {"grantor": "operator", "grantee": "x"},
    ]
