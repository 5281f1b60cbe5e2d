"""When the runtime seals: a finished epoch when nothing is sent, and an overdue one before anything else."""

import json
from functools import partial
from typing import Any

import pytest
from msgspec.structs import replace

from reference.seeds import epoch_seeds
from rtshcua.evidence.epoch_key import EPOCH_RECORDS, EPOCH_US, LONGEST_US
from rtshcua.evidence.log_writer import Recorder
from rtshcua.model.durability import SYNCED, SYNCED_FIRST, WRITTEN
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.ports import Append, Command, Release
from rtshcua.onboard.runtime.journal import Journal
from rtshcua.wire.keys import Duty, SigningKey

KEY = SigningKey.from_seed(bytes(32), duty=Duty.LOG, development=True)
COMMAND = Command(7, "hover", 0, (), (), 0, 0, needs_record=True)


def at(us: int) -> Now:
    return Now(us, 1_750_000_000_000_000 + us, 0)


@pytest.fixture
def journal() -> Journal:
    recorder = Recorder(lambda text: KEY.sign(text, duty=Duty.LOG), KEY.public, epoch_seeds())
    recorder.genesis(at(0), bundle=b"", root=b"", boot=bytes(16), vehicle="quad-07", mission="m", mode="software")
    return Journal(recorder)


def told(journal: Journal, us: int) -> list[tuple[Any, int]]:
    """The type or event of each line at a time, with its durability."""
    taken = journal.take(at(us), ended=False)
    lines = [(json.loads(each.line), each.durability) for each in taken if isinstance(each, Append)]
    return [(record.get("event", record["type"]), durability) for record, durability in lines]


def test_finished_epoch_is_sealed_in_a_step_without_commands(journal: Journal) -> None:
    assert told(journal, EPOCH_US - 1) == []
    journal.add(COMMAND)
    assert told(journal, EPOCH_US) == []
    journal.effect(at(EPOCH_US), "succeeded")
    assert told(journal, EPOCH_US) == [("succeeded", WRITTEN), ("seal", SYNCED_FIRST)]
    assert told(journal, EPOCH_US + 1) == []


def test_an_epoch_is_not_sealed_when_the_close_is_to_follow(journal: Journal) -> None:
    assert journal.take(at(EPOCH_US), ended=True) == []


def test_an_epoch_that_is_long_over_is_sealed_before_anything_else(journal: Journal) -> None:
    late = EPOCH_US + EPOCH_US // 5
    journal.effect(at(late), "link-back")
    assert told(journal, late) == [("seal", SYNCED_FIRST), ("link-back", WRITTEN)]


