"""Anchors compared with a log: how far it is anchored, contradictions, and irrelevant anchors."""

from itertools import permutations

import pytest

from reference.witnessed import ORIGIN, PUBLIC, WITNESSES, Judge, Log
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.witnessing.anchors import AnchoredExtent, Anchors, notes


@pytest.fixture
def log() -> Log:
    """Checkpoints at 0, 4, 7 and 8 (the close): nine lines."""
    log = Log()
    log.effects(3)
    log.seal()
    log.effects(2)
    log.seal()
    log.close()
    return log


def outcome(log: Log, anchors: list[str], threshold: int = 1, keys: list[bytes] = PUBLIC) -> AnchoredExtent | Flaw:
    """The result, which must be the same for any order of anchors and checkpoints."""
    steps = [[("anchor", each) for each in anchors], [("checkpoint", each) for each in log.notes]]
    found = []
    for order in (steps[0] + steps[1], steps[1] + steps[0]):
        held = Anchors(ORIGIN, keys, threshold)
        flaws = [flaw for way, note in order if (flaw := getattr(held, way)(note)) is not None]
        found.append(flaws[0] if flaws else held.finish(len(log.lines)))
    assert found[0] == found[1] or (isinstance(found[0], Flaw) and found[0].slug == found[1].slug)  # type: ignore[union-attr]
    return found[0]


def anchored(log: Log, anchors: list[str], threshold: int = 1) -> tuple[int, int]:
    found = outcome(log, anchors, threshold)
    assert isinstance(found, AnchoredExtent)
    return found.records, found.tail


def slug(log: Log, anchors: list[str], threshold: int = 1) -> str:
    found = outcome(log, anchors, threshold)
    assert isinstance(found, Flaw), found
    return found.slug


def test_without_anchors_all_is_tail(log: Log) -> None:
    assert outcome(log, []) == AnchoredExtent(0, 9, 1, ())


def test_checkpoint_anchors_its_record_and_all_before(log: Log) -> None:
    witness = Judge()
    marks = [witness.blindly(note) for note in log.notes]
    assert [anchored(log, [mark]) for mark in marks] == [(1, 8), (5, 4), (8, 1), (9, 0)]
    for order in permutations(marks[1:]):
        assert anchored(log, list(order)) == (9, 0)


def test_the_threshold_counts_witnesses(log: Log) -> None:
    """Each witness covers all smaller trees: with two that saw 5 and 9, the threshold of two is at 5."""
    far, near = Judge(), Judge(WITNESSES[1])
    marks = [far.blindly(log.notes[3]), near.blindly(log.notes[1])]
    assert anchored(log, marks, 1) == (9, 0)
    assert anchored(log, marks, 2) == (5, 4)
    assert anchored(log, marks, 3) == (0, 9)
    assert anchored(log, [far.blindly(log.notes[1]), far.blindly(log.notes[3])], 2) == (0, 9)
    found = outcome(log, marks)
    assert isinstance(found, AnchoredExtent)
    assert [(seen.public, seen.size) for seen in found.witnessed] == [(PUBLIC[0], 8), (PUBLIC[1], 4)]


def test_both_lines_under_one_checkpoint(log: Log) -> None:
    note = log.notes[2]
    both = Judge().blindly(note) + Judge(WITNESSES[1]).blindly(note).removeprefix(note)
    assert anchored(log, [both], 2) == (8, 1)


def test_another_tree_at_the_same_size(log: Log) -> None:
    other = Log()
    other.effects(2)
    other.effects(1, "landed")
    other.seal()
    assert slug(log, [Judge().blindly(other.notes[1])]) == "anchor/root"


def test_the_same_tree_with_another_record(log: Log) -> None:
    other = Log()
    other.effects(3)
    other.ms += 5
    assert slug(log, [Judge().blindly(other.seal())]) == "anchor/root"


