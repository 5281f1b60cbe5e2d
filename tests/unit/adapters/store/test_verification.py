"""Quick, parallel, byte-based and line-by-line verification of a log file agree."""

from pathlib import Path

import pytest

from reference.forgery import ROOT_KEY, edit, flight, signed
from rtshcua.adapters.store import verification
from rtshcua.adapters.store.verification import VerificationInputs, verify_carefully, verify_quickly
from rtshcua.evidence.records import AnyRecord
from rtshcua.evidence.report import LogVerdict
from virtual import case

ASKED = VerificationInputs(ROOT_KEY)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "log.jsonl"
    path.write_bytes(b"".join(flight()))
    return path


def test_every_way_comes_to_the_same(log: Path) -> None:
    careful = verify_carefully(log, ASKED, derive=False).report
    assert careful.verdict is LogVerdict.VERIFIED
    for found in (
        verify_quickly(log, ASKED),
        verify_quickly(log, ASKED, fast=True),
        verify_quickly(log, ASKED, jobs=3),
    ):
        report = found.report
        assert (report.verdict, report.records, report.epochs) == (LogVerdict.VERIFIED, careful.records, careful.epochs)
        assert report.root in (b"", careful.root)
        assert [claim.slug for claim in report.proven[:2]] == ["trust", "bundle"]


def test_several_processes_share_the_segments(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(verification, "_GROUP", 2)
    report = verify_quickly(log, ASKED, jobs=2).report
    assert report.verdict is LogVerdict.VERIFIED
    assert "form" in [claim.slug for claim in report.unproven]
    lines = list(flight())
    lines[9] = edit(lines[9], at_us=0)
    log.write_bytes(b"".join(lines))
    assert verify_quickly(log, ASKED, jobs=2).report.failure is not None


def test_quick_verification_names_same_fault_as_careful(log: Path) -> None:
    lines = list(flight())
    for number in range(len(lines)):
        changed = [*lines[:number], edit(lines[number], utc_error_us=7), *lines[number + 1 :]]
        log.write_bytes(b"".join(changed))
        expected = verify_carefully(log, ASKED, derive=False).report.failure
        assert expected is not None
        assert verify_quickly(log, ASKED).report.failure == expected
        assert verify_quickly(log, ASKED, fast=True).report.failure == expected


def test_an_incomplete_log_is_read_line_by_line(log: Path) -> None:
    log.write_bytes(b"".join(flight()[:-1]))
    assert verify_quickly(log, ASKED).report.verdict is LogVerdict.INCOMPLETE
    log.write_bytes(b"")
    assert verify_quickly(log, ASKED).report.verdict is LogVerdict.FAILED


def test_trust_and_bundle_are_looked_at_too(log: Path) -> None:
    for asked, slug in (
        (VerificationInputs(bytes(32)), "trust/root-unknown-key"),
        (VerificationInputs(ROOT_KEY, bundle=case.seal(case.mission())), "genesis/other-bundle"),
    ):
        for fast in (False, True):
            failure = verify_quickly(log, asked, fast=fast).report.failure
            assert failure is not None
            assert failure.slug == slug
    assert (
        verify_quickly(
            log, VerificationInputs(ROOT_KEY, bundle=case.seal(case.mission(case.short_steps())))
        ).report.failure
        is None
    )


def test_a_segment_that_is_too_long_is_read_line_by_line(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(verification, "LONGEST_SEGMENT", 100)
    for fast in (False, True):
        report = verify_quickly(log, ASKED, fast=fast).report
        assert report.verdict is LogVerdict.VERIFIED
        assert "decision" in report.counts


def test_many_pieces_make_one_digest(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(verification, "_PIECE", 333)
    report = verify_quickly(log, ASKED, fast=True).report
    assert "octets" in [claim.slug for claim in report.proven]


def test_progress_is_told(log: Path) -> None:
    told: list[int] = []
    verify_quickly(log, ASKED, progress=told.append)
    assert told[0] == 0
    assert told == sorted(told)
    assert len(told) == 8
    verify_carefully(log, ASKED, derive=True, progress=told.append)
    assert len(told) == 9


def test_each_sound_record_is_handed_on(log: Path) -> None:
    records: list[AnyRecord] = []
    verify_carefully(log, ASKED, derive=True, each=records.append)
    assert [record.seq for record in records] == list(range(len(flight())))
    lines = list(flight())
    log.write_bytes(b"".join([*lines[:5], b"{}\n", *lines[6:]]))
    records.clear()
    verify_carefully(log, ASKED, derive=True, each=records.append)
    assert [record.seq for record in records] == list(range(5))


def test_signed_forgery_is_found_only_line_by_line(log: Path) -> None:
    lines = list(flight())
    log.write_bytes(b"".join(signed([*lines[:3], edit(lines[3], outcome="deny"), *lines[4:]])))
    assert verify_quickly(log, ASKED).report.verdict is LogVerdict.VERIFIED
    failure = verify_carefully(log, ASKED, derive=True).report.failure
    assert failure is not None
    assert failure.slug == "decision/outcome"
