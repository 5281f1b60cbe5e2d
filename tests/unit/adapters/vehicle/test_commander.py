"""Acknowledgements are retried and extended, and never count as the effect; streams are requested and measured."""

from typing import Any

import pytest

from rtshcua.adapters.vehicle import messages
from rtshcua.adapters.vehicle.flavour import Stage
from rtshcua.adapters.vehicle.manoeuvre import LATE_US, RETRIES, RETRY_US, Commander
from rtshcua.adapters.vehicle.streams import MEASURE_US, QUIET_US, StreamPlan, StreamRequests

S = 1_000_000
ACCEPTED, TEMPORARILY, DENIED, FAILED, IN_PROGRESS = 0, 1, 2, 4, 5


def stage(number: int = messages.DO_SET_MODE) -> Stage:
    return Stage(messages.command(1, number), number, lambda seen: False, frozenset())


def begun(number: int = messages.DO_SET_MODE) -> Commander:
    commander = Commander()
    assert len(commander.start(stage(number), 0)) == 1
    return commander


def test_an_unanswered_command_is_sent_again_with_its_confirmation_raised() -> None:
    commander, confirmations = begun(), []
    for tick in range(200):
        confirmations += [message.confirmation for message in commander.due(tick * S // 10)]
    assert confirmations == list(range(1, RETRIES + 1))
    assert commander.waits
    assert not commander.accepted


def test_a_stage_that_is_flown_again_begins_without_the_repetitions_before() -> None:
    commander, same = Commander(), stage()
    for begins in (0, 60 * S):
        assert [message.confirmation for message in commander.start(same, begins)] == [0]
        assert [message.confirmation for message in commander.due(begins + RETRY_US)] == [1]
    assert same.message.confirmation == 0


def test_px4_answers_a_bogus_mode_twice_and_the_second_answer_counts() -> None:
    commander = begun()
    commander.acknowledge(messages.DO_SET_MODE, ACCEPTED, 1)
    commander.acknowledge(messages.DO_SET_MODE, TEMPORARILY, 2)
    assert commander.refused == TEMPORARILY


def test_two_acceptances_are_one() -> None:
    commander = begun()
    for at in (1, 2):
        commander.acknowledge(messages.DO_SET_MODE, ACCEPTED, at)
    assert (commander.accepted, commander.refused, commander.waits) == (True, None, False)
    assert commander.due(60 * S) == []


def test_in_progress_extends_the_wait() -> None:
    commander = begun()
    for at in range(1, 10):
        commander.acknowledge(messages.DO_SET_MODE, IN_PROGRESS, at * S - 1)
        assert commander.due(at * S) == []
    assert commander.busy_us == 9 * S - 1
    assert len(commander.due(9 * S + RETRY_US)) == 1


def test_a_refusal_of_the_repetition_is_not_one_of_the_first() -> None:
    commander = begun(messages.ARM_DISARM)
    commander.due(RETRY_US)
    commander.acknowledge(messages.ARM_DISARM, FAILED, RETRY_US + 1)
    assert commander.refused is None


@pytest.mark.parametrize(("after_us", "refused"), [(LATE_US - 1, None), (LATE_US, DENIED)])
def test_late_answer_is_not_matched_to_the_next_command(after_us: int, refused: int | None) -> None:
    commander = begun()
    commander.start(stage(), after_us)
    commander.acknowledge(messages.DO_SET_MODE, DENIED, after_us + 1)
    assert commander.refused == refused


def test_answers_to_other_commands_are_set_aside() -> None:
    commander = begun()
    commander.acknowledge(messages.TAKEOFF, DENIED, 1)
    assert (commander.accepted, commander.refused) == (False, None)
    Commander().acknowledge(messages.TAKEOFF, DENIED, 1)


class Link:
    """Streams that are delivered as requested, or at `every`."""

    def __init__(self, wanted: dict[str, int]) -> None:
        self.streams = StreamRequests(StreamPlan(wanted, 0, 0, None), ())
        self.every = dict(wanted)
        self.asked: list[str] = []
        self.now_us = 0

    def run(self, seconds: float) -> list[str]:
        """Let time pass; return the requests."""
        before = len(self.asked)
        for _ in range(round(seconds * 100)):
            self.now_us += S // 100
            for name, us in self.every.items():
                if us and self.now_us % us < S // 100:
                    self.streams.heard(name, self.now_us)
            for message in self.streams.due(1, self.now_us):
                self.asked.append(self.name(message))
                self.streams.answered(True, self.now_us)
        return self.asked[before:]

    @staticmethod
    def name(message: Any) -> str:
        return {33: "GLOBAL_POSITION_INT", 24: "GPS_RAW_INT"}[int(message.param1)]


def told(one: Link) -> list[str]:
    """The notes, except those on the first delivery."""
    first, *others = one.streams.notes
    assert first.startswith("streams: ")
    return others


def link() -> Link:
    return Link({"GLOBAL_POSITION_INT": 100_000, "GPS_RAW_INT": 500_000})


def test_streams_that_come_as_asked_are_asked_for_once() -> None:
    one = link()
    assert sorted(one.run(30)) == ["GLOBAL_POSITION_INT", "GPS_RAW_INT"]
    assert told(one) == []


def test_a_stream_that_somebody_slows_down_is_told_and_asked_for_again() -> None:
    """As REQUEST_DATA_STREAM of a ground station does on ArduPilot."""
    one = link()
    one.run(10)
    one.every["GLOBAL_POSITION_INT"] = 1_000_000
    assert one.run(2 * MEASURE_US / S) == ["GLOBAL_POSITION_INT"]
    assert told(one) == ["GLOBAL_POSITION_INT comes every 1000 ms, requested every 100 ms"]
    one.run(30)
    assert len(told(one)) == 1, "told once"
    one.every["GLOBAL_POSITION_INT"] = 100_000
    one.run(2 * MEASURE_US / S)
    assert told(one)[1:] == ["GLOBAL_POSITION_INT comes at the requested rate again"]


def test_a_stream_that_stops_is_asked_for_again_and_again() -> None:
    one = link()
    one.run(10)
    one.every["GPS_RAW_INT"] = 0
    assert one.run(3 * QUIET_US / S).count("GPS_RAW_INT") >= 3


def test_a_silent_link_slows_no_stream_down() -> None:
    one = link()
    one.run(10)
    was, one.every = one.every, dict.fromkeys(one.every, 0)
    one.run(4.9)
    one.streams.interrupted()
    one.every = was
    one.run(4 * MEASURE_US / S)
    assert told(one) == []