def test_two_anchors_that_contradict_each_other_ahead_of_the_log() -> None:
    log, other = Log(), Log()
    for each, event in ((log, "said"), (other, "landed")):
        each.effects(3, event)
        each.seal()
    witness = Judge()
    held = Anchors(ORIGIN, PUBLIC, 1)
    assert held.anchor(witness.blindly(log.notes[1])) is None
    flaw = held.anchor(witness.blindly(other.notes[1]))
    assert flaw is not None
    assert flaw.slug == "anchor/root"


def test_anchor_at_size_without_checkpoint_is_detected(log: Log) -> None:
    other = Log()
    other.effects(1)
    assert slug(log, [Judge().blindly(other.seal())]) == "anchor/root"


def test_a_longer_log_was_seen(log: Log) -> None:
    longer = Log()
    longer.effects(8)
    note = longer.seal()
    assert slug(log, [Judge().blindly(note)]) == "anchor/beyond"
    close = log.notes.pop()
    log.lines.pop()
    assert slug(log, [Judge().blindly(close)]) == "anchor/beyond"


def test_a_forged_cosignature_for_this_log(log: Log) -> None:
    mark = Judge().blindly(log.notes[1])
    text, _, lines = mark.rpartition("\n\n")
    forged = text.replace("\n4\n", "\n5\n") + "\n\n" + lines
    found = outcome(log, [forged])
    assert isinstance(found, AnchoredExtent)
    assert (found.records, found.witnessed, found.rejected) == (0, (), 1)
    assert found.first.endswith("did not sign this checkpoint at this time")
    found = outcome(log, [forged, mark, forged])
    assert isinstance(found, AnchoredExtent)
    assert (found.records, found.rejected) == (5, 2)


def test_note_with_a_wrong_signature_is_rejected(log: Log) -> None:
    note = log.notes[1]
    good, other = Judge().blindly(note), Judge(WITNESSES[1]).blindly(log.notes[2]).removeprefix(log.notes[2])
    found = outcome(log, [good + other])
    assert isinstance(found, AnchoredExtent)
    assert (found.records, found.witnessed, found.rejected) == (0, (), 1)


def test_extent_beyond_threshold_is_reported(log: Log) -> None:
    far, near = Judge(), Judge(WITNESSES[1])
    marks = [far.blindly(log.notes[3]), near.blindly(log.notes[1])]
    for threshold, ahead in ((1, []), (2, [8]), (3, [8, 4])):
        found = outcome(log, marks, threshold)
        assert isinstance(found, AnchoredExtent)
        assert [seen.size for seen in found.ahead] == ahead


@pytest.mark.parametrize(
    "note",
    [
        "",
        "junk",
        "\n\n",
        Log().notes[0],
        "a" * 20_000,
        Judge().blindly("some/other/log\n1\nAA==\n\n— some/other/log AAAA\n"),
        Judge(WITNESSES[0]).blindly(f"{ORIGIN}\nno checkpoint\n\n— {ORIGIN} AAAA\n"),
        Judge().blindly(Log().notes[0]).replace(ORIGIN, "other/log"),  # forged, and about another log
    ],
    ids=range(8),
)
def test_irrelevant_anchors_are_ignored(log: Log, note: str) -> None:
    assert outcome(log, [note]) == AnchoredExtent(0, 9, 1, ())


def test_untrusted_witness_is_ignored(log: Log) -> None:
    longer = Log()
    longer.effects(80)
    mark = Judge(WITNESSES[2]).blindly(longer.seal())
    assert outcome(log, [mark], keys=PUBLIC[:2]) == AnchoredExtent(0, 9, 1, ())


def test_notes_of_a_file(log: Log) -> None:
    marks = [Judge().blindly(note) for note in log.notes]
    text = "".join(f"{mark}\n" for mark in marks)
    assert list(notes(text)) == marks
    assert list(notes("")) == []
    assert list(notes(text + "half of a note\n\n— one"))[:4] == marks
    torn = text[: len(marks[0]) + len(marks[1]) - 20]
    assert next(iter(notes(torn + text))) == marks[0]
    assert list(notes(torn + text))[-3:] == marks[1:]