@pytest.mark.parametrize("in_a_step", [1, EPOCH_RECORDS // 3])
def test_full_epoch_is_sealed_even_if_every_step_sends(journal: Journal, in_a_step: int) -> None:
    lines: list[tuple[Any, int]] = []
    for number in range(EPOCH_RECORDS * 3):
        journal.effect(at(1), "said")
        journal.add(COMMAND)
        if number % in_a_step == in_a_step - 1:
            lines += told(journal, 1)
    seals = [number for number, (what, _) in enumerate(lines) if what == "seal"]
    assert len(seals) == 2
    assert all(EPOCH_RECORDS <= number <= EPOCH_RECORDS * 5 // 4 * count for count, number in enumerate(seals, 1))


def test_command_waits_only_for_its_decision_record(journal: Journal) -> None:
    late = at(EPOCH_US * 2)
    journal.effect(late, "succeeded")
    journal.tell(lambda: journal.record(lambda: b"{}", late, SYNCED, awaited=True))
    journal.effect(late, "replaced")
    lines = [action for action in journal.take(late, ended=False) if isinstance(action, Append)]
    assert [line.durability for line in lines if line.awaited] == [SYNCED]
    assert len(lines) == 4, "with the seal"


@pytest.mark.parametrize(
    ("before", "needs_record", "is_reflex"),
    [((), False, True), ((), True, False), ((Release(),), False, False)],
)
def test_only_reflex_commands_wait_for_no_record(
    journal: Journal, before: tuple[Release, ...], needs_record: bool, is_reflex: bool
) -> None:
    for action in before:
        journal.add(action)
    journal.effect(at(1), "violated")
    command = replace(COMMAND, needs_record=needs_record)
    journal.add(command)
    assert (journal.reflex is command) is is_reflex
    taken = journal.take(at(1), ended=False)
    assert command in taken, "in its place among all that is to be done"
    assert journal.reflex is None


def test_records_of_a_reflex_are_made_when_they_are_taken_and_not_before(journal: Journal) -> None:
    before = journal.recorder.count
    journal.effect(at(1), "violated")
    journal.add(replace(COMMAND, needs_record=False))
    assert journal.reflex is not None
    assert journal.recorder.count == before
    journal.take(at(1), ended=False)
    assert journal.recorder.count == before + 1


def test_seal_follows_record_of_boundary_loss(journal: Journal) -> None:
    """Otherwise an epoch would end without its statement, and nothing would explain it."""
    lost: list[str] = []
    journal.recorder.attest = lambda now, **_: None
    journal.recorder.lost = lambda: lost[0] if lost else None
    lost.append("it is gone")
    assert [kind for kind, _ in told(journal, EPOCH_US)] == ["boundary-lost", "seal"]
    assert journal.look_at_boundary(at(EPOCH_US + 1))
    journal.effect(at(EPOCH_US + 1), "link-back")
    assert [kind for kind, _ in told(journal, EPOCH_US + 1)] == ["link-back"], "it is told once"


def test_late_seal_does_not_hide_boundary_loss(journal: Journal) -> None:
    late = EPOCH_US + EPOCH_US // 5
    journal.recorder.lost = lambda: "it is gone"
    journal.effect(at(late), "dispatched")
    assert [kind for kind, _ in told(journal, late)] == ["boundary-lost", "seal", "dispatched"]


def test_boundary_entries_are_recorded_before_its_loss(journal: Journal) -> None:
    """The seal is late in the same step in which the loss is found: it waits for earlier reports."""
    late = EPOCH_US + EPOCH_US // 5
    decision = partial(journal.recorder.effect, at(late), "approval")
    journal.tell(lambda: journal.record(decision, at(late), SYNCED, awaited=True))
    journal.recorder.lost = lambda: "it is gone"
    journal.effect(at(late), "refused")
    assert [kind for kind, _ in told(journal, late)] == ["approval", "boundary-lost", "seal", "refused"]


def test_late_seal_after_loss_waits_for_earlier_reports(journal: Journal) -> None:
    lost: list[str] = []

    def attest(now: Now, *, final: bool) -> None:
        lost.append("it is gone")

    late = EPOCH_US + EPOCH_US // 5
    journal.recorder.attest, journal.recorder.lost = attest, lambda: lost[0] if lost else None
    journal.effect(at(late), "approval")
    assert [kind for kind, _ in told(journal, late)] == ["approval", "boundary-lost", "seal"]
    journal.effect(at(late + 1), "link-back")
    assert [kind for kind, _ in told(journal, late + 1)] == ["link-back"]


def test_gap_is_recorded_first_if_seal_is_too_late(journal: Journal) -> None:
    journal.effect(at(5_000_000), "succeeded")
    assert told(journal, 5_000_000) == [("succeeded", WRITTEN)]
    journal.effect(at(LONGEST_US + 1), "link-back")
    taken = [
        json.loads(each.line) for each in journal.take(at(LONGEST_US + 1), ended=False) if isinstance(each, Append)
    ]
    assert [each.get("event", each["type"]) for each in taken] == ["stalled", "seal", "link-back"]
    assert taken[0]["detail"] == f"{LONGEST_US + 1 - 5_000_000} us"


def test_gap_is_recorded_once_if_seal_waits_after_loss(
    journal: Journal,
) -> None:
    lost: list[str] = []

    def attest(now: Now, *, final: bool) -> None:
        lost.append("it is gone")

    late = LONGEST_US + 1
    journal.recorder.attest, journal.recorder.lost = attest, lambda: lost[0] if lost else None
    journal.effect(at(late), "approval")
    journal.effect(at(late), "succeeded")
    assert [kind for kind, _ in told(journal, late)] == ["stalled", "approval", "succeeded", "boundary-lost", "seal"]


def test_overdue_epoch_is_sealed_outside_of_a_run(journal: Journal) -> None:
    recorder = journal.recorder
    assert recorder.caught_up(at(EPOCH_US)) == ()
    late = EPOCH_US + EPOCH_US // 5
    assert [json.loads(line)["type"] for line in recorder.caught_up(at(late))] == ["seal"]
    end = recorder.closing(at(late + LONGEST_US + 1), ending="completed", tlog=None)
    assert [json.loads(line).get("event") for line in end] == ["stalled", None]
