"""The tools of the MCP server, without its protocol: several calls at a time, and whose decision is explained."""

import json
import socket
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest

from rtshcua.app.propose import Missions, ProposalAnswer
from rtshcua.front.mcp import tools as desks
from rtshcua.front.mcp.flight import Following, understood
from rtshcua.front.mcp.tools import Misused, Tools
from rtshcua.ground.agent.specification import load_specification
from rtshcua.onboard.calls import call
from rtshcua.wire import cose, names
from rtshcua.wire.binding import bind
from rtshcua.wire.bundle import parse
from rtshcua.wire.cancellation import CancellationDocument
from rtshcua.wire.document import MAX_DOCUMENT, MAX_LIFE_US
from rtshcua.wire.keys import Duty
from rtshcua.wire.request import STEP
from unit.front.mcp.conftest import AGENT
from virtual.rows import rows

CHECKOUT = Path(__file__).resolve().parents[4]
PROPOSAL = json.loads((CHECKOUT / "missions/proposal.json").read_text("utf-8"))
HIGH = deepcopy(PROPOSAL)
HIGH["phases"][0]["steps"][0]["arguments"]["altitude"] = "4000 m"


#: the fields of a decision beside its step; all values of the state are 0
RECORDED = {
    "_prev": "00" * 32, "at_us": 1_000_000, "utc_us": 2_000_000, "utc_error_us": 0, "valid_until_us": 0,
    "clause": "told", "clause_at": None, "rule_step": 8, "reason": "a rule", "target": None, "target_link": -1,
    "link": -1, "mode": "software", "durability": 2, "seq": 7, "type": "decision", "kind": STEP, "step": 0,
    "outcome": "deny", "context": {
        "approvals": [], "consumed": 0, "phase": 0, "policy_version": 7, "released_us": 1_000_000,
        "remaining_us": 60_000, "vehicle": "quad-07",
    },
}  # fmt: skip


def status(desk: Tools, ticket: str) -> str:
    """The status of a proposal after the vehicle's answer."""
    until_s = time.monotonic() + 60
    while desk.mission_status(ticket)["state"] == "submitted" and time.monotonic() < until_s:
        time.sleep(0.001)
    return str(desk.mission_status(ticket)["state"])


