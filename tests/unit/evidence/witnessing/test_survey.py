"""A log that a witness gets as a file."""

import pytest

from reference.witnessed import Judge, Log
from rtshcua.evidence.finding import Finding, Flaw
from rtshcua.evidence.witnessing.submission import Survey, request_of, survey
from rtshcua.evidence.witnessing.witness import CONFLICT, INCONSISTENT, Declined


def surveyed(log: Log) -> Survey:
    found = survey(log.lines)
    assert isinstance(found, Survey), found
    return found


def shown(log: Log, witness: Judge, known: int | None) -> str | Declined | Flaw:
    request = request_of(surveyed(log), known, lambda: log.lines)
    return request if isinstance(request, Flaw) else witness.consider(request)


@pytest.fixture
def log() -> Log:
    log = Log()
    for count in (3, 1, 0, 70):
        log.effects(count)
        log.seal()
    return log


def test_a_survey_finds_the_notes(log: Log) -> None:
    found = surveyed(log)
    assert list(found.notes.values()) == log.notes
    assert (found.records, found.size, found.origin) == (len(log.lines), 78, log.notes[0].split("\n")[0])
    torn = survey([*log.lines, b'{"_prev":"'])
    assert torn == found


def test_a_file_is_cosigned_in_one_step_from_wherever_the_witness_is(log: Log) -> None:
    for known in (None, *log.submission._sizes):
        witness = Judge()
        if known is not None:
            request = log.submission.request(None, known + 1)
            assert request is not None
            assert isinstance(witness.consider(request), str)
        mark = shown(log, witness, known)
        assert isinstance(mark, str)
        assert mark.startswith(log.notes[-1])


def test_a_log_that_is_not_its_checkpoints(log: Log) -> None:
    """As with Yeti 2022: everything is signed and consistent, but an entry differs from the signed one."""
    log.lines[10] = log.lines[10].replace(b"said", b"sand")
    found = survey(log.lines)
    assert isinstance(found, Finding)
    assert (found.slug, found.record) == ("seal/root", 78)


@pytest.mark.parametrize("more", [b"\n", b"{", b'{"_prev":""}\n'])
def test_survey_refuses_bytes_after_the_close(more: bytes) -> None:
    log = Log()
    log.effects(2)
    log.close()
    assert isinstance(survey(log.lines), Survey)
    found = survey([*log.lines, more])
    assert isinstance(found, Finding)
    assert (found.slug, found.record) == ("close/junk-after", len(log.lines))


def test_an_edited_field_of_a_signed_record_is_found(log: Log) -> None:
    """The tree of the lines before it is unchanged, but the checkpoint covers the record too."""
    edited = log.lines[4].replace(b'"epoch":0', b'"epoch":1')
    assert edited != log.lines[4]
    for line, slug in ((edited, "seal/self"), (log.lines[4].replace(b'"seq"', b'"sex"'), "record/malformed")):
        found = survey([*log.lines[:4], line])
        assert isinstance(found, Finding)
        assert (found.slug, found.record) == (slug, 4)


def test_a_checkpoint_that_follows_another_one_than_the_log_has_is_found() -> None:
    log = Log()
    log.recorder._head.after = bytes(32)
    log.effects(2)
    log.seal()
    found = survey(log.lines)
    assert isinstance(found, Finding)
    assert (found.slug, found.record) == ("seal/after", 3)


def test_survey_refuses_invalid_log(log: Log) -> None:
    for lines, slug in (
        ([], "genesis/missing"),
        (log.lines[1:4], "genesis/missing"),
        (log.lines[1:], "seal/root"),
        ([b'{"checkpoint":"x"}\n'], "genesis/missing"),
        ([b'{"a":1,"checkpoint":"x"}\n'], "note/malformed"),
    ):
        found = survey(lines)
        assert isinstance(found, Finding)
        assert found.slug == slug


def test_a_cut_and_another_log(log: Log) -> None:
    witness = Judge()
    assert isinstance(shown(log, witness, None), str)
    whole, log.lines = log.lines, log.lines[:60]
    found = shown(log, witness, 78)
    assert isinstance(found, Flaw)
    assert found.slug == "anchor/beyond"
    log.lines = whole
    found = shown(log, witness, 77)
    assert isinstance(found, Flaw)
    assert found.slug == "anchor/root"


def test_the_holder_of_the_log_key_rewrites_it(log: Log) -> None:
    witness = Judge()
    assert isinstance(shown(log, witness, None), str)
    other = Log()
    for count in (3, 1, 0, 70):
        other.effects(count, "landed")
        other.recover()
    found = shown(other, witness, 78)
    assert isinstance(found, Declined)
    assert (found.status, found.contradiction) == (CONFLICT, True)
    other.effects(1)
    other.recover()
    found = shown(other, witness, 78)
    assert isinstance(found, Declined)
    assert found.status in (CONFLICT, INCONSISTENT)
