"""Threat: a witness receives two logs that differ in a signed record which it cosigned, after identical lines.

The checkpoint of n leaves covers the n lines before the record that carries it. A consistency proof therefore says
nothing about record n itself; the references of later checkpoints to earlier ones do.
"""

import json

import pytest

from reference.witnessed import LOG_KEY, ORIGIN, PUBLIC, Judge, Log
from rtshcua.evidence.finding import Finding
from rtshcua.evidence.note import Checkpoint, parse, sign, split
from rtshcua.evidence.verify import verify
from rtshcua.evidence.witnessing.anchors import AnchoredExtent, Anchors
from rtshcua.evidence.witnessing.submission import Submission, survey
from rtshcua.evidence.witnessing.witness import CONFLICT, FORBIDDEN, INCONSISTENT, CosignRequest, Declined, judge
from rtshcua.wire.keys import Duty


def shown(log: Log, witness: Judge, known: int | None = None) -> str | Declined:
    request = log.submission.request(known, len(log.lines))
    assert request is not None
    return witness.consider(request)


def refused(log: Log, witness: Judge, known: int | None) -> tuple[int, bool]:
    found = shown(log, witness, known)
    assert isinstance(found, Declined), found
    return found.status, found.contradiction


def later(log: Log) -> Log:
    """The same log a moment later, with the same keys: its next signed record has another text."""
    log.ms += 5
    return log


def grown(log: Log) -> Log:
    log.effects(2)
    log.seal()
    return log


def test_another_genesis_with_the_same_key_after_it() -> None:
    """The witness cosigned the genesis of one bundle; what grows on is a log of another."""
    one, other = Log(), Log(bundle=b"another bundle")
    assert one.lines[0] != other.lines[0]
    witness = Judge()
    assert isinstance(shown(one, witness), str)
    assert refused(grown(other), witness, 0) == (CONFLICT, True)
    assert isinstance(shown(grown(one), witness, 0), str)


def test_another_seal_by_the_same_key() -> None:
    one, other = Log(), Log()
    one.effects(3)
    other.effects(3)
    later(other)
    one.seal()
    other.seal()
    assert one.lines[:4] == other.lines[:4]
    assert one.lines[4] != other.lines[4]
    witness = Judge()
    assert isinstance(shown(one, witness), str)
    assert refused(grown(other), witness, 4) == (CONFLICT, True)


def test_another_recover_by_the_log_key() -> None:
    """The log key may sign again and again, so its note alone convicts nobody; but it is not cosigned."""
    one = Log()
    one.effects(3)
    other = one.fork()
    one.seal()
    witness = Judge()
    assert isinstance(shown(one, witness), str)
    later(other).recover()
    other.effects(2)
    other.recover()
    other.submission = Submission()
    for line in other.lines:
        other.submission.take(line)
    assert refused(other, witness, 4) == (INCONSISTENT, False)


def test_a_record_in_between_is_left_out() -> None:
    """A recover is signed by the log key, which any chain may end with: not if it leaves out the seal before it."""
    log, witness = Log(), Judge()
    assert isinstance(shown(log, witness), str)
    grown(log)
    log.effects(1)
    log.recover()
    request = log.submission.request(0, len(log.lines))
    assert request is not None
    found = witness.consider(request._replace(chain=()))
    assert isinstance(found, Declined)
    assert found.status == INCONSISTENT
    assert isinstance(witness.consider(request), str)


def test_a_genesis_that_follows_something() -> None:
    genesis = parse(split(Log().notes[0])[0])
    assert isinstance(genesis, Checkpoint)
    note = sign(genesis._replace(after=bytes(32)), LOG_KEY.public, lambda text: LOG_KEY.sign(text, duty=Duty.LOG))
    found = judge(CosignRequest(0, (), note), None, lambda vehicle: (LOG_KEY.public,))
    assert isinstance(found, Declined)
    assert found.status == FORBIDDEN


def test_cosigned_checkpoint_over_another_record_is_refused() -> None:
    """All keys are his: the later checkpoint names what the witness saw. Then it is the log that does not verify."""
    one, other = Log(), Log(bundle=b"another bundle")
    witness = Judge()
    assert isinstance(shown(one, witness), str)
    cosigned = parse(split(one.notes[0])[0])
    assert isinstance(cosigned, Checkpoint)
    other.recorder._head.after = cosigned.digest()
    grown(other)
    mark = shown(other, witness, 0)
    assert isinstance(mark, str), "it sees no lines over a link, and need not"
    failure = verify(other.lines).failure
    assert failure is not None
    assert (failure.slug, failure.record) == ("seal/after", 3)
    found = survey(other.lines)
    assert isinstance(found, Finding)
    assert (found.slug, found.record) == ("seal/after", 3)
    held = Anchors(ORIGIN, PUBLIC[:1], 1)
    assert [held.checkpoint(note) for note in one.notes] == [None]
    assert held.anchor(mark) is None
    assert not isinstance(held.finish(1), AnchoredExtent)


@pytest.mark.parametrize("number", [0, 3])
def test_survey_requires_signed_record_of_checkpoint(number: int) -> None:
    """A field of a signed record is edited, and its signature left: the tree of the lines before it is as it was."""
    log = grown(Log())
    fields = json.loads(log.lines[number])
    changed = {"bundle": "AAAA"} if number == 0 else {"at_us": fields["at_us"] + 1}
    line = json.dumps(fields | changed, ensure_ascii=False, separators=(",", ":"), sort_keys=True).encode() + b"\n"
    found = survey([*log.lines[:number], line])
    assert isinstance(found, Finding)
    assert (found.slug, found.record) == ("seal/self", number)
    found = survey([*log.lines[:number], log.lines[number].replace(b'"seq"', b'"sex"')])
    assert isinstance(found, Finding)
    assert found.slug == "record/malformed"
