"""When a disk is reported as late or hanging: time in which the whole process was stopped does not count."""

import pytest

from rtshcua.adapters.store.evidence_file import STUCK_S, Lateness
from rtshcua.model.durability import SYNCED


@pytest.fixture
def lateness() -> Lateness:
    """Watches a line that is not on the disk yet, from second 100 on."""
    made = Lateness()
    made.given(1, SYNCED)
    assert made.late(0, 100.0) is None
    return made


def looked(lateness: Lateness, from_s: float, to_s: float) -> str | None:
    """The reports of that time when the disk is checked ten times a second."""
    told = None
    for tenths in range(int(from_s * 10), int(to_s * 10)):
        told = told or lateness.stuck(0, tenths / 10)
    return told


def test_a_disk_that_does_not_answer_hangs(lateness: Lateness) -> None:
    assert looked(lateness, 100, 100 + STUCK_S) is None
    assert looked(lateness, 100 + STUCK_S, 101 + STUCK_S) == "the disk has not answered for 5 s"


def test_stopped_process_does_not_count_as_a_slow_disk(lateness: Lateness) -> None:
    """Both threads were stopped, and the watching thread may continue first."""
    assert looked(lateness, 100, 101) is None
    assert lateness.stuck(0, 131.0) is None
    assert lateness.late(0, 131.0) is None
    assert looked(lateness, 131, 134) is None
    assert looked(lateness, 134, 136) == "the disk has not answered for 5 s", "if it goes on not to"


def test_line_on_disk_after_a_stop_is_not_late(lateness: Lateness) -> None:
    assert lateness.stuck(0, 160.0) is None
    assert lateness.kept(1)
