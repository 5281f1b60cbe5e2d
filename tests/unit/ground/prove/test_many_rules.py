"""The effort of comparing the rules of a policy is linear in their number, and limited."""

from collections.abc import Callable
from pathlib import Path

import pytest

from reference.many_rules import KINDS, policy
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import examine_program
from rtshcua.ground.prove import rule_checks, ruleset
from rtshcua.ground.prove.proof_context import ProofContext
from rtshcua.ground.prove.ruleset import Ruleset
from rtshcua.mavlink import dialect

LIBRARY = str(Path(__file__).resolve().parents[4])
FEW, TIMES, GROWTH = 60, 4, 1.5

Check = Callable[[str], tuple[int, tuple[Diagnostic, ...]]]


@pytest.fixture
def effort(monkeypatch: pytest.MonkeyPatch) -> Check:
    """Return the effort for the rules of a source, and the findings."""
    made: list[Ruleset] = []

    class Kept(Ruleset):
        def __init__(self, ground: ProofContext) -> None:
            super().__init__(ground)
            made.append(self)

    monkeypatch.setattr(rule_checks, "Ruleset", Kept)

    def check(text: str) -> tuple[int, tuple[Diagnostic, ...]]:
        program = load(["x.rts"], lambda path: text.encode() if path == "x.rts" else Path(path).read_bytes(), LIBRARY)
        found = examine_program(program, dialect.load()).diagnostics
        return made[-1].effort, found

    return check


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_effort_is_linear_in_the_number_of_rules(effort: Check, kind: str) -> None:
    few, _ = effort(policy(kind, FEW))
    many, _ = effort(policy(kind, FEW * TIMES))
    assert many <= max(few, FEW // 4) * TIMES * GROWTH


def test_exceeded_effort_limit_is_reported(effort: Check, monkeypatch: pytest.MonkeyPatch) -> None:
    text = policy("nested", FEW)
    took, whole = effort(text)
    assert "E1103" not in [each.code.id for each in whole]
    monkeypatch.setattr(ruleset, "MOST_EFFORT", took // 2)
    monkeypatch.setattr(rule_checks, "MOST_EFFORT", took // 2)
    _, found = effort(text)
    assert [each.message for each in found if each.code.id == "E1103"] == [
        "the rules of `many` were not all compared with each other: the analysis stopped at its limit of "
        f"{took // 2} steps"
    ]
    assert len(found) < len(whole)