def test_each_of_two_checks_at_a_time_is_of_its_own_mission(
    missions: Missions, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Regression: the second proposal was read in place of the first, and signed."""
    others: list[ProposalAnswer | None] = []

    def load_late(*about: Any) -> Any:
        if not others:
            others.append(None)
            others[0] = missions.check(PROPOSAL, 1_000_000)
        return load_specification(*about)

    monkeypatch.setattr("rtshcua.ground.agent.specification.load_specification", load_late)
    assert not missions.check(HIGH, 1_000_000).accepted
    assert others[0] is not None
    assert others[0].accepted


def test_two_calls_with_one_key_are_one_proposal(desk: Tools, handed: list[bytes]) -> None:
    begin = threading.Barrier(2)

    def propose(_: int) -> Any:
        begin.wait()
        return desk.propose_mission(PROPOSAL, "one")

    with ThreadPoolExecutor(2) as pool:
        first, second = pool.map(propose, range(2))
    assert first["ticket"] == second["ticket"]
    assert status(desk, first["ticket"]) == "admitted"
    assert len(handed) == 1


def test_a_submitted_proposal_is_not_over_while_the_vehicle_is_unreachable(
    desk: Tools, monkeypatch: pytest.MonkeyPatch
) -> None:
    answer = threading.Event()

    def hand_in(socket: Path, document: bytes) -> tuple[str, str]:
        answer.wait(60)
        return "malformed", "refused"

    monkeypatch.setattr(desks, "hand_in", hand_in)
    ticket = desk.propose_mission(PROPOSAL, "one")["ticket"]
    shown = desk.mission_status(ticket)
    answer.set()
    assert (shown["state"], shown["stage"], shown["over"]) == ("submitted", "unreachable", False)
    assert status(desk, ticket) == "refused"
    assert desk.mission_status(ticket)["over"]


@pytest.mark.parametrize("close", [{}, {"type": "close", "ending": "completed"}])
def test_an_admitted_proposal_is_judged_by_its_own_flight(
    desk: Tools, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, close: dict[str, Any]
) -> None:
    """Neither a failed connection nor the end of an earlier flight ends the proposal."""
    path = tmp_path / "flight.sock"
    desk.following = following = Following(path)
    following.await_first()
    following.close = close
    with socket.socket(socket.AF_UNIX) as listener:
        listens = threading.Event()

        def hand_in(_: Path, document: bytes) -> tuple[str, str]:
            listener.bind(str(path))
            listener.listen()
            listens.set()
            return "accepted", "admitted"

        monkeypatch.setattr(desks, "hand_in", hand_in)
        ticket = desk.propose_mission(PROPOSAL, "one")["ticket"]
        assert listens.wait(60)
        listener.settimeout(60)
        link, _ = listener.accept()
        with link:
            link.sendall(b'{"type":"hello","flight":"0b","vehicle":"quad-07"}\n')
            assert status(desk, ticket) == "admitted"
            shown = desk.mission_status(ticket)
            following.end()
    assert (shown["stage"], shown["over"]) == ("waiting", False)


def flying(desk: Tools) -> None:
    desk.following.connected, desk.following.hello = True, {"flight": (bytes([7]) * 16).hex()}
    desk.following.mission = {"type": "mission", "digest": (bytes([8]) * 32).hex()}
    assert desk.following.stage == "flying"


@pytest.mark.parametrize("key", ["one", "two"])
def test_repeated_proposal_reports_the_flying_mission(desk: Tools, handed: list[bytes], key: str) -> None:
    first = desk.propose_mission(PROPOSAL, "one")
    assert status(desk, first["ticket"]) == "admitted"
    flying(desk)
    again = desk.propose_mission(deepcopy(PROPOSAL), key)
    assert (again["ticket"], again["state"], again["accepted"]) == (first["ticket"], "flying", True)
    assert "already flying" in again["text"]
    assert len(handed) == 1


def told_of(desk: Tools, missions: Missions, mission: Any) -> dict[str, Any]:
    """The line of a flight about a mission that was proposed earlier, as `rtshcua run` writes it."""
    answer = missions.check(mission, 1_000_000)
    assert answer.policy is not None
    assert answer.mission is not None
    steps = [
        {"step": each.step, "phase": answer.mission.phases[each.phase], "text": call(answer.policy, each)}
        for each in answer.mission.invocations
    ]
    return {"type": "mission", "digest": (bytes([8]) * 32).hex(), "mission": answer.mission.name,
            "policy_digest": desk._signer.digest.hex(), "steps": steps}  # fmt: skip


SHORTER = deepcopy(PROPOSAL)
SHORTER["phases"][1]["steps"].pop()


def test_server_that_began_again_recognises_the_flying_mission(
    desk: Tools, handed: list[bytes], missions: Missions
) -> None:
    flying(desk)
    desk.following.mission = told_of(desk, missions, PROPOSAL)
    found = desk.propose_mission(PROPOSAL, "one")
    assert (found["accepted"], found["state"], found["code"]) == (True, "flying", "accepted")
    assert "already flying" in found["text"]
    assert status(desk, found["ticket"]) == "admitted"
    assert desk.propose_mission(PROPOSAL, "one")["ticket"] == found["ticket"]
    assert desk.propose_mission(PROPOSAL, "two")["state"] == "flying"
    assert handed == []
    replaced = desk.replan(SHORTER, 3, "three")
    assert replaced["accepted"], "the flying mission is known again"
    assert status(desk, replaced["ticket"]) == "admitted"
    assert len(handed) == 1


def test_server_that_began_again_recognises_a_flying_replacement(
    desk: Tools, handed: list[bytes], missions: Missions
) -> None:
    flying(desk)
    desk.following.mission = told_of(desk, missions, SHORTER)
    with pytest.raises(Misused) as misused:
        desk.replan(PROPOSAL, 3, "one")
    assert misused.value.code == "not-flying"
    assert desk.replan(SHORTER, 3, "two")["state"] == "flying"
    assert handed == []
    other = deepcopy(SHORTER)
    other["phases"][1]["steps"][0]["on_inadmissible"] = "skip"
    assert status(desk, desk.replan(other, 2, "three")["ticket"]) == "admitted", "overrides may change"
    assert len(handed) == 1


@pytest.mark.parametrize("key", ["mission", "policy_digest", "steps"])
def test_mission_that_differs_in_what_the_vehicle_tells_is_handed_in(
    desk: Tools, handed: list[bytes], missions: Missions, key: str
) -> None:
    flying(desk)
    other = {"mission": "other", "policy_digest": "00" * 32, "steps": told_of(desk, missions, SHORTER)["steps"]}
    desk.following.mission = told_of(desk, missions, PROPOSAL) | {key: other[key]}
    assert status(desk, desk.propose_mission(PROPOSAL, "one")["ticket"]) == "admitted"
    assert len(handed) == 1


@pytest.mark.parametrize(("flown", "state", "code"), [(PROPOSAL, "admitted", "accepted"), (SHORTER, "refused", None)])
def test_bundle_refused_by_a_flight_is_told_what_flies(
    desk: Tools, missions: Missions, monkeypatch: pytest.MonkeyPatch, flown: Any, state: str, code: str | None
) -> None:
    """Another host proposed in the meantime; the flight calls a bundle malformed."""

    def hand_in(socket: Path, document: bytes) -> tuple[str, str]:
        flying(desk)
        desk.following.mission = told_of(desk, missions, flown)
        return "malformed", "not a signed envelope"

    monkeypatch.setattr(desks, "hand_in", hand_in)
    ticket = desk.propose_mission(PROPOSAL, "one")["ticket"]
    assert status(desk, ticket) == state
    shown = desk.mission_status(ticket)
    assert shown["code"] == (code or "already-flying")
    assert ("another mission is flying" in shown.get("text", "")) == (state == "refused")
    if state == "admitted":
        assert desk.propose_mission(PROPOSAL, "one")["state"] == "flying"


def test_another_proposal_or_one_after_the_flight_is_handed_in(desk: Tools, handed: list[bytes]) -> None:
    first = desk.propose_mission(PROPOSAL, "one")
    assert status(desk, first["ticket"]) == "admitted"
    flying(desk)
    other = deepcopy(PROPOSAL) | {"intent": "another"}
    assert status(desk, desk.propose_mission(other, "two")["ticket"]) == "admitted"
    desk.following.connected = False
    assert desk.following.stage != "flying"
    assert status(desk, desk.propose_mission(other, "three")["ticket"]) == "admitted"
    assert len(handed) == 3


def test_proposals_are_bounded(desk: Tools, handed: list[bytes], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(desks, "MOST_TICKETS", 1)
    assert desk.propose_mission(PROPOSAL, "one")["accepted"]
    with pytest.raises(Misused) as misused:
        desk.propose_mission(PROPOSAL, "two")
    assert misused.value.code == "too-many"
    assert desk.propose_mission(PROPOSAL, "one")["accepted"], "what is known is answered as before"


def test_cancellation_names_only_the_flight(desk: Tools, handed: list[bytes]) -> None:
    with pytest.raises(Misused) as misused:
        desk.cancel()
    assert (misused.value.code, handed) == ("not-flying", [])
    flight, mission = bytes([7]) * 16, bytes([8]) * 32
    for told in ({"digest": mission.hex()}, {"digest": "no"}, {}):
        desk.following.connected, desk.following.hello = True, {"flight": flight.hex()}
        desk.following.mission = {"type": "mission", **told}
        if told.get("digest") == mission.hex():
            answer = desk.cancel()
            assert (answer["accepted"], answer["flies"][-1]) == (True, "emergency_land")
        else:
            with pytest.raises(Misused):
                desk.cancel()
    (document,) = handed
    kind = names.CANCELLATION
    opened = cose.open1(document, keys={AGENT.kid: AGENT.verification()}, duty=Duty.MISSION,
                        content_type=kind.content_type, limit=MAX_DOCUMENT)  # fmt: skip
    said = parse(kind, opened.payload, CancellationDocument)
    assert (said.flight, said.mission) == (flight, mission)
    assert 0 < said.expires_at_us - said.issued_at_us <= MAX_LIFE_US


def test_decision_is_explained_only_by_its_own_mission(desk: Tools, handed: list[bytes], missions: Missions) -> None:
    assert status(desk, desk.propose_mission(PROPOSAL, "one")["ticket"]) == "admitted"
    other = missions.check(PROPOSAL, 1_000_000).mission  # issued at another time
    assert other is not None
    ((_, mission),) = desk._admitted
    slots = 1 + max(slot for each in missions.policy.signals for slot in each.slots)
    for flown, explained in ((mission, True), (other, False)):
        step = bind(flown, desk._signer.digest, after=b"what it replaced").invocations[0]
        named = {"invocation": step.invocation_id.hex(), "binding": step.binding.hex()}
        desk.following.records.clear()
        desk.following.records.append(
            RECORDED
            | named
            | {"utc_us": mission.issued_at_us + 1, "state": {"values": [0] * slots, "ages": [0] * slots}}
        )
        told = desk.explain_decision()
        assert told["seq"] == 7
        assert ("limit" in told) is explained
        if explained:
            assert [each["name"] for each in told["untrusted"]["observed"]] == ["landed"]
            assert told["nearest"], "it says what would have passed"


#: lines of a flight, of each type that is read
LINES: dict[str, dict[str, Any]] = {
    "hello": {"type": "hello", "vehicle": "quad-07", "flight": "07" * 16, "mode": "software"},
    "waiting": {"type": "waiting", "policy": "p@1"},
    "vehicle": {"type": "vehicle", "ready": True, "unready": None, "armed": False, "airborne": False, "signals": []},
    "mission": {
        "type": "mission",
        "digest": "08" * 32,
        "mission": "proposal",
        "policy_digest": "06" * 32,
        "steps": [{"phase": "departure", "text": "takeoff(altitude = 25 m)"}],
    },
    "decision": RECORDED | {"binding": "09" * 32, "invocation": "0a" * 16, "state": {"values": [0], "ages": [0]}},
    "effect": {"type": "effect", "seq": 8, "event": "replan", "step": 1, "detail": "within 5 ms", "token": -1},
    "seal": {"type": "seal", "seq": 9},
    "recover": {"type": "recover", "seq": 10},
    "close": {"type": "close", "seq": 11, "ending": "completed"},
}
HOSTILE: tuple[Any, ...] = ("x", "\ud800", None, [], {}, True, -5, 1.5, 1 << 70)


def ask_everything(desk: Tools) -> None:
    """Call each tool that reads the vehicle's state; it may refuse."""
    for ask in (desk.describe_vehicle, desk.flight, desk.explain_decision, desk.cancel, desk._in_force,
                lambda: desk.explain_decision(7), lambda: desk.read_evidence(3, 2)):  # fmt: skip
        try:
            ask()
        except Misused:
            continue


@rows("kind", tuple(LINES))
def test_no_line_of_whoever_listens_at_the_socket_fails_a_tool(kind: str, desk: Tools, handed: list[bytes]) -> None:
    """Regression: its fields were assumed to be numbers and hexadecimal texts."""
    desk.following.hello, desk.following.mission = {}, {}
    desk.following.connected = True
    assert status(desk, desk.propose_mission(PROPOSAL, "one")["ticket"]) == "admitted"
    for key in LINES[kind]:
        for value in HOSTILE:
            desk.following.records.clear()
            for line in LINES.values():
                told = line | {key: value} if line is LINES[kind] else line
                with suppress(ValueError):  # the connection is closed
                    desk.following._take(understood(told), 1)
            ask_everything(desk)


@pytest.mark.parametrize("line", [7, None, [], "hello", {"type": 7}, {"type": "later"}, {}])
def test_a_line_of_no_type_that_is_read_is_passed_over(line: Any) -> None:
    assert understood(line) == {}


@pytest.mark.parametrize("kind", LINES)
def test_lines_are_forwarded_unchanged(kind: str) -> None:
    line = LINES[kind] | ({} if kind == "decision" else {"more": [1, {"a": None}]})
    assert understood(line) is line
