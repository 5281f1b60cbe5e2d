"""The text of the policy report of the shipped policy.

`UPDATE_GOLDENS=1 pytest tests/golden/report` writes it anew; read the difference before you keep it.
"""

import os
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import examine_program
from rtshcua.ground.report.policy_report import ReportPart, policy_report
from rtshcua.mavlink import dialect

CHECKOUT = Path(__file__).resolve().parents[3]
POLICY = CHECKOUT / "policies" / "bridge_inspection.rts"
GOLDEN = Path(__file__).with_name("bridge_inspection.txt")
#: what changes with every byte of a source
LEFT_OUT = {"digest", "files", "place", "made_at"}


def lines(value: Any, depth: int = 0, name: str = "") -> Iterator[str]:
    """The texts of a value, by the names of what they are."""
    indent = "  " * depth
    if isinstance(value, dict):
        if name:
            yield f"{indent}{name}"
        for key, each in value.items():
            if key not in LEFT_OUT:
                yield from lines(each, depth + bool(name), key)
    elif isinstance(value, (list, tuple)):
        for each in value:
            yield from lines(each, depth, name)
    elif isinstance(value, str) and value:
        yield f"{indent}{name}: {value}"


def test_report_of_the_shipped_policy_matches_the_golden() -> None:
    program = load([str(POLICY)], lambda name: Path(name).read_bytes(), str(CHECKOUT))
    checked = examine_program(program, dialect.load())
    part = ReportPart(program, checked.policies, (), checked.diagnostics)
    found = "\n".join(lines(asdict(policy_report([part], made_at_us=0, made_by="")))) + "\n"
    if os.environ.get("UPDATE_GOLDENS"):
        GOLDEN.write_text(found, encoding="utf-8")
    assert found == GOLDEN.read_text(encoding="utf-8")
