"""Wrong missions are put right by a repairer that knows no code: by pointer, limit and nearest."""

import json
import random
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest

from rtshcua import library
from rtshcua.adapters.mcp_server.missions import Missions

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
    return Missions([CHECKOUT / "policies/bridge_inspection.rts"], str(library.root()))


def places(value: Any, at: tuple[str | int, ...] = ()) -> list[tuple[str | int, ...]]:
    """The paths of all values and objects, the outermost left out."""
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
    """A mission with one to three things wrong about it."""
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


def repair(value: Any, rejected: list[dict[str, Any]]) -> None:
    """Put right what can be, by pointer, limit and nearest."""
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
        except (KeyError, IndexError, TypeError):
            continue  # what was put right around it took it along


@pytest.mark.parametrize("most", [25, pytest.param(100, marks=pytest.mark.soak)])
def test_wrong_missions_are_put_right(missions: Missions, most: int) -> None:
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


def test_a_rejection_says_all_that_a_repair_needs(missions: Missions) -> None:
    value = deepcopy(PROPOSAL)
    value["phases"][0]["steps"][0]["arguments"]["altitude"] = "4000 m"
    (found,) = missions.check(value, 0).rejections
    pointer = "/phases/0/steps/0/arguments/altitude"
    assert (found["field"], found["observed"], found["nearest"]) == (pointer, "4000 m", "40 m")
    assert found["limit"]["most"] == "40 m"
    assert found["repair"] == f'write "40 m" at `{pointer}`'
    assert found["code"].startswith("E")


def test_nothing_is_clamped_silently(missions: Missions) -> None:
    value = deepcopy(PROPOSAL)
    value["phases"][0]["steps"][0]["arguments"]["altitude"] = "4000 m"
    answer = missions.check(value, 0)
    assert (answer.accepted, answer.mission) == (False, None)
