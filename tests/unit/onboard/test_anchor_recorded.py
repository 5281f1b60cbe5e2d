"""A cosigned checkpoint is recorded completely; nothing waits for it, and the flight does not change."""

from reference.documents import low
from reference.world import START, Run, renewed
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import Effect
from rtshcua.evidence.witnessing.anchors import ANCHORED
from rtshcua.model.durability import WRITTEN
from rtshcua.onboard.ports import Anchored, Append


def test_cosigned_checkpoint_is_recorded_without_other_effects() -> None:
    run, other = Run(renewed(low()), ready=False), Run(renewed(low()), ready=False)
    note = "rtshcua/log/quad/00\n0\nAA==\n\n— a b\n"
    actions = run.runtime.step(START, [Anchored(0, note)])
    appends = [action for action in actions if isinstance(action, Append)]
    (found,) = [action for action in appends if ANCHORED.encode() in action.line]
    record = read(found.line)
    assert isinstance(record, Effect)
    assert (record.event, record.detail, record.durability) == (ANCHORED, note, WRITTEN)
    assert not found.awaited
    without = other.runtime.step(START, [])
    assert len([each for each in actions if each is not found]) == len(without)
