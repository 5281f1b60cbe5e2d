"""When the runtime seals: an epoch that is over when nothing is sent, one that is long over before anything else."""

import json
from typing import Any

import pytest

from reference.seeds import epoch_seeds
from rtshcua.evidence.chain import Recorder
from rtshcua.evidence.durability import SYNCED, SYNCED_FIRST, WRITTEN
from rtshcua.evidence.epochs import EPOCH_RECORDS, EPOCH_US
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.ports import Append, Command, Dispatch
from rtshcua.onboard.runtime.journal import Journal
from rtshcua.wire.keys import Duty, SigningKey

KEY = SigningKey.from_seed(bytes(32), duty=Duty.LOG, development=True)
DISPATCH = Dispatch(Command(7, "hover", 0, (), (), 0, 0), 1 << 40, True)


def at(us: int) -> Now:
    return Now(us, 1_750_000_000_000_000 + us, 0)


@pytest.fixture
def journal() -> Journal:
    recorder = Recorder(lambda text: KEY.sign(text, duty=Duty.LOG), KEY.public, epoch_seeds())
    recorder.genesis(at(0), bundle=b"", root=b"", boot=bytes(16), vehicle="quad-07", mission="m", mode="software")
    return Journal(recorder)


def told(journal: Journal) -> list[tuple[Any, int]]:
    """Type or event of each line, and its class."""
    lines = [(json.loads(each.line), each.durability) for each in journal.take() if isinstance(each, Append)]
    return [(record.get("event", record["type"]), durability) for record, durability in lines]


def test_an_epoch_that_is_over_is_sealed_in_a_step_that_sends_nothing(journal: Journal) -> None:
    journal.seal_when_idle(at(EPOCH_US - 1))
    assert told(journal) == []
    journal.add(DISPATCH)
    journal.seal_when_idle(at(EPOCH_US))
    assert told(journal) == []
    journal.effect(at(EPOCH_US), "succeeded")
    journal.seal_when_idle(at(EPOCH_US))
    assert told(journal) == [("succeeded", WRITTEN), ("seal", SYNCED_FIRST)]
    journal.seal_when_idle(at(EPOCH_US + 1))
    assert told(journal) == []


def test_an_epoch_that_is_long_over_is_sealed_before_anything_else(journal: Journal) -> None:
    journal.effect(at(EPOCH_US + EPOCH_US // 5), "link-back")
    assert told(journal) == [("seal", SYNCED_FIRST), ("link-back", WRITTEN)]


def test_an_epoch_of_many_records_is_sealed_though_every_step_sends_something(journal: Journal) -> None:
    for _ in range(EPOCH_RECORDS * 3):
        journal.effect(at(1), "said")
        journal.add(DISPATCH)
        journal.seal_when_idle(at(1))
    seals = [number for number, (what, _) in enumerate(told(journal)) if what == "seal"]
    assert len(seals) == 2
    assert all(EPOCH_RECORDS <= number <= EPOCH_RECORDS * 5 // 4 * count for count, number in enumerate(seals, 1))


def test_a_command_waits_for_its_decision_and_for_nothing_else(journal: Journal) -> None:
    journal.effect(at(EPOCH_US * 2), "succeeded")
    journal.decision(b"{}", SYNCED)
    journal.effect(at(EPOCH_US * 2), "replaced")
    lines = [action for action in journal.take() if isinstance(action, Append)]
    assert [line.durability for line in lines if line.awaited] == [SYNCED]
    assert len(lines) == 4, "with the seal"
