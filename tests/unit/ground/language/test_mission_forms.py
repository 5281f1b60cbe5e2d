"""Missions, and the IR that they become."""

from collections.abc import Callable
from typing import Any

from rtshcua.model.ir.program import Unit

Read = Callable[[str], Unit]
Plain = Callable[[Any], Any]


def test_mission(plain: Plain, unit: Read) -> None:
    text = """mission m under p@7 on quad {
      intent "Look." proposed by agent openclaw for role operator
      phase a { goto(z.entry, 1 N, 2 E, altitude = 20 m,) on inadmissible skip look() on   inadmissible hold }
      phase b { land() on inadmissible abort land() }
      phase c { }
    }
    mission n under q@1 on quad { }
    """
    first, second = plain(unit(text).missions)
    assert second == {"name": "n", "policy": "q", "policy_version": 1, "vehicle": "quad"}
    assert first == {
        "name": "m",
        "policy": "p",
        "policy_version": 7,
        "vehicle": "quad",
        "intent": "Look.",
        "source": "agent",
        "proposer": "openclaw",
        "role": "operator",
        "phases": [
            {
                "name": "a",
                "items": [
                    {
                        "kind": "step",
                        "skill": "goto",
                        "arguments": [
                            {"value": "&z.entry"},
                            {"value": (10_000_000, 20_000_000)},
                            {"name": "altitude", "value": (20_000, "length")},
                        ],
                        "on_inadmissible": "skip",
                    },
                    {"kind": "step", "skill": "look", "on_inadmissible": "hold"},
                ],
            },
            {
                "name": "b",
                "items": [
                    {"kind": "step", "skill": "land", "on_inadmissible": "abort"},
                    {"kind": "step", "skill": "land", "on_inadmissible": "abort"},
                ],
            },
            {"name": "c"},
        ],
    }


def items(plain: Plain, unit: Read, text: str) -> Any:
    return plain(unit(f"mission m under p@1 on v {{ phase a {{ {text} }} }}").missions[0].phases[0].items)


def test_parameters_and_limits(plain: Plain, unit: Read) -> None:
    text = """mission m(area: zone = bridge_a, how: one of a, b = b, height: altitude in 5 m .. 30 m,)
      under p@7 on quad {
      lasts at most 20 min steps at most 40 energy at most 60 %
    }
    mission n() under p@7 on quad { }"""
    first, second = plain(unit(text).missions)
    assert second == {"name": "n", "policy": "p", "policy_version": 7, "vehicle": "quad"}
    assert first == {
        "name": "m",
        "policy": "p",
        "policy_version": 7,
        "vehicle": "quad",
        "parameters": [
            {"name": "area", "type": "zone", "default": "&bridge_a"},
            {"name": "how", "type": "choice", "choices": ["a", "b"], "default": "&b"},
            {
                "name": "height",
                "type": "altitude",
                "range": {"kind": "range", "low": (5_000, "length"), "high": (30_000, "length")},
            },
        ],
        "most_time": (1_200_000_000, "duration"),
        "most_energy": (6_000, "ratio"),
        "most_steps": 40,
    }


def test_repeat(plain: Plain, unit: Read) -> None:
    step = {"kind": "step", "skill": "a", "on_inadmissible": "abort"}
    assert items(plain, unit, "a() repeat 3 { a() repeat 2 { } } repeat 1_000{a()}") == [
        step,
        {"kind": "repeat", "count": (3, "count"), "items": [step, {"kind": "repeat", "count": (2, "count")}]},
        {"kind": "repeat", "count": (1_000, "count"), "items": [step]},
    ]


def test_overrides(plain: Plain, unit: Read) -> None:
    text = """hover(10 s) on inadmissible skip {
      deadline 2 s  valid for 10 min during a, b  lasts at most 12 s  grace 500 ms  energy at most 6 %
      require a > 1 and b > 2  assume c > 3  maintain d > 4  record effect, state
    }
    hover() { }
    """
    first, second = items(plain, unit, text)
    assert second == {"kind": "step", "skill": "hover", "on_inadmissible": "abort", "overrides": {}}
    found = first["overrides"]
    assert [len(found.pop(name)) for name in ("require", "assume", "maintain")] == [2, 1, 1]
    assert first == {
        "kind": "step",
        "skill": "hover",
        "arguments": [{"value": (10_000_000, "duration")}],
        "on_inadmissible": "skip",
        "overrides": {
            "deadline": (2_000_000, "duration"),
            "validity": (600_000_000, "duration"),
            "phases": ["a", "b"],
            "duration": (12_000_000, "duration"),
            "grace": (500_000, "duration"),
            "energy": (600, "ratio"),
            "record": ["effect", "state"],
        },
    }
