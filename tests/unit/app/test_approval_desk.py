"""The desk of an approver at a flight, over a real socket and a real boundary: what is asked, and what is signed."""

import tempfile
import threading
from base64 import b64encode
from collections.abc import Iterator
from pathlib import Path

import pytest
from msgspec.structs import replace

from reference.low_source import low_source
from rtshcua.adapters.agent_socket import FlightReply, hand_in
from rtshcua.app import approval_desk
from rtshcua.app.approval_desk import StepQuestion, open_desk
from rtshcua.app.approvals import DeskRequest
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.app import main
from rtshcua.front.cli.unlock import unlock_person
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.onboard.enforcement.load import Loaded
from virtual.waiting_flight import ASKED, Attended, WaitingFlight, desk_at, keys_and_bundles

OTHER = low_source("inspect_area(bridge_a, altitude = 8 m, pattern = perimeter)").replace(
    "mission low", "mission other"
)
FLIGHT = ("--flight", bytes(16).hex())


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Keys and bundles; nothing of them changes."""
    folder = tmp_path_factory.mktemp("desk")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setenv("RTSHCUA_DATA_DIR", str(folder / "data"))
        keys_and_bundles(folder, other=OTHER)
        yield folder


@pytest.fixture
def here(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("RTSHCUA_DATA_DIR", str(made / "data"))
    monkeypatch.chdir(made)
    return tmp_path


@pytest.fixture
def place() -> Iterator[Path]:
    with tempfile.TemporaryDirectory(dir="/tmp") as name:
        yield Path(name) / "s"


@pytest.fixture
def flight(here: Path, place: Path) -> Iterator[WaitingFlight]:
    flying = WaitingFlight(place, Path("low.bundle"))
    yield flying
    flying.hang_up()


@pytest.fixture
def ada(flight: WaitingFlight) -> Iterator[Attended]:
    attended = Attended(desk_at(flight.path))
    yield attended
    attended.end()


def asked(attended: Attended, count: int = 1) -> StepQuestion:
    question = attended.until("question", count).question
    assert question is not None
    return question


def test_approval_is_for_the_step_that_was_shown(flight: WaitingFlight, ada: Attended) -> None:
    flight.asks()
    question = asked(ada)
    assert question.draft is not None
    view = ada.desk.view(question)
    assert (question.asked.step, view["skill"], question.why_not) == (ASKED, "inspect_area", "")
    assert [each["name"] for each in view["arguments"] if each["where"]] == ["area"]
    assert question.draft.document.binding == flight.step.binding
    assert 0 < view["left_ms"] <= 25_000
    said = ada.desk.answer(question.nonce, granted=True)
    assert said == FlightReply("accepted", said.text)
    ada.until("answered")
    assert ada.desk.state()[2] is None
    assert flight.slugs == ["accepted"]
    flight.decides(Outcome.ALLOW, Reason.ADMITTED)
    flight.ends()
    ada.until("over")
    assert ada.desk.code is ExitCode.OK
    assert ada.names() == ["following", "question", "answered", "over"], "it is not asked again"


def test_refusal_is_signed_too(flight: WaitingFlight, ada: Attended) -> None:
    flight.asks()
    said = ada.desk.answer(asked(ada).nonce, granted=False)
    assert said.slug == "accepted"
    assert "refused as supervisor" in ada.until("answered").text


def test_a_nonce_is_for_one_answer(flight: WaitingFlight, ada: Attended) -> None:
    flight.asks()
    nonce = asked(ada).nonce
    for wrong in ("", "x", nonce[:-1], nonce + "x"):
        said = ada.desk.answer(wrong, granted=True)
        assert said.slug == "question-over"
    assert ada.desk.answer(nonce, granted=True).slug == "accepted"
    again = ada.desk.answer(nonce, granted=False)
    assert isinstance(again, Refusal)
    assert again.slug == "question-over"
    assert flight.slugs == ["accepted"]


def test_of_two_answers_at_once_one_is_signed(flight: WaitingFlight, ada: Attended) -> None:
    flight.asks()
    nonce = asked(ada).nonce
    start = threading.Barrier(8)
    slugs: list[str] = []

    def answer(granted: bool) -> None:
        start.wait()
        slugs.append(ada.desk.answer(nonce, granted=granted).slug)

    threads = [threading.Thread(target=answer, args=(number % 2 == 0,)) for number in range(8)]
    for each in threads:
        each.start()
    for each in threads:
        each.join()
    assert sorted(slugs) == ["accepted"] + ["question-over"] * 7
    assert flight.slugs == ["accepted"]


def test_lapse_and_answers_of_others_close_the_question(flight: WaitingFlight, ada: Attended) -> None:
    flight.asks()
    nonce = asked(ada).nonce
    flight.decides(Outcome.DENY, Reason.APPROVAL_TIMED_OUT)
    assert "nobody answered in time" in ada.until("closed").text
    assert ada.desk.answer(nonce, granted=True).slug == "question-over"
    flight.asks()
    asked(ada, 2)
    assert main(["approve", "low.bundle", "--step", str(ASKED + 1), "--to", str(flight.path), "--yes"]) == ExitCode.OK
    assert "ada approved it" in ada.until("closed", 2).text
    assert flight.slugs == ["accepted"]


def test_question_that_is_swapped_is_not_signed(here: Path, flight: WaitingFlight, ada: Attended) -> None:
    """The step is replaced by another one with the same number, between showing and confirming."""
    flight.asks()
    before = asked(ada)
    replacing = str(here / "new.replacement")
    words = ["compile", "other.rts", "--replaces", "low.bundle", "--from", str(ASKED + 1), *FLIGHT, "-o", replacing]
    assert main(words) == ExitCode.OK
    assert hand_in(flight.path, Path(replacing).read_bytes()).slug == "accepted"
    flight.announce()
    flight.asks()
    after = asked(ada, 2)
    assert before.asked.step == after.asked.step
    assert before.draft is not None
    assert after.draft is not None
    assert ada.desk.answer(before.nonce, granted=True).slug == "question-over"
    assert before.draft.document.binding != after.draft.document.binding == flight.step.binding
    assert ada.desk.answer(after.nonce, granted=True).slug == "accepted"
    assert flight.slugs == ["accepted", "accepted"]


def test_step_that_a_replacement_keeps_is_signed_in_the_new_mission(
    here: Path, flight: WaitingFlight, ada: Attended
) -> None:
    (here / "later.rts").write_text(low_source().replace("return_home()", "hover(5 s) return_home()"))
    flight.asks()
    before = asked(ada)
    words = ["compile", str(here / "later.rts"), "--replaces", "low.bundle", "--from", str(ASKED + 2), *FLIGHT]
    assert main([*words, "-o", str(here / "r")]) == ExitCode.OK
    assert hand_in(flight.path, (here / "r").read_bytes()).slug == "accepted"
    flight.announce()
    after = asked(ada, 2)
    assert before.draft is not None
    assert after.draft is not None
    assert before.draft.document.mission != after.draft.document.mission == flight.loaded.bundle.mission_digest
    assert ada.desk.answer(before.nonce, granted=True).slug == "question-over"
    assert ada.desk.answer(after.nonce, granted=True).slug == "accepted"


def test_step_that_is_not_in_the_mission_cannot_be_signed(flight: WaitingFlight, ada: Attended) -> None:
    """A runtime that lies about what it requests."""
    other = flight.loaded.bundle.mission.invocations[ASKED - 1]
    flight.asks(invocation=replace(flight.step, binding=other.binding))
    question = asked(ada)
    assert question.draft is None
    assert "no log of the flight is below" in question.why_not
    assert ada.desk.answer(question.nonce, granted=True).slug == "unanswerable"
    assert flight.slugs == []


def test_rule_that_does_not_concern_the_step_is_not_answered(flight: WaitingFlight, ada: Attended) -> None:
    flight.asks(invocation=flight.loaded.bundle.mission.invocations[0])
    question = asked(ada)
    assert question.draft is None
    assert question.why_not == "its rule does not concern this step"


def test_mission_of_an_agent_is_read_from_the_log(here: Path, place: Path) -> None:
    """The bundle of the command line gives the policy alone, as of a vehicle that waits for a mission."""
    flying = WaitingFlight(place, Path("other.bundle"), here / "runs/x/log.jsonl")
    elsewhere, ada = Attended(desk_at(place, runs=str(here / "none"))), Attended(desk_at(place, runs=str(here)))
    flying.asks()
    unknown = asked(elsewhere)
    assert unknown.draft is None
    assert "--runs" in unknown.why_not
    question = asked(ada)
    assert question.draft is not None
    assert question.draft.bundle.mission.name == "other"
    assert ada.desk.answer(question.nonce, granted=True).slug == "accepted"
    for each in (elsewhere, ada):
        each.until("closed" if each is elsewhere else "answered")
        each.end()
    flying.hang_up()


def test_question_that_is_older_than_the_connection_is_asked(here: Path, place: Path) -> None:
    flying = WaitingFlight(place, Path("low.bundle"), here / "runs/x/log.jsonl")
    flying.asks()
    ada = Attended(desk_at(place, runs=str(here)))
    question = asked(ada)
    assert 0 < ada.desk.view(question)["left_ms"] <= 25_000
    assert ada.desk.answer(question.nonce, granted=True).slug == "accepted"
    ada.end()
    flying.hang_up()


def test_connection_that_is_lost_is_made_again(flight: WaitingFlight, ada: Attended) -> None:
    flight.asks()
    first = asked(ada)
    flight.hang_up()
    ada.until("lost")
    said = ada.desk.answer(first.nonce, granted=True)
    assert said.slug == "not-sent"
    assert ada.desk.state()[0] == "lost"
    flight.listen()
    ada.until("following", 2)
    again = ada.desk.state()[2]
    assert again is not None
    assert again.nonce not in ("", first.nonce), "the answer can be given again"
    assert ada.desk.answer(again.nonce, granted=True).slug == "accepted"


def test_flight_that_stays_away_is_given_up(
    flight: WaitingFlight, ada: Attended, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(approval_desk, "_LOST_S", 0.2)
    flight.hang_up()
    ada.until("gone")
    assert ada.desk.code is ExitCode.LINK
    flight.listen()


def test_flight_under_another_policy_is_left(here: Path, place: Path) -> None:
    source = (
        low_source("hover(5 s)")
        .replace("bridge_inspection", "training_field")
        .replace("@7", "@2")
        .replace("    goto(bridge_a.entry, altitude = 9 m)\n", "")
    )
    Path("field.rts").write_text(source)
    assert main(["compile", "field.rts"]) == ExitCode.OK
    flying = WaitingFlight(place, Path("field.bundle"))
    ada = Attended(desk_at(place))
    ada.until("other-policy")
    assert ada.desk.code is ExitCode.REFUSED
    ada.end()
    flying.hang_up()


def test_path_that_differs_must_be_accepted(
    flight: WaitingFlight, ada: Attended, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(approval_desk, "told_other_path", lambda draft: "the path differs")
    flight.asks()
    question = asked(ada)
    said = ada.desk.answer(question.nonce, granted=True)
    assert said.slug == "other-path"
    assert flight.slugs == []
    assert ada.desk.answer(question.nonce, granted=True, other_path=True).slug == "accepted", "nothing was used up"


def test_answer_that_the_flight_refuses_can_be_given_again(flight: WaitingFlight, ada: Attended) -> None:
    flight.asks()
    question = asked(ada)
    held, flight.loaded = flight.loaded, of_another_flight()
    assert ada.desk.answer(question.nonce, granted=True).slug == "other-flight"
    assert "other-flight" in ada.until("not-accepted").text
    flight.loaded = held
    again = ada.desk.state()[2]
    assert again is not None
    assert again.nonce not in ("", question.nonce)
    assert again.asked == question.asked
    assert ada.desk.answer(again.nonce, granted=True).slug == "accepted"


def of_another_flight() -> Loaded:
    """The same mission in another flight."""
    with tempfile.TemporaryDirectory(dir="/tmp") as name:
        other = WaitingFlight(Path(name) / "s", Path("low.bundle"), flight=b"\x01" * 16)
        other.hang_up()
        return other.loaded


def test_role_and_person_must_be_ones_that_are_asked(here: Path, place: Path) -> None:
    def refused(role: str | None, person: str | None) -> Refusal:
        request = DeskRequest(Path("low.bundle"), (), place, Path("runs"), role, 300, None)
        found = open_desk(request, lambda store, own: unlock_person(store, person, own))
        assert isinstance(found, Refusal)
        return found

    wrong = refused("operator", None)
    assert (wrong.slug, wrong.help) == ("usage", "accepted: --role `supervisor`")
    assert refused(None, "eve").slug == "no-approver"
    request = DeskRequest(Path("low.bundle"), (), place, Path("runs"), None, 300, None)
    found = open_desk(request, lambda store, own: unlock_person(store, "owner", "operator"))
    assert isinstance(found, Refusal)
    assert found.slug == "wrong-role", "as with a file of another key"


def test_malformed_approvals_in_records_are_passed_over(flight: WaitingFlight, ada: Attended) -> None:
    flight.asks()
    asked(ada)
    flight.happens("approval", ASKED, "no base64")
    flight.happens("approval", ASKED, b64encode(b"\xff" * 40).decode())
    flight.happens("replacement", ASKED, b64encode(b"no document").decode())
    ada.until("closed")
    flight.asks()
    assert "cannot" in asked(ada, 2).why_not or asked(ada, 2).draft is None
