"""A correct specification, and a function that compiles one."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.ground.agent.specification import load_specification
from rtshcua.ground.pipeline.program import Compiled, compile_program
from rtshcua.mavlink import dialect

CHECKOUT = Path(__file__).resolve().parents[4]

Compile = Callable[[str | bytes], tuple[Compiled, tuple[Diagnostic, ...]]]


@pytest.fixture
def good() -> dict[str, Any]:
    """The standard mission as a specification."""
    return {
        "format": "rtshcua/mission-spec",
        "version": 1,
        "name": "standard",
        "imports": ["lib:policies/bridge_inspection.rts"],
        "policy": {"name": "bridge_inspection", "version": 7},
        "vehicle": "quad",
        "intent": "Inspect bridge A.",
        "proposed_by": {"source": "agent", "name": "openclaw", "role": "operator"},
        "phases": [
            {"name": "departure", "steps": [{"skill": "takeoff", "arguments": {"altitude": "20 m"}}]},
            {
                "name": "inspection",
                "steps": [
                    {"skill": "goto", "arguments": {"target": "bridge_a.entry", "altitude": "20 m"}},
                    {
                        "skill": "inspect_area",
                        "arguments": {
                            "area": "bridge_a",
                            "altitude": "15 m",
                            "pattern": "perimeter",
                            "speed": "2.5 m/s",
                        },
                        "on_inadmissible": "skip",
                    },
                ],
            },
            {"name": "recovery", "steps": [{"skill": "return_home"}]},
        ],
    }


@pytest.fixture
def compile_text() -> Compile:
    """Compile the text of a specification with the shipped library; the findings have pointers."""

    def run(text: str | bytes) -> tuple[Compiled, tuple[Diagnostic, ...]]:
        data = text.encode() if isinstance(text, str) else text

        def read(path: str) -> bytes:
            return data if path == "spec.json" else Path(path).read_bytes()

        program, specification = load_specification("spec.json", [], read, str(CHECKOUT))
        compiled = compile_program(program, dialect.load(), mission=None, issued_at_us=0)
        return compiled, specification.pointed(compiled.diagnostics)

    return run


@pytest.fixture
def dumped() -> Callable[[Any], str]:
    """A specification as text."""
    return lambda value: json.dumps(value, indent=1)
