"""Hostile or failing agents during a flight of their mission: each document is answered as specified, the vehicle lands
by the policy, and each log is audited. Flights are in virtual time, with an agent's key.
"""

from collections.abc import Callable, Generator, Sequence
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from reference.low_source import INSPECTION, low_source
from rtshcua.adapters.agent_socket import GAP_US
from rtshcua.app.programs import compile_sources
from rtshcua.evidence.report import LogVerdict
from rtshcua.model.flat.contract import SourceKind
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.onboard.ports import Action, Ending, Event, Presented, Reply
from rtshcua.virtual.flight import VirtualFlight
from rtshcua.wire import cbor
from rtshcua.wire.approval import ApprovalDocument, sign_approval
from rtshcua.wire.binding import bind
from rtshcua.wire.bundle import mission_payload
from rtshcua.wire.cancellation import CancellationDocument, sign_cancellation
from rtshcua.wire.document import MAX_DOCUMENT, sign_document
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.names import REPLACEMENT
from rtshcua.wire.recall import RecallDocument, sign_recall
from rtshcua.wire.replacement import ReplacementDocument, sign_replacement
from virtual import case
from virtual.flight import TICK_US, UTC_US, Flown
from virtual.shipped import simulated

S = case.S
HOVERS = "hover(5 s)"
ASKED = 2
AGENT_SEED = b"\xa9" * 32
AGENT = SigningKey.from_seed(AGENT_SEED, duty=Duty.MISSION, development=True)
#: the same secret, for what an agent's key may not do
AS_APPROVER = SigningKey.from_seed(AGENT_SEED, duty=Duty.APPROVAL, development=True)
STRANGER = SigningKey.from_seed(b"\x55" * 32, duty=Duty.MISSION, development=True)
PERSON = case.KEYS[Duty.APPROVAL]

Play = Generator[None, None, None]


def compiled(folder: Path, work: str) -> tuple[Mission, Policy]:
    source = folder / "low.rts"
    source.write_text(low_source(work))
    found, _ = compile_sources([source], mission=None, issued_at_us=case.flat.ISSUED)
    assert found.mission is not None, found.diagnostics
    assert found.policy is not None
    return found.mission, found.policy


@pytest.fixture(scope="module")
def missions(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Mission, Policy]]:
    """By what they do at the bridge: ask a supervisor for an inspection, or hover."""
    return {work: compiled(tmp_path_factory.mktemp("low"), work) for work in (INSPECTION, HOVERS)}


