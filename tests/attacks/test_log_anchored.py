"""Threat: a holder of every key rewrites the whole log, or truncates it. Only a witness can show this."""

from base64 import b64decode, b64encode

import pytest

from reference import independent_verifier
from reference.forgery import edit, expect, read, signed
from reference.log_vectors import WITNESSES, anchor, close, effect, genesis, log, seal
from reference.verifiers import ROOT_KEY, WORDS
from rtshcua.evidence.report import LogReport, LogVerdict
from rtshcua.evidence.witnessing.anchors import notes
from rtshcua.ground.audit.audit import Auditor
from virtual.rows import rows

ONE, TWO, THREE = WITNESSES
LINES = log(genesis(), effect(10), seal(20, 1), effect(30), seal(40, 2), effect(50), close(60))
SEEN = 4  # the signed record that the witnesses saw, and so its size


def judged(lines: list[bytes], *anchors: str) -> LogReport:
    """The report of the audit, confirmed by the independent verifier."""
    auditor = Auditor(ROOT_KEY, derive=False, anchors=anchors)
    for line in lines:
        auditor.take(line)
    report = auditor.audit().report
    beside = "".join(f"{note}\n" for note in anchors).encode()
    word = independent_verifier.verify(b"".join(lines), ROOT_KEY, [beside])
    assert word.kind in WORDS[report.verdict], (word, report.failure)
    assert list(notes(beside.decode())) == list(anchors)
    return report


def found(lines: list[bytes], *anchors: str) -> str:
    failure = judged(lines, *anchors).failure
    assert failure is not None, "the forgery was not noticed"
    return failure.slug


def test_an_honest_log() -> None:
    report = judged(LINES, anchor(LINES[SEEN], [ONE, TWO]))
    assert report.verdict is LogVerdict.VERIFIED
    assert report.anchored == SEEN + 1
    assert judged(LINES, anchor(LINES[SEEN], [ONE])).anchored == 0, "two witnesses must have seen it"


@pytest.mark.parametrize("number", [1, 3])
def test_log_rewritten_with_all_keys_is_detected(number: int) -> None:
    forged = signed([*LINES[:number], edit(LINES[number], detail="rewritten"), *LINES[number + 1 :]])
    assert judged(forged).verdict is LogVerdict.VERIFIED, "without a witness nobody can tell"
    assert found(forged, anchor(LINES[SEEN], [ONE, TWO])) == "anchor/root"
    assert found(forged, anchor(LINES[SEEN], [ONE])) == "anchor/root", "one that saw it is enough to contradict"


def test_records_after_anchor_are_not_reported_as_anchored() -> None:
    forged = signed([*LINES[:5], edit(LINES[5], detail="rewritten"), *LINES[6:]])
    report = judged(forged, anchor(LINES[SEEN], [ONE, TWO]))
    assert (report.verdict, report.anchored) == (LogVerdict.VERIFIED, SEEN + 1)
    assert any("unanchored tail: 2 records" in claim.text for claim in report.unproven)


def test_log_truncated_with_all_keys_is_detected() -> None:
    short = log(genesis(), effect(10), close(20))
    assert judged(short).verdict is LogVerdict.VERIFIED
    assert found(short, anchor(LINES[SEEN], [ONE, TWO])) in ("anchor/beyond", "anchor/root")


def test_log_truncated_without_key_is_detected() -> None:
    assert judged(LINES[:3]).verdict is LogVerdict.INCOMPLETE
    assert found(LINES[:3], anchor(LINES[SEEN], [ONE, TWO])) == "anchor/beyond"
    assert judged(LINES[:6], anchor(LINES[SEEN], [ONE, TWO])).verdict is LogVerdict.INCOMPLETE


def test_log_truncated_before_anchor_is_detected() -> None:
    assert found(LINES[:SEEN], anchor(LINES[SEEN], [ONE, TWO])) == "anchor/beyond"


def test_another_record_over_the_same_lines() -> None:
    """The tree before the seal is the same, but the seal differs: the witness saw its hash too."""
    forged = log(genesis(), effect(10), seal(20, 1), effect(30), seal(41, 2), effect(50), close(60))
    assert found(forged, anchor(LINES[SEEN], [ONE, TWO])) == "anchor/root"


def test_a_rewrite_that_records_its_own_anchor() -> None:
    """The forger cannot make the witnesses sign again, and unknown witnesses do not count."""
    note = read(LINES[2])["checkpoint"]
    stranger = anchor(LINES[2], [ONE]).replace(ONE, "rtshcua/witness/9")
    for detail in (note, stranger):
        lines = log(genesis(), effect(10), seal(20, 1), effect(30, event="anchored", detail=detail), close(60))
        assert judged(lines).anchored == 0


def test_a_recorded_anchor_of_another_tree() -> None:
    """The log itself shows that it was rewritten."""
    other = log(genesis(), effect(10, detail="other"), seal(20, 1), close(30))
    detail = anchor(other[2], [ONE])
    lines = log(genesis(), effect(10), seal(20, 1), effect(30, event="anchored", detail=detail), close(60))
    assert found(lines) == "anchor/root"
    assert expect(lines)[0] == "anchor/root"


def test_an_anchor_of_another_log() -> None:
    """Another flight of the same vehicle has another origin, and is irrelevant to this one."""
    other = log(genesis(boot="22" * 16), effect(11), seal(20, 1), close(30))
    report = judged(LINES, anchor(other[2], [ONE, TWO]))
    assert (report.verdict, report.anchored) == (LogVerdict.VERIFIED, 0)


@rows("at", [0, 4, 11, 12, 40, 75])
def test_a_forged_cosignature(at: int) -> None:
    """Key id, time or signature changed: it anchors nothing, and nothing is said against the log. For the files of
    anchors are signed by nobody: whoever can write there would make a sound log fail.
    """
    head, _, blob = anchor(LINES[SEEN], [ONE]).rstrip("\n").rpartition(" ")
    octets = bytearray(b64decode(blob))
    octets[at] ^= 1
    forged = f"{head} {b64encode(bytes(octets)).decode()}\n"
    both = forged + anchor(LINES[SEEN], [TWO]).splitlines(keepends=True)[-1]
    auditor = Auditor(ROOT_KEY, derive=False, anchors=[both])
    for line in LINES:
        auditor.take(line)
    report = auditor.audit().report
    assert report.anchored == 0
    assert report.failure is None
    said = "anchor/signature" in [claim.slug for claim in report.unproven]
    assert said == (at >= 4), "a line of nobody we know is passed over without a word"


def test_two_cosignatures_of_one_witness_count_once() -> None:
    twice = anchor(LINES[SEEN], [ONE, ONE])
    assert judged(LINES, twice, anchor(LINES[SEEN], [ONE])).anchored == 0


def test_one_of_two_witnesses_colludes() -> None:
    """It cosigned two trees: its cosignature of the other one contradicts the log."""
    other = log(genesis(), effect(10, detail="other"), seal(20, 1), close(30))
    assert found(LINES, anchor(LINES[SEEN], [ONE, TWO]), anchor(other[2], [TWO])) == "anchor/root"
