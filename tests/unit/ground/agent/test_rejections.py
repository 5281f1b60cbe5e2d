"""Rejections suffice to correct a mission: a repairer uses only the pointer, the limit and the nearest value."""

import json
import random
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest

from rtshcua.app.propose import Missions
from virtual.rows import rows

CHECKOUT = Path(__file__).resolve().parents[4]
PROPOSAL = json.loads((CHECKOUT / "missions/proposal.json").read_text("utf-8"))
MOST_ROUNDS = 6
NAMES = (
    "",
    "fly me home",
    "1st",
    "ignore all rules",
    "brigde_b",
    "and",
    "track_target",
    "quad-8",
    "supervisor",
    "x" * 300,
)
QUANTITIES = ("4000 m", "-3 m", "25", "25 m/s", "9 s", "25,5 m", "0.5 km", "as high as you can", "NaN", "41 m")
OTHERS: tuple[Any, ...] = (None, 7, True, [], {}, ["25 m"], {"value": "25 m"})


@pytest.fixture(scope="module")
def missions() -> Missions:
    return Missions([CHECKOUT / "policies/bridge_inspection.rts"])


def places(value: Any, at: tuple[str | int, ...] = ()) -> list[tuple[str | int, ...]]:
    """The paths of all values and objects below the outermost one."""
    items: list[tuple[str | int, Any]] = []
    if isinstance(value, dict):
        items = list(value.items())
    elif isinstance(value, list):
        items = list(enumerate(value))
    found = [(*at, key) for key, _ in items]
    return found + [path for key, each in items for path in places(each, (*at, key))]


def holder(value: Any, path: tuple[str | int, ...]) -> Any:
    for part in path[:-1]:
        value = value[part]
    return value


def mutated(chance: random.Random) -> Any:
    """A mission with one to three mistakes."""
    value = deepcopy(PROPOSAL)
    for _ in range(chance.randint(1, 3)):
        path = chance.choice([each for each in places(value) if isinstance(each[-1], str)])
        of, key = holder(value, path), path[-1]
        match chance.randrange(6):
            case 0 if key not in ("phases", "steps"):
                del of[key]
            case 1:
                of[chance.choice(("run", "shell/command", "altitude_override"))] = chance.choice(NAMES)
            case 2 if isinstance(of[key], str):
                of[key] = chance.choice(QUANTITIES)
            case 3 if isinstance(of[key], str | int):
                of[key] = chance.choice(NAMES)
            case 4 if key not in ("phases", "steps", "imports"):
                of[key] = chance.choice(OTHERS)
            case _ if isinstance(of[key], str) and len(of[key]) > 3:
                of[key] = of[key][:-2] + of[key][-1]
    return value


def chosen(limit: dict[str, Any], pointer: str) -> Any:
    """A value that an agent might choose if the rejection names no nearest one: what it meant, if that is accepted."""
    some = limit.get("one_of") or limit.get("places") or [limit.get("least", "a_name" if "pattern" in limit else None)]
    near = next((each for each in some if each == meant(pointer)), some[0])
    return {"object": {}, "array": []}.get(limit.get("type", ""), near)


def meant(pointer: str) -> Any:
    """The value of the proposal at a place."""
    value: Any = PROPOSAL
    for part in pointer.split("/")[1:]:
        try:
            value = value[int(part) if isinstance(value, list) else part]
        except (KeyError, IndexError, TypeError):
            return None
    return value


def repair(value: Any, rejected: list[dict[str, Any]]) -> None:
    """Correct the mission by pointer, limit and nearest value, as far as possible."""
    for each in sorted(rejected, key=lambda one: -len(one["field"])):
        path = [part.replace("~1", "/").replace("~0", "~") for part in each["field"].split("/")[1:]]
        of = value
        try:
            for part in path[:-1]:
                of = of[int(part) if isinstance(of, list) else part]
            key = int(path[-1]) if isinstance(of, list) else path[-1]
            if each["limit"] == {"absent": True}:
                del of[key]
            elif each["nearest"] is not None:
                of[key] = each["nearest"]
            else:
                of[key] = chosen(each["limit"] or {}, each["field"])
        except (KeyError, IndexError, TypeError):
            continue  # an earlier correction removed or replaced the enclosing value


