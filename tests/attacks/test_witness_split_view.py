"""Threat: a holder of the vehicle's keys shows different logs to different people, and a witness may lie in his
favour.

The forger has every key of the log, from the log key to the present epoch's, and the key of one witness.
"""

import pytest

from reference.witnessed import ORIGIN, PUBLIC, WITNESSES, Judge, Log
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.witnessing.anchors import AnchoredExtent, Anchors
from rtshcua.evidence.witnessing.witness import CONFLICT, INCONSISTENT, Declined


def show(log: Log, witness: Judge, known: int | None = None) -> str | Declined:
    """Show the whole log to a witness that is at `known`."""
    request = log.submission.request(known, len(log.lines))
    assert request is not None
    return witness.consider(request)


def anchored(log: Log, witness: Judge, known: int | None = None) -> str:
    found = show(log, witness, known)
    assert isinstance(found, str), found
    return found


def audit(log: Log, anchors: list[str], threshold: int = 2) -> AnchoredExtent | Flaw:
    held = Anchors(ORIGIN, PUBLIC[:2], threshold)
    for note in log.notes:
        if (flaw := held.checkpoint(note)) is not None:
            return flaw
    for note in anchors:
        if (flaw := held.anchor(note)) is not None:
            return flaw
    return held.finish(len(log.lines))


def slug(log: Log, anchors: list[str], threshold: int = 2) -> str:
    found = audit(log, anchors, threshold)
    assert isinstance(found, Flaw), found
    return found.slug


def records(log: Log, anchors: list[str], threshold: int = 2) -> int:
    found = audit(log, anchors, threshold)
    assert isinstance(found, AnchoredExtent), found
    return found.records


@pytest.fixture
def futures() -> tuple[Log, Log]:
    """Two logs that are equal up to record 4."""
    flown = Log()
    flown.effects(3)
    flown.seal()
    told = flown.fork()
    for log, event in ((flown, "said"), (told, "landed")):
        log.effects(4, event)
        log.seal()
    return flown, told


def test_split_view_to_two_witnesses_is_detected(futures: tuple[Log, Log]) -> None:
    """Each cosigns what it saw, for neither saw both; but no future has two, and both anchors together convict."""
    flown, told = futures
    marks = [anchored(flown, Judge()), anchored(told, Judge(WITNESSES[1]))]
    for log, mark in zip(futures, marks, strict=True):
        assert records(log, [mark]) == 0
        assert slug(log, marks) == "anchor/root"


def test_split_view_to_one_witness_is_refused(futures: tuple[Log, Log]) -> None:
    flown, told = futures
    witness = Judge()
    anchored(flown, witness)
    for known in (None, 4, 9):
        request = told.submission.request(known, 10)
        if request is not None:
            assert isinstance(witness.consider(request), Declined)
    told.effects(5)
    told.recover()
    refusal = show(told, witness, 9)
    assert isinstance(refusal, Declined)
    assert refusal.status == INCONSISTENT


def test_retracted_history_is_refused(futures: tuple[Log, Log]) -> None:
    """Rollback: back to the fork, and on from there. The witness does not go back, and the anchor does not go away."""
    flown, _ = futures
    witness = Judge()
    early = Log()
    early.effects(3)
    early.seal()
    mark = anchored(flown, witness)
    refusal = show(early, witness)
    assert isinstance(refusal, Declined)
    assert (refusal.status, refusal.size) == (CONFLICT, 9)
    assert slug(early, [mark]) == "anchor/beyond"
    early.effects(9)
    early.close()
    assert slug(early, [mark], 1) == "anchor/root"


def test_split_view_of_one_witness_is_detected(futures: tuple[Log, Log]) -> None:
    """It cosigns both futures, and a later end of the forged one. The honest witness's anchor reveals it."""
    flown, told = futures
    honest, liar = Judge(), Judge(WITNESSES[1])
    marks = [anchored(flown, honest), liar.blindly(flown.notes[-1])]
    assert records(flown, marks) == 10
    told.effects(2)
    told.close()
    lies = [liar.blindly(note) for note in told.notes]
    assert records(told, lies) == 0, "one is not two"
    assert records(told, lies, 1) == len(told.lines), "who trusts one alone is told what that one says"
    assert slug(told, [*lies, marks[0]]) == "anchor/root"
    assert slug(told, [*lies, marks[0]], 1) == "anchor/root"
    # A liar can also accuse: that is loud, and the witness is named.
    found = audit(flown, [*marks, lies[-2]])
    assert isinstance(found, Flaw)
    assert f"rtshcua/witness/{liar.key.kid.hex()}" in found.text


def test_lying_witness_counts_once(futures: tuple[Log, Log]) -> None:
    flown, _ = futures
    liar = Judge(WITNESSES[1])
    assert records(flown, [liar.blindly(note) for note in flown.notes] * 2) == 0
    twice = liar.blindly(flown.notes[-1])
    again = liar.blindly(flown.notes[-1]).removeprefix(flown.notes[-1])
    assert records(flown, [twice + again]) == 0


def test_a_cosignature_moved_to_another_checkpoint(futures: tuple[Log, Log]) -> None:
    flown, told = futures
    mark = anchored(flown, Judge())
    cosignature = mark.removeprefix(flown.notes[-1])
    for log, note in ((told, told.notes[-1]), (flown, flown.notes[1])):
        found = audit(log, [note + cosignature])
        assert isinstance(found, AnchoredExtent)
        assert (found.records, found.witnessed, found.rejected) == (0, (), 1)


def test_a_cosignature_by_a_key_of_the_vehicle(futures: tuple[Log, Log]) -> None:
    """The log key and the epoch keys are not witness keys."""
    flown, _ = futures
    name = f"rtshcua/witness/{WITNESSES[0].kid.hex()}"
    own = flown.notes[-1].rpartition("— ")[2].split(" ")[1]
    assert records(flown, [f"{flown.notes[-1]}— {name} {own}"], 1) == 0


def test_witness_with_reset_state(futures: tuple[Log, Log]) -> None:
    """An attacker who deletes its state gets a second cosignature, but the first one still exists."""
    flown, told = futures
    witness = Judge()
    first = anchored(flown, witness)
    witness.seen.clear()
    second = anchored(told, witness)
    assert slug(told, [second, first], 1) == slug(flown, [first, second], 1) == "anchor/root"