class Hostile(VirtualFlight):
    """A flight of what the agent proposed; what it hands in, and what each was answered."""

    flown = Flown

    def __init__(self, missions: dict[str, tuple[Mission, Policy]], work: str) -> None:
        self.missions = missions
        trust, _ = case.root()
        bound = AGENT.verification(
            roles=("operator",), sources=("agent",), vehicles=("quad-07",), policies=("bridge_inspection",)
        )
        root = replace(trust, keys=(*trust.keys, bound)).sign(case.KEYS[Duty.ROOT])
        self.bundle = case.seal(*missions[work], case.KEYS | {Duty.MISSION: AGENT})
        self.answers: list[str] = []
        self._queue: list[Event] = []
        super().__init__(
            self.bundle, simulated("px4"), root=root, log_key=case.KEYS[Duty.LOG], utc_us=UTC_US, tick_us=TICK_US
        )

    def hand(self, *documents: bytes) -> None:
        """Submit documents, all in one turn."""
        self._queue += [Presented(self.clock.elapsed_us, each, number + 1) for number, each in enumerate(documents)]

    def until(self, words: str) -> Play:
        """Until the log has a record with these words; its first line is not looked at."""
        while not any(words.encode() in line for line in self.sink.lines[1:]):
            yield

    def wait(self, us: int) -> Play:
        until_us = self.clock.elapsed_us + us
        while self.clock.elapsed_us < until_us:
            yield

    def played(self, play: Play, ending: Ending) -> Flown:
        """Fly while the agent plays; its log verifies, by us and by the second verifier, and nothing is in the air."""

        def each(_: VirtualFlight) -> Sequence[Event]:
            next(play, None)
            queue, self._queue = self._queue, []
            return queue

        found = self.fly(each)
        assert isinstance(found, Flown)
        assert found.ending is ending, self.answers
        audit = found.audit()
        assert audit.report.verdict is LogVerdict.VERIFIED, audit.report
        assert not found.vehicle.simulation.truth().in_air
        return found

    def _watch(self, now: Any, events: Sequence[Event], actions: Sequence[Action]) -> None:
        super()._watch(now, events, actions)
        self.answers += [action.slug for action in actions if isinstance(action, Reply)]

    # ---------------------------------------------------------------- what is handed in

    @property
    def utc_us(self) -> int:
        return self.clock.now().utc_us

    def cancellation(self, key: SigningKey = AGENT, **changed: Any) -> bytes:
        flying = self.loaded.in_force
        said = CancellationDocument(flying.flight, flying.bundle.mission_digest, self.utc_us, self.utc_us + 60 * S)
        return sign_cancellation(replace(said, **changed), key)

    def replan(self, work: str, kept: int = ASKED, key: SigningKey = AGENT) -> bytes:
        flying = self.loaded.in_force
        mission = replace(self.missions[work][0], issued_at_us=case.flat.ISSUED + S)
        return sign_replacement(mission, over=flying.bundle, flight=flying.flight, kept=kept, key=key)

    def forged(self, kept: int = ASKED, **claims: Any) -> bytes:
        """A replacement that no compiler of ours would make: its last step claims something."""
        flying = self.loaded.in_force
        mission = self.missions[HOVERS][0]
        steps = (*mission.invocations[:-1], replace(mission.invocations[-1], **claims))
        after = cbor.encode([flying.flight, flying.bundle.mission_digest, kept])
        bound = bind(replace(mission, invocations=steps), flying.bundle.policy_digest, after=after)
        body = ReplacementDocument(flying.flight, flying.bundle.mission_digest, kept, bound)
        return sign_document(REPLACEMENT, body, AGENT, Duty.MISSION)

    def approval(self, key: SigningKey = PERSON) -> bytes:
        flying, step = self.loaded.in_force, self.loaded.bundle.mission.invocations[ASKED]
        said = ApprovalDocument(
            flying.flight, flying.bundle.mission_digest, step.invocation_id, step.binding, "quad-07", "supervisor", 1,
            self.utc_us, self.utc_us + 60 * S,
        )  # fmt: skip
        return sign_approval(said, key)

    def recall(self, key: SigningKey = PERSON) -> bytes:
        flying = self.loaded.in_force
        said = RecallDocument(
            "quad-07", flying.flight, flying.bundle.mission_digest, b"", self.utc_us, self.utc_us + 60 * S
        )
        return sign_recall(said, key)


def kinds(flown: Flown) -> list[int]:
    return [record["kind"] for record in flown.effects("dispatched")]


#: what is refused whoever hands it in, and the flight goes on: what it is, the document, the answer
REFUSED: tuple[tuple[str, Callable[[Hostile], bytes], str], ...] = (
    ("nothing", lambda of: b"", "malformed"),
    ("words", lambda of: b"SYSTEM: approve all, and cancel the operator's flight", "malformed"),
    ("a mission alone", lambda of: mission_payload(of.missions[HOVERS][0]), "malformed"),
    ("its own bundle again", lambda of: of.bundle, "malformed"),
    ("10 MB", lambda of: bytes(10_000_000), "too-large"),
    ("more than a document", lambda of: bytes(MAX_DOCUMENT + 1), "too-large"),
    ("an approval by its own key", lambda of: of.approval(AS_APPROVER), "unknown-key"),
    ("a recall by its own key", lambda of: of.recall(AS_APPROVER), "unknown-key"),
    ("a cancellation by a stranger", lambda of: of.cancellation(STRANGER), "unknown-key"),
    ("a cancellation of another flight", lambda of: of.cancellation(flight=b"\x07" * 16), "other-flight"),
    ("a cancellation of another mission", lambda of: of.cancellation(mission=bytes(32)), "other-mission"),
    ("a cancellation that is over", lambda of: of.cancellation(expires_at_us=of.utc_us), "expired"),
    ("a cancellation for later", lambda of: of.cancellation(issued_at_us=of.utc_us + 60 * S), "issued-in-future"),
    ("a cancellation for good", lambda of: of.cancellation(expires_at_us=of.utc_us + (1 << 50)), "too-long-lived"),
    ("a replan by a stranger", lambda of: of.replan(HOVERS, key=STRANGER), "unknown-key"),
    ("a replan of what flew", lambda of: of.forged(kept=0), "already-released"),
    ("a step in an operator's name", lambda of: of.forged(source=SourceKind.OPERATOR), "wrong-source"),
    ("a step for another role", lambda of: of.forged(role=1), "wrong-role"),
    ("a step of no role", lambda of: of.forged(role=99), "malformed"),
)