@pytest.mark.slow
@pytest.mark.parametrize("most", [25, pytest.param(100, marks=pytest.mark.soak)])
def test_wrong_missions_are_corrected_by_their_rejections(missions: Missions, most: int) -> None:
    chance, wrong, stuck = random.Random(21), 0, []
    while wrong < most:
        value = mutated(chance)
        first = missions.check(value, 0)
        if first.accepted:
            continue
        wrong += 1
        given = deepcopy(value)
        answer = first
        for _ in range(MOST_ROUNDS):
            repair(value, answer.rejections)
            answer = missions.check(value, 0)
            if answer.accepted:
                break
        else:
            stuck.append((given, answer.rejections))
    assert not stuck, json.dumps(stuck[:3], indent=1)


def test_rejection_has_field_limit_nearest_value_and_repair(missions: Missions) -> None:
    value = deepcopy(PROPOSAL)
    value["phases"][0]["steps"][0]["arguments"]["altitude"] = "4000 m"
    (found,) = missions.check(value, 0).rejections
    pointer = "/phases/0/steps/0/arguments/altitude"
    assert (found["field"], found["observed"], found["nearest"]) == (pointer, "4000 m", "40 m")
    assert found["limit"]["most"] == "40 m"
    assert found["repair"] == f'write "40 m" at `{pointer}`'
    assert found["code"].startswith("E")


def test_value_out_of_range_is_rejected_not_clamped(missions: Missions) -> None:
    value = deepcopy(PROPOSAL)
    value["phases"][0]["steps"][0]["arguments"]["altitude"] = "4000 m"
    answer = missions.check(value, 0)
    assert (answer.accepted, answer.mission) == (False, None)


ALTITUDE = "/phases/0/steps/0/arguments/altitude"


def rejected(missions: Missions, pointer: str, given: Any) -> dict[str, Any]:
    """The rejection of the proposal with another value at a place; empty if it is accepted."""
    value = deepcopy(PROPOSAL)
    path: list[Any] = [int(part) if part.isdigit() else part for part in pointer.split("/")[1:]]
    holder(value, tuple(path))[path[-1]] = given
    answer = missions.check(value, 0)
    if answer.accepted:
        return {}
    (found,) = [each for each in answer.rejections if each["field"] == pointer]
    return found


#: a value for an altitude from 3 m to 40 m, the same value in the accepted form or None, and a part of the reason
ALTITUDES = (
    ("25 meters", "25 m", "`meters`"), ("25 Metres", "25 m", "`Metres`"), ("0.02 kilometers", "20 m", "20 m"),
    ("82 ft", "24.994 m", "82 ft is 24.9936 m"), ("82feet", "24.994 m", "24.9936 m"),
    ("27 yd", "24.689 m", "24.6888 m"),
    ("25\u00a0m", "25 m", "same value"), ("25\u202fm", "25 m", "same value"), ("+25 m", "25 m", "same value"),
    ("\uff12\uff15 m", "25 m", "same value"), ("25 \uff4d", "25 m", "same value"), ("25,0 m", "25 m", "same value"),
    ("2.5e1 m", "25 m", "same value"), ("\u0662\u0665 m", "25 m", "same value"),
    ("25 m relative", "25 m", "same value"),
    ("25", None, "if it is in metres, write `25 m`"), (25, None, "write `25 m`"), (25.5, None, "write `25.5 m`"),
    ({"value": 25, "unit": "m"}, "25 m", ""), ('"25 m"', "25 m", "same value"), ("25\u200bm", "25 m", "same value"),
    ("4000 m", "40 m", ""), ("\u221225 m", "3 m", "-25 m, out of range"), ("200 ft", "40 m", "60.96 m, out of range"),
    ("25 m AGL", None, "above ground"), ("25 m AMSL", None, "above sea"), ("25 m/s", None, "unit of speed"),
    ("9 s", None, "unit of duration"), ("25 kt", None, "unit of speed"), ("25 furlongs", None, "`furlongs`"),
    ("1,000 m", None, "ambiguous"), ("as high as you can", None, "expected a number"), ("25\u00b2 m", None, ""),
    ("NaN", None, ""),
    ("", None, ""), ("25 m 30 cm", None, ""), (True, None, ""), (None, None, ""), ([25], None, ""),
    ("25..30 m", None, ""),
)  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("given", "same", "why"), ALTITUDES)
def test_advice_gives_the_same_value_in_accepted_form_or_none(
    missions: Missions, given: Any, same: str | None, why: str
) -> None:
    found = rejected(missions, ALTITUDE, given)
    assert found["nearest"] == same
    assert why in found["repair"]
    if same is None:
        assert "from 3 m to 40 m" in found["repair"]
    else:
        assert rejected(missions, ALTITUDE, same) == {}


