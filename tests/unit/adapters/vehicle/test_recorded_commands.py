"""Recorded answers of real autopilots to valid and invalid commands, and our reaction to them."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

import pytest

from recorded.trace import Heard, Question, Trace
from rtshcua.adapters.vehicle.ardupilot import ARDUPILOT
from rtshcua.adapters.vehicle.fence import Upload, UploadState
from rtshcua.adapters.vehicle.flavour import AutopilotFlavour, Stage
from rtshcua.adapters.vehicle.manoeuvre import Commander
from rtshcua.adapters.vehicle.messages import FENCE, FenceItem, StatusTexts
from rtshcua.adapters.vehicle.observed import Estimator, ObservedVehicle
from rtshcua.adapters.vehicle.px4 import PX4
from rtshcua.mavlink.modes import CopterMode, Px4Mode

ARM, TAKEOFF, MODE, REPOSITION, RETURN, LAND = 400, 22, 176, 192, 20, 21


@dataclass
class Judged:
    """A recorded command, and the commander's reaction to its answers until the next one."""

    number: int
    message: Any
    commander: Commander
    seen: ObservedVehicle

    @property
    def outcome(self) -> str:
        commander = self.commander
        if commander.refused is not None:
            return f"refused {commander.refused}"
        return "unknown" if commander.waits else "accepted"


@cache
def trace(name: str) -> Trace:
    return Trace(name)


@cache
def judged(name: str, estimator: str) -> list[Judged]:
    return list(_judge(trace(name), Estimator(estimator)))


def _judge(session: Trace, estimator: Estimator) -> Iterator[Judged]:
    seen, texts, commander = ObservedVehicle(estimator), StatusTexts(), Commander()
    heard = session.of_vehicle
    at = 0
    for question, end_us in windows(session):
        m = question.heard.message
        is_command = question.heard.name in ("COMMAND_LONG", "COMMAND_INT")
        if is_command:
            commander = Commander()
            commander.start(Stage(m, m.command, lambda seen: False, frozenset()), question.at_us)
            seen.hush()
        while at < len(heard) and heard[at].at_us < end_us:
            take(heard[at], seen, texts, commander)
            at += 1
        if is_command:
            yield Judged(m.command, m, commander, ObservedVehicle(estimator, seen.mode, seen.armed, text=seen.text))


def take(frame: Heard, seen: ObservedVehicle, texts: StatusTexts, commander: Commander) -> None:
    if frame.name == "COMMAND_ACK":
        commander.acknowledge(frame.message.command, frame.message.result, frame.at_us)
    elif frame.name == "STATUSTEXT":
        for said in texts.take(frame.message, frame.at_us):
            seen.say(said.severity, said.text)
    else:
        seen.take(frame.name, frame.message, frame.at_us, frame.at_us, frame.at_us)


def windows(session: Trace) -> Iterator[tuple[Question, int]]:
    questions = session.questions
    ends = [question.at_us for question in questions[1:]] + [session.heard[-1].at_us]
    yield from zip(questions, ends, strict=True)


def find(name: str, number: int, where: Callable[[Any], bool] = lambda m: True) -> list[Judged]:
    estimator = "ESTIMATOR_STATUS" if name == "px4-commands" else "EKF_STATUS_REPORT"
    return [each for each in judged(name, estimator) if each.number == number and where(each.message)]


def test_px4_acknowledges_invalid_modes() -> None:
    (bogus,) = find("px4-commands", MODE, lambda m: m.param2 == 99)
    assert bogus.outcome == "accepted"
    assert bogus.seen.mode == Px4Mode.TAKEOFF, "only the heartbeat tells that nothing changed"
    (sub,) = find("px4-commands", MODE, lambda m: m.param3 == 99)
    assert sub.outcome == "refused 1"
    good = find("px4-commands", MODE, lambda m: m.param3 == 3)
    assert {(each.outcome, each.seen.mode) for each in good} == {("accepted", Px4Mode.HOLD)}


def test_unanswered_command_is_unknown() -> None:
    for name in ("px4-commands", "arducopter-commands"):
        (asked,) = find(name, ARM, lambda m: m.target_system != 1)
        assert asked.outcome == "unknown"


def test_px4_accepts_a_takeoff_on_the_ground_disarmed_and_does_not_fly() -> None:
    first = find("px4-commands", TAKEOFF)[0]
    assert (first.outcome, first.seen.mode, first.seen.armed) == ("accepted", Px4Mode.TAKEOFF, False)


def test_px4_wants_its_flag_with_a_reposition() -> None:
    (without,) = find("px4-commands", REPOSITION, lambda m: not m.param2)
    assert without.outcome == "refused 3"


def test_arducopter_reports_why_arming_failed() -> None:
    refused = find("arducopter-commands", ARM, lambda m: m.param1 == 1 and m.target_system == 1)[0]
    assert (refused.outcome, refused.seen.text) == ("refused 4", "Arm: Accels inconsistent")


def test_arducopter_knows_no_mode_99_and_says_so() -> None:
    (refused,) = find("arducopter-commands", MODE, lambda m: m.param2 == 99)
    assert (refused.outcome, refused.seen.text) == ("refused 4", "No such mode 99")


def test_arducopter_accepts_a_takeoff_in_loiter_without_moving() -> None:
    in_loiter = find("arducopter-commands", TAKEOFF)[1]
    assert (in_loiter.outcome, in_loiter.seen.mode) == ("accepted", 5)


@pytest.mark.parametrize(("name", "number", "mode"), [
    ("px4-commands", RETURN, Px4Mode.RETURN), ("px4-commands", LAND, Px4Mode.LAND),
    ("arducopter-commands", RETURN, CopterMode.RTL), ("arducopter-commands", LAND, CopterMode.LAND),
])  # fmt: skip
def test_returns_and_landings_show_in_the_heartbeat(name: str, number: int, mode: int) -> None:
    first = find(name, number)[0]
    assert (first.outcome, first.seen.mode) == ("accepted", mode)


@pytest.mark.parametrize(("name", "flavour"), [("px4-commands", PX4), ("arducopter-commands", ARDUPILOT)])
def test_fences_are_uploaded_as_the_recorded_client_did(name: str, flavour: AutopilotFlavour) -> None:
    uploads = 0
    session = trace(name)
    for question, end_us in windows(session):
        if question.heard.name != "MISSION_COUNT" or question.heard.message.mission_type != FENCE:
            continue
        sent = [item.message for item in question.items]
        items = tuple(FenceItem(m.command, m.x, m.y, m.param1) for m in sent)
        upload = Upload(items, flavour.fence.frame)
        (count,) = upload.due(1, question.at_us)
        assert count.count == question.heard.message.count
        given = []
        for frame in session.of_vehicle:
            if (
                question.at_us <= frame.at_us < end_us
                and frame.name.startswith("MISSION_")
                and hasattr(frame.message, "mission_type")
            ):
                answers = upload.take(frame.name, frame.message, 1, frame.at_us)
                given += [answer for answer in answers if answer.get_type() == "MISSION_ITEM_INT"]
        assert [fields(m) for m in given] == [fields(m) for m in sent]
        assert upload.state is UploadState.COUNTING, "acknowledged, and about to be read back"
        uploads += 1
    assert uploads == 3


def fields(message: Any) -> dict[str, Any]:
    return {name: getattr(message, name) for name in message.fieldnames}