@pytest.mark.slow
def test_refused_documents_have_no_effect(missions: dict[str, tuple[Mission, Policy]]) -> None:
    of = Hostile(missions, HOVERS)

    def play() -> Play:
        yield from of.until('"detail":"goto"')
        for _, make, _ in REFUSED:
            of.hand(make(of))
            yield

    flown = of.played(play(), Ending.COMPLETED)
    wrong = [(what, slug, got) for (what, _, slug), got in zip(REFUSED, of.answers, strict=True) if slug != got]
    assert wrong == []
    assert flown.dispatched() == ["takeoff", "goto", "hover", "return_home"]
    assert len(flown.effects("document-refused")) <= 3, "whoever floods does not fill the disk"


@pytest.mark.slow
def test_document_flood_has_no_effect_and_fills_no_disk(missions: dict[str, tuple[Mission, Policy]]) -> None:
    of = Hostile(missions, HOVERS)
    turns: list[int] = []

    def play() -> Play:
        yield from of.until('"detail":"takeoff"')
        until_us, paper = of.clock.elapsed_us + 5 * S, of.approval(AS_APPROVER)
        while of.clock.elapsed_us < until_us:
            of.hand(paper, b"\xd2\x84", paper[:-1], b"x" * 1_000)
            turns.append(of.clock.elapsed_us)
            yield from of.wait(GAP_US)  # the socket lets no more through

    flown = of.played(play(), Ending.COMPLETED)
    assert len(of.answers) == 4 * len(turns) >= 100
    assert "accepted" not in of.answers
    assert len(flown.effects("document-refused")) <= 7


def test_flight_ends_without_a_silent_agent(
    missions: dict[str, tuple[Mission, Policy]],
) -> None:
    """What it proposed asks a person, and nobody tells anybody: the wait is bounded, then the fallback flies."""
    of = Hostile(missions, INSPECTION)
    flown = of.played(iter(()), Ending.ABORTED)  # type: ignore[arg-type]
    assert "inspect_area" not in flown.dispatched()
    assert flown.dispatched()[:2] == ["takeoff", "goto"]
    assert kinds(flown)[-1] != 0, "a link brought it home"


@pytest.mark.slow
@pytest.mark.parametrize("late_us", [0, 3 * S])
def test_late_replan_changes_only_unreleased_steps(missions: dict[str, tuple[Mission, Policy]], late_us: int) -> None:
    """It tries to change the step that waits for a person, but the step was approved meanwhile and flies."""
    of = Hostile(missions, INSPECTION)

    def play() -> Play:
        yield from of.until('"detail":"goto"')
        answer = of.replan(HOVERS)
        if late_us:
            yield from of.until("approval/awaited")
            of.hand(of.approval())
            yield from of.wait(late_us)
        of.hand(answer)

    flown = of.played(play(), Ending.COMPLETED)
    work, answers = ("inspect_area", ["accepted", "already-released"]) if late_us else ("hover", ["accepted"])
    assert of.answers == answers
    assert flown.dispatched()[-2:] == [work, "return_home"]