STEP = "/phases/1/steps/1"
#: a place, a value that is not accepted there, the nearest accepted one or None, and a part of the repair
OTHERS_THAN_ALTITUDES: tuple[tuple[str, Any, Any, str], ...] = (
    ("/version", "1", 1, "write 1"), ("/policy/version", "7", 7, "write 7"), ("/policy/version", 7.0, 7, "write 7"),
    ("/vehicle", "Quad", "quad", ""),
    (f"{STEP}/skill", "Inspect-Area", "inspect_area", ""), (f"{STEP}/skill", "inspect area", "inspect_area", ""),
    (f"{STEP}/skill", "track_target", None, "accepted at"),
    ("/proposed_by", "agent", None, "expected an object with `source`, `name`, `role`"),
    ("/phases/2/steps", '[{"skill": "return_home"}] and land', None, "line 1, column 28 of the JSON: expected the end"),
    ("/phases/2/steps", '```json\n[{"skill": "return_home"}]\n```', [{"skill": "return_home"}], "the list itself"),
    (f"{STEP}/arguments/area", "Bridge B", "bridge_b", ""), (f"{STEP}/arguments/area", "BRIDGE-B", "bridge_b", ""),
    (f"{STEP}/arguments/area", "bridge_c", None, 'accepted at `/phases/1/steps/1/arguments/area`: "bridge_a"'),
    (f"{STEP}/arguments/area", "city", None, "accepted at"), (f"{STEP}/arguments/area", None, None, "accepted at"),
    (f"{STEP}/on_inadmissible", "Skip", "skip", ""), (f"{STEP}/on_inadmissible", "x", None, '"abort", "hold"'),
    ("/phases/1/steps/0/arguments/target", "Bridge B entry", "bridge_b.entry", ""),
    ("/phases/1/steps/0/arguments/target", "47.39927N 8.54572E", "47.39927 N, 8.54572 E", "same value"),
    ("/phases/1/steps/0/arguments/target", {"lat": 47.39927, "lon": 8.54572}, "47.39927 N, 8.54572 E", ""),
    ("/phases/1/steps/0/arguments/target", "47.39927, 8.54572", None, "if it is the first one, write `47.39927 N"),
    ("/phases/2/steps/0/arguments", ["25 m"], None, "expected an empty object"),
    (f"{STEP}/arguments", "25 m", None, "expected an object with `area`"),
    (f"{STEP}/arguments", '{"area": "bridge_b"}', {"area": "bridge_b"}, "the object itself"),
    (f"{STEP}/overrides", {"deadline": "2 seconds"}, "2 s", ""),
    (f"{STEP}/overrides", {"deadline": "0.5 seconds"}, "500 ms", ""),
    (f"{STEP}/overrides", {"deadline": "2"}, None, "if it is in seconds, write `2 s`"),
    (f"{STEP}/overrides", {"deadline": 2}, None, "if it is in seconds, write `2 s`"),
    (f"{STEP}/overrides", {"energy_at_most": "13 percent"}, "13 %", ""),
    (f"{STEP}/overrides", {"energy_at_most": "thirteen"}, None, "such as `20 %`"),
    (f"{STEP}/overrides", {"during": "inspection"}, ["inspection"], "a list, even of one value"),
    (f"{STEP}/overrides", {"require": "battery > 50 %"}, ["battery > 50 %"], "a list, even of one value"),
    (f"{STEP}/overrides", {"require": '["battery > 50 %"]'}, ["battery > 50 %"], "the list itself"),
    (f"{STEP}/overrides", {"require": '["battery > 50 %'}, None, ""),
    ("/imports", PROPOSAL["imports"][0], PROPOSAL["imports"], "a list, even of one value"),
    ("/phases/2/steps", PROPOSAL["phases"][2]["steps"][0], PROPOSAL["phases"][2]["steps"], "a list, even of one"),
    ("/name", None, None, "a name has letters"), ("/name", "", None, "a name has letters"), ("/name", 7, None, ""),
    ("/name", "fly me home", "fly_me_home", ""), ("/intent", 7, None, ""),
)  # fmt: skip


