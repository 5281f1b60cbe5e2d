"""Shipped sources are parsed without findings, at any time and in any folder."""

import os
from pathlib import Path

import pytest

from rtshcua.ground.language.load import Program, load
from rtshcua.model.ir.expression import Reference
from rtshcua.model.ir.node import Node


def program(checkout: Path, *paths: str) -> Program:
    found = load(
        [str(checkout / path) for path in paths], lambda path: Path(path).read_bytes(), str(checkout), os.listdir
    )
    assert found.diagnostics == ()
    return found


def references(node: Node) -> list[str]:
    found = [node.name] if isinstance(node, Reference) else []
    for field in type(node).__struct_fields__:
        value = getattr(node, field)
        for child in value if isinstance(value, tuple) else (value,):
            if isinstance(child, Node):
                found += references(child)
    return found


@pytest.mark.parametrize(("name", "steps"), [("short", 3), ("standard", 6), ("extended", 12), ("one_bridge", 4)])
def test_shipped_missions_are_parsed(checkout: Path, name: str, steps: int) -> None:
    found = program(checkout, f"missions/{name}.rts")
    (mission,) = [mission for unit in found.units for mission in unit.missions]
    assert mission.name.text == name
    assert sum(len(phase.steps) for phase in mission.phases) == steps
    assert "local time" not in {text for unit in found.units for text in references(unit)}


def test_shipped_sources_are_parsed_together(checkout: Path) -> None:
    paths = [str(path) for folder in ("skills", "policies", "missions") for path in (checkout / folder).glob("*.rts")]
    found = program(checkout, *paths)
    assert len(found.units) == len(paths)
    assert {policy.name.text for unit in found.units for policy in unit.policies} == {
        "bridge_inspection",
        "training_field",
    }
    assert {skill.name.text for unit in found.units for skill in unit.skills} == {
        "takeoff", "hover", "goto", "inspect_area", "return_home", "emergency_land",
        "photograph_area", "photograph_structure", "release_load",
    }  # fmt: skip
    assert {signal.name.text for unit in found.units for signal in unit.signals} >= {"position", "height", "battery"}
    assert set(found.stable.values()) == {"lib:" + str(Path(path).relative_to(checkout)) for path in paths}
