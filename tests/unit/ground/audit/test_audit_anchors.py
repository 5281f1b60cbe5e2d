"""Anchors in an audit: how far a log is witnessed, and detection of a log that its own signers rewrote or truncated."""

import json
from collections.abc import Sequence

import pytest

from reference.forgery import ROOT_KEY, edit, flight, signed
from reference.marked import mark, note_of
from reference.sealed_log import sealed_log
from rtshcua.evidence.witnessing.anchors import ANCHORED
from rtshcua.ground.audit.audit import Audit, audit
from rtshcua.wire.keys import Duty, SigningKey

STRANGER = SigningKey.from_seed(bytes([99]) * 32, duty=Duty.WITNESS, development=True)


def signers(lines: Sequence[bytes]) -> list[int]:
    return [number for number, line in enumerate(lines) if "checkpoint" in json.loads(line)]


def audited(lines: Sequence[bytes], *anchors: str) -> Audit:
    return audit(lines, ROOT_KEY, anchors=anchors)


def failure(lines: Sequence[bytes], *anchors: str) -> str:
    found = audited(lines, *anchors).report.failure
    assert found is not None
    return found.slug


def test_log_is_anchored_as_far_as_the_witness_cosigned() -> None:
    lines = flight()
    for number in signers(lines):
        report = audited(lines, mark(note_of(lines, number))).report
        assert report.failure is None
        assert report.anchored == number + 1
        assert ("anchor" in [claim.slug for claim in report.unproven]) == (number + 1 < len(lines))
        assert "anchor" in [claim.slug for claim in report.proven]


def test_untrusted_witness_anchors_nothing() -> None:
    lines = flight()
    for anchors in ((), (mark(note_of(lines, 0), STRANGER),), (mark(note_of(sealed_log().lines, 0)),), ("no note",)):
        report = audited(lines, *anchors).report
        assert (report.failure, report.anchored) == (None, 0)


def test_log_rewritten_with_all_its_keys_contradicts_the_witness() -> None:
    lines = list(flight())
    last = signers(lines)[-2]
    seen = mark(note_of(lines, last))
    number = next(number for number, line in enumerate(lines) if b'"type":"effect"' in line)
    forged = signed(
        [*lines[:number], edit(lines[number], at_us=json.loads(lines[number])["at_us"] + 1), *lines[number + 1 :]]
    )
    assert audited(forged).report.failure is None
    assert failure(forged, seen) == "anchor/root"
    found = audited(forged, seen).report
    assert found.failure is not None
    assert (found.failure.record, found.shortfall) == (last, None)
    assert found.failure.offset == sum(map(len, forged[:last]))
    assert [claim.slug for claim in found.unproven] == ["log"]


@pytest.mark.parametrize("closed", [True, False])
def test_truncated_log_contradicts_the_witness(closed: bool) -> None:
    lines = list(flight())
    middle, last = signers(lines)[3], signers(lines)[-2]
    cut = signed([*lines[:middle], lines[-1]]) if closed else lines[:middle]
    assert audited(cut).report.failure is None
    assert failure(cut, mark(note_of(lines, last))) == "anchor/beyond"


def test_anchors_in_the_log_itself_count() -> None:
    lines = list(flight())
    number = signers(lines)[1]
    before = signed(lines)
    at = json.loads(before[number + 1])
    effect = edit(lines[1], event=ANCHORED, detail=mark(note_of(before, number)), **{
        name: at[name] for name in ("at_us", "utc_us", "utc_error_us")
    })  # fmt: skip
    whole = signed([*before[: number + 1], effect, *before[number + 1 :]])
    assert audited(whole).report.failure is None
    assert audited(whole).report.anchored == number + 1
    good = mark(note_of(lines, number))
    wrong = edit(effect, detail=f"{good[:-20]}{'A' if good[-20] != 'A' else 'B'}{good[-19:]}")  # in the cosignature
    assert audited(signed([*before[: number + 1], wrong, *before[number + 1 :]])).report.anchored == 0


def test_contradicted_anchor_is_reported_before_wrong_records() -> None:
    lines = list(flight())
    number = next(number for number, line in enumerate(lines) if b'"type":"decision"' in line)
    forged = signed([*lines[:number], edit(lines[number], outcome="deny"), *lines[number + 1 :]])
    assert failure(forged) == "decision/outcome"
    assert failure(forged, mark(note_of(lines, signers(lines)[-1]))) == "anchor/root"
    broken = [*forged[:2], edit(forged[2], token=9), *forged[3:]]
    assert failure(broken, mark(note_of(lines, signers(lines)[-1]))) == "chain/broken"


def test_forged_cosignature_is_reported() -> None:
    lines = flight()
    note = mark(note_of(lines, 0))
    forged = note[:-8] + ("A" if note[-8] != "A" else "B") + note[-7:]
    found = audited(lines, forged).report
    assert found.failure is None or found.failure.slug.startswith("anchor/")
    assert found.anchored == 0