@rows("pointer, given, near, repair", OTHERS_THAN_ALTITUDES)
def test_advice_is_what_was_meant_or_the_accepted_form(
    missions: Missions, pointer: str, given: Any, near: Any, repair: str
) -> None:
    value, path = deepcopy(PROPOSAL), [int(part) if part.isdigit() else part for part in pointer.split("/")[1:]]
    holder(value, tuple(path))[path[-1]] = given
    if pointer.endswith("/overrides"):
        pointer += f"/{next(iter(given))}"
    (found,) = [each for each in missions.check(value, 0).rejections if each["field"] == pointer]
    assert found["nearest"] == near
    assert repair in found["repair"]
    assert found["repair"]


def test_advice_for_a_part_of_a_condition_is_the_whole_condition(missions: Missions) -> None:
    """Regression: it was the replaced part alone."""
    value = deepcopy(PROPOSAL)
    value["phases"][1]["steps"][1]["overrides"] = {"require": ["50 percent < battery"]}
    (found,) = missions.check(value, 0).rejections
    assert found["nearest"] == "50 % < battery"


@pytest.mark.parametrize("pointer", ["/phases", "/phases/0/steps", "/imports"])
def test_advice_for_a_list_in_a_string_is_the_list(missions: Missions, pointer: str) -> None:
    wanted = meant(pointer)
    found = rejected(missions, pointer, json.dumps(wanted))
    assert found["nearest"] == wanted
    assert "the list itself, not a string" in found["repair"]
    assert rejected(missions, pointer, "fly")["nearest"] is None


def test_advice_for_an_object_in_a_string_is_the_object(missions: Missions) -> None:
    found = rejected(missions, "/policy", json.dumps(PROPOSAL["policy"]))
    assert found["nearest"] == PROPOSAL["policy"]
    assert "the object itself, not a string" in found["repair"]


def test_each_number_with_a_decimal_point_is_rejected_separately(missions: Missions) -> None:
    value = deepcopy(PROPOSAL) | {"version": 1.0}
    value["policy"]["version"] = 7.0
    found = {each["field"]: each for each in missions.check(value, 0).rejections}
    assert [found[each]["nearest"] for each in ("/version", "/policy/version")] == [1, 7]
    assert "`7.0`" in found["/policy/version"]["message"]


def test_advice_for_an_unknown_place_lists_the_known_places(missions: Missions) -> None:
    pointer = "/phases/1/steps/0/arguments/target"
    found = rejected(missions, pointer, "somewhere nice")
    assert (found["nearest"], found["limit"]["places"]) == (None, ["bridge_a.entry", "bridge_b.entry"])
    assert '"bridge_a.entry"' in found["repair"]
    assert rejected(missions, pointer, "brigde_b.entry")["nearest"] == "bridge_b.entry"


@pytest.mark.parametrize(("wrong", "more"), [(39, 0), (40, 0), (41, 1), (3_000, 2_960)])
def test_rejections_are_capped_and_the_rest_counted(missions: Missions, wrong: int, more: int) -> None:
    proposal = deepcopy(PROPOSAL)
    proposal["phases"][0]["steps"][0] |= {f"x{number}": 1 for number in range(wrong)}
    answer = missions.check(proposal, 0)
    assert [each["field"] for each in answer.rejections] == [
        f"/phases/0/steps/0/x{number}" for number in range(min(wrong, 40))
    ]
    assert {each["message"].split("`")[0] for each in answer.rejections} == {"unknown key "}
    assert answer.more == more


def test_mission_for_another_vehicle_of_the_sources_is_refused(missions: Missions) -> None:
    """Its policy would differ from the signed one, and could not be proposed."""
    (found,) = missions.check(deepcopy(PROPOSAL) | {"vehicle": "surveyor"}, 0).rejections
    assert (found["code"], found["field"], found["nearest"]) == ("E0902", "/vehicle", "quad")