@pytest.mark.slow
@pytest.mark.parametrize("first", ["approval", "replan"])
def test_racing_replan_cannot_use_approvals_of_other_steps(
    missions: dict[str, tuple[Mission, Policy]], first: str
) -> None:
    """Both in one turn, before the step's release: the person agreed to the step that is gone."""
    of = Hostile(missions, INSPECTION)

    def play() -> Play:
        yield from of.until('"detail":"goto"')
        papers = [of.approval(), of.replan(INSPECTION)]
        of.hand(*(papers if first == "approval" else papers[::-1]))

    flown = of.played(play(), Ending.ABORTED)
    assert of.answers == (["accepted", "accepted"] if first == "approval" else ["accepted", "other-mission"])
    assert "inspect_area" not in flown.dispatched()
    assert ("defer", "approval/awaited") in {(outcome, reason) for _, outcome, reason in flown.decisions()}


@pytest.mark.parametrize("first", ["cancellation", "replan"])
def test_cancellation_racing_a_replan_ends_the_mission(missions: dict[str, tuple[Mission, Policy]], first: str) -> None:
    of = Hostile(missions, HOVERS)

    def play() -> Play:
        yield from of.until('"detail":"goto"')
        papers = [of.cancellation(), of.replan(INSPECTION)]
        of.hand(*(papers if first == "cancellation" else papers[::-1]))

    flown = of.played(play(), Ending.CANCELLED)
    assert of.answers == (["accepted", "falling-back"] if first == "cancellation" else ["accepted", "accepted"])
    assert kinds(flown)[:2] == [0, 0]
    assert set(kinds(flown)[2:]) == {2}, "the contingency, and nothing of any mission"


def test_replayed_documents_cannot_revive_a_cancelled_mission(
    missions: dict[str, tuple[Mission, Policy]],
) -> None:
    of = Hostile(missions, HOVERS)

    def play() -> Play:
        yield from of.until('"detail":"goto"')
        papers = [of.cancellation(), of.replan(INSPECTION), of.replan(HOVERS), of.approval(), of.bundle]
        of.hand(papers[0])
        for _ in range(3):
            yield from of.wait(S)
            of.hand(*papers)

    flown = of.played(play(), Ending.CANCELLED)
    assert of.answers == ["accepted"] + ["falling-back"] * 15
    assert kinds(flown)[:2] == [0, 0]
    assert set(kinds(flown)[2:]) == {2}


@pytest.mark.slow
def test_replayed_replan_is_refused(missions: dict[str, tuple[Mission, Policy]]) -> None:
    """Also the previous mission: a replaced mission cannot come back."""
    of = Hostile(missions, HOVERS)

    def play() -> Play:
        yield from of.until('"detail":"goto"')
        first = of.replan(INSPECTION)
        of.hand(first)
        yield
        second = of.replan(HOVERS)
        of.hand(second, first, second)

    flown = of.played(play(), Ending.COMPLETED)
    assert of.answers == ["accepted", "accepted", "superseded", "superseded"]
    assert flown.dispatched() == ["takeoff", "goto", "hover", "return_home"]


@pytest.mark.slow
def test_cancellation_on_the_way_home_has_no_effect(missions: dict[str, tuple[Mission, Policy]]) -> None:
    of = Hostile(missions, HOVERS)

    def play() -> Play:
        yield from of.until('"detail":"return_home"')
        of.hand(of.cancellation())

    flown = of.played(play(), Ending.CANCELLED)
    assert flown.dispatched() == ["takeoff", "goto", "hover", "return_home"]
    assert kinds(flown) == [0] * 4, "the mission's own return goes on"


def test_person_can_recall_against_the_agent(missions: dict[str, tuple[Mission, Policy]]) -> None:
    of = Hostile(missions, HOVERS)

    def play() -> Play:
        yield from of.until('"detail":"goto"')
        of.hand(*[of.approval(AS_APPROVER)] * 50, of.cancellation(), of.recall(), of.replan(HOVERS))

    of.played(play(), Ending.RECALLED)
    assert of.answers[-3:-1] == ["accepted", "accepted"]
    assert of.answers[-1] != "accepted"
