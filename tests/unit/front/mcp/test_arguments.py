"""Arguments of tools are checked against their schema, with an error that names the correct form."""

import json
from typing import Any

import pytest

from rtshcua.front.mcp.arguments import Unfit, fitted
from rtshcua.front.mcp.server import TOOLS

SCHEMAS = {each.name: each.input_schema for each in TOOLS}
MISSION = {"format": "rtshcua/mission-spec", "phases": [{"name": "a"}]}


@pytest.mark.parametrize(
    ("tool", "given", "taken"),
    [
        ("describe_policy", {}, {}),
        ("check_mission", {"mission": MISSION}, {"mission": MISSION}),
        ("check_mission", {"mission": json.dumps(MISSION)}, {"mission": MISSION}),
        ("check_mission", {"mission": f"\ufeff {json.dumps(MISSION)}\n"}, {"mission": MISSION}),
        ("check_mission", {"mission": f"```json\n{json.dumps(MISSION, indent=1)}\n```"}, {"mission": MISSION}),
        ("check_mission", {"mission": f"```\r\n{json.dumps(MISSION)}\r\n```\n"}, {"mission": MISSION}),
        ("check_mission", {"mission": json.dumps(json.dumps(MISSION))}, {"mission": MISSION}),
        ("check_mission", {"mission": '{"a": 25.5}'}, {"mission": {"a": 25.5}}),
        ("mission_status", {"ticket": "t", "wait_s": 60}, {"ticket": "t", "wait_s": 60}),
        ("mission_status", {"ticket": "t", "wait_s": 5.0}, {"ticket": "t", "wait_s": 5}),
        *(("replan", each, each) for each in [{"mission": {}, "from_step_number": 1, "idempotency_key": ""}]),
    ],
)  # fmt: skip
def test_taken(tool: str, given: dict[str, Any], taken: dict[str, Any]) -> None:
    found = fitted(SCHEMAS[tool], given)
    assert found == taken
    assert {name: type(each) for name, each in found.items()} == {name: type(each) for name, each in taken.items()}


@pytest.mark.parametrize(
    ("tool", "given", "text", "repair"),
    [
        ("check_mission", {}, "the argument `mission` is missing", "pass an object as `mission`"),
        (
            "check_mission",
            {"mission": "fly home"},
            "`mission` must be an object, not a text",
            "pass an object",
        ),
        (
            "check_mission",
            {"mission": "fly home"},
            "line 1, column 1 of the JSON: expected a value; found `f`",
            "exactly",
        ),
        ("check_mission", {"mission": ""}, "found the end of the text", "exactly one object in JSON"),
        ("check_mission", {"mission": "[1]"}, "must be an object, not a text: it holds a list", "pass an object"),
        (
            "check_mission",
            {"mission": '{"a": 1, "a": 2}'},
            "column 10 of the JSON: the key `a` is written twice",
            "pass",
        ),
        ("check_mission", {"mission": "[" * 100_000}, "too many values", "pass an object"),
        ("check_mission", {"mission": '{"a": 1}\n{"a": 2}'}, "line 2, column 1 of the JSON: expected the end", "pass"),
        (
            "check_mission",
            {"mission": '{"a": 1}\nPlease fly it.'},
            "line 2, column 1 of the JSON: expected the end",
            "",
        ),
        ("check_mission", {"mission": "Here it is: {}"}, "line 1, column 1 of the JSON: expected a value", "pass"),
        (
            "check_mission",
            {"mission": '```json\n{"a": 1,}\n```'},
            "line 1, column 9 of the JSON: expected a key",
            "pass",
        ),
        ("check_mission", {"mission": "{'a': 1}"}, "column 2 of the JSON: expected a key in double quotes", "pass"),
        ("check_mission", {"mission": json.dumps(json.dumps("{}"))}, "it holds a text", "pass an object"),
        (
            "check_mission",
            {"mission": '{"a": "' + "x" * (1 << 20)},
            "characters; the limit is 1048576",
            "pass an object",
        ),
        ("check_mission", {"mission": '{"\ud800": '}, "of the JSON", "pass an object"),
        ("check_mission", {"mission": None}, "not null", "pass an object"),
        ("check_mission", {"mission": MISSION, "note": 1}, "unknown argument `note`", "accepted: `mission`"),
        ("describe_policy", {"x": 1}, "unknown argument `x`", "accepted: none"),
        ("mission_status", {"ticket": "t", "wait_s": "5"}, "must be a whole number", "write 5 without quotes"),
        ("mission_status", {"ticket": "t", "wait_s": " +5 "}, "must be a whole number", "write 5 without quotes"),
        ("mission_status", {"ticket": "t", "wait_s": "5.0"}, "must be a whole number", "write 5 without quotes"),
        ("mission_status", {"ticket": "t", "wait_s": "5.5"}, "must be a whole number", "pass a whole number"),
        ("mission_status", {"ticket": "t", "wait_s": 5.5}, "must be a whole number", "pass a whole number"),
        ("mission_status", {"ticket": "t", "wait_s": True}, "not true or false", "pass a whole number"),
        ("mission_status", {"ticket": "t", "wait_s": 61}, "`wait_s` is 61", "accepted: from 0 to 60"),
        ("mission_status", {"ticket": 7}, "`ticket` must be a text", 'write "7" as `ticket`'),
        (
            "replan",
            {"mission": {}, "from_step_number": 0, "idempotency_key": "k"},
            "`from_step_number` is 0",
            "accepted: from 1",
        ),
    ],
)
def test_told(tool: str, given: dict[str, Any], text: str, repair: str) -> None:
    with pytest.raises(Unfit) as unfit:
        fitted(SCHEMAS[tool], given)
    assert text in str(unfit.value)
    assert repair in unfit.value.repair
