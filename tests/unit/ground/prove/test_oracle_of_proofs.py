"""The compiler's proofs compared with an oracle by dense sampling: no missed error, no false error (ADR 55)."""

import ast
from collections.abc import Iterable
from pathlib import Path

import pytest

from reference import flown_densely
from reference.flown_densely import MIDNIGHT, Drawn, draw, judged
from reference.sources import LIBRARY
from rtshcua.decision.prepare import prepare
from rtshcua.decision.values import FALSE, MISSING, TRUE, point
from rtshcua.diagnostics.codes import Severity
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import check_program, compile_program
from rtshcua.mavlink import dialect
from rtshcua.model.flat.contract import MotionKind


def refused_on_board(program: Drawn) -> list[str] | None:
    """Return the places from which the boundary would refuse the proved return of a program; None if it has errors.

    Zones that exist only at times are ignored.
    """

    def read(path: str) -> bytes:
        return program.text.encode() if path == "probe.rts" else Path(path).read_bytes()

    issued = (program.issued or MIDNIGHT) * 1_000_000
    made = compile_program(load(["probe.rts"], read, LIBRARY), dialect.load(), mission=None, issued_at_us=issued)
    if made.policy is None or made.mission is None:
        return None
    prepared = prepare(made.policy)
    assert not isinstance(prepared, Refusal)
    if prepared.airspace is None:
        return []
    home, known = prepared.contingency[0], prepared.tables.known
    assert home.motion == MotionKind.HOME
    wrong = []
    for leg in program.legs:
        for part in range(5):
            x, y, _ = (a + (b - a) * part / 4 for a, b in zip(leg.start, leg.end, strict=True))
            for height in {leg.start[2], leg.end[2], (leg.start[2] + leg.end[2]) / 2}:
                slots = [MISSING] * (made.policy.slots + 1)
                for slot, metres in ((known.x, x), (known.y, y), (known.height, height)):
                    slots[slot] = point(round(1_000 * metres))
                place = home.planner.volume(slots, known).place
                inside = (place.inside(each) == TRUE for each in prepared.airspace.inside if each.times is None)
                outside = (place.inside(each) == FALSE for each in prepared.airspace.outside if each.times is None)
                if not (all(inside) and all(outside)):
                    wrong.append(f"{x:.1f} m east, {y:.1f} m north, {height:.0f} m up")
    return wrong


@pytest.mark.slow
def test_proved_return_is_allowed_on_board_from_the_whole_path() -> None:
    found = {seed: refused_on_board(draw(seed)) for seed in range(40)}
    accepted = {seed: wrong for seed, wrong in found.items() if wrong is not None}
    assert len(accepted) > 5
    assert {seed: wrong for seed, wrong in accepted.items() if wrong} == {}


def errors(program: Drawn) -> list[str]:
    """Return the errors found by compiling a program for its time of issue, or by checking it without one."""

    def read(path: str) -> bytes:
        return program.text.encode() if path == "probe.rts" else Path(path).read_bytes()

    loaded = load(["probe.rts"], read, LIBRARY)
    if program.issued:
        issued = program.issued * 1_000_000
        found = compile_program(loaded, dialect.load(), mission=None, issued_at_us=issued).diagnostics
    else:
        found = check_program(loaded, dialect.load())
    return [f"{each.code.id} {each.message}" for each in found if each.code.severity is Severity.ERROR]


def compared(seeds: Iterable[int]) -> tuple[list[bool | None], list[str]]:
    """Return the verdicts of the oracle on the programs of seeds, and the disagreements."""
    judgements, wrong = [], []
    for seed in seeds:
        program = draw(seed)
        good, found = judged(program), errors(program)
        judgements.append(good)
        if good is not None and good == bool(found):
            wrong.append(f"seed {seed}: " + (f"false refusal, {found}" if good else "false `no errors`"))
    return judgements, wrong


@pytest.mark.slow
def test_proofs_agree_with_dense_sampling_on_some_programs() -> None:
    judgements, wrong = compared(range(25))
    assert judgements.count(True) > 5
    assert judgements.count(False) > 5
    assert wrong == []


@pytest.mark.soak
@pytest.mark.parametrize("hundred", range(50))
def test_proofs_agree_with_dense_sampling_on_5000_programs(hundred: int) -> None:
    assert compared(range(100 * hundred, 100 * hundred + 100))[1] == []


def test_oracle_shares_no_code_with_the_proofs() -> None:
    tree = ast.parse(Path(flown_densely.__file__).read_text())
    imported = [each for each in ast.walk(tree) if isinstance(each, ast.Import | ast.ImportFrom)]
    names = {each.module if isinstance(each, ast.ImportFrom) else each.names[0].name for each in imported}
    assert names == {"collections.abc", "math", "random", "typing", "numpy"}
