"""Proposals become a bundle, then replacements that the vehicle's boundary accepts, whatever happens in between."""

import json
import socket
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import msgspec
import pytest
from pymavlink.dialects.v10 import ardupilotmega as mavlink1
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.adapters.gateway.messages import RelayKind, RelayMessage, Up
from rtshcua.adapters.store.keystore import KeyStore, read_key
from rtshcua.app.gateway.configuration import ConfiguredClient
from rtshcua.app.gateway.gateway_service import FlightWords, GatewayService
from rtshcua.app.gateway.policy_in_force import PolicyInForce, Unlock, development_keys, policy_in_force
from rtshcua.app.gateway.proposals import FlightMission, ProposalMoment, Proposals, SignedProposal, arranged
from rtshcua.app.gateway.quick_policy import QuickRules, policy_text
from rtshcua.app.gateway.relay_process import StartedRelay
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.exchange.stock_policy import GeoPoint
from rtshcua.ground.gateway.interface import Event, ProposalAnswered, ProposalChecked, Propose, ProposedStep
from rtshcua.ground.prove.step_starts import FROM_HOME, MissionStart, StartPlace
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.situation import Now
from rtshcua.wire.bundle import Bundle, open_bundle
from rtshcua.wire.cancellation import open_cancellation
from rtshcua.wire.keys import Duty
from rtshcua.wire.replacement import fit_replacement, open_replacement
from rtshcua.wire.trust import TrustRoot, open_root

FLIGHT = bytes(range(16))
ALOFT = MissionStart(StartPlace(0, 0, 10_000, aloft=True), 9_000)
TAKEOFF = ProposedStep("takeoff", {"altitude": "10 m"}, ())
LAND = ProposedStep("emergency_land", {}, ())


def goto(longitude: str, altitude: str = "10 m") -> ProposedStep:
    return ProposedStep("goto", {"target": f"47.3977000 N, {longitude} E", "altitude": altitude}, ())


class Vehicle:
    """The boundary's side: it opens what the gateway signs, with the trust root alone."""

    def __init__(self, root: TrustRoot) -> None:
        self.root = root
        self.bundle: Bundle | None = None
        self.released = 0

    def now(self) -> Now:
        return Now(0, time.time_ns() // 1_000, 1_000_000)

    def take(self, document: bytes) -> None:
        if self.bundle is None:
            self.bundle = open_bundle(document, root=self.root, vehicle="gateway-01", now_us=self.now().utc_us)
            return
        found = open_replacement(
            document, root=self.root, vehicle="gateway-01", flight=FLIGHT, bundle=self.bundle, now=self.now()
        )
        self.bundle = fit_replacement(found, self.bundle, self.released)

    @property
    def steps(self) -> list[str]:
        assert self.bundle is not None
        mission = self.bundle.mission
        return [f"{mission.phases[each.phase]}: {each.contract.name}" for each in mission.invocations]

    def in_force(self, mission: Mission) -> FlightMission:
        assert self.bundle is not None
        return FlightMission(mission, self.bundle.mission_digest)


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> KeyStore:
    return development_keys(tmp_path_factory.mktemp("keys") / "data", ("gateway",))


def unlocking(store: KeyStore) -> Unlock:
    return lambda duty, whose: read_key(store.key_path(duty, whose=whose), duty, passphrase=None)


@pytest.fixture(scope="module")
def policy(store: KeyStore, tmp_path_factory: pytest.TempPathFactory) -> PolicyInForce:
    folder = tmp_path_factory.mktemp("policy")
    text = policy_text(
        QuickRules(("takeoff", "goto"), 30_000, (), "gateway-01"), GeoPoint(473_977_400, 85_455_900), 30_000
    )
    assert isinstance(text, str)
    source = folder / "policy.rts"
    source.write_text(text)
    found = policy_in_force([source], None, folder, ["operator"], store, unlocking(store))
    assert isinstance(found, PolicyInForce)
    return found


@pytest.fixture
def vehicle(store: KeyStore) -> Vehicle:
    return Vehicle(open_root(store.root(), pinned=store.pin(), now_us=0))


@pytest.fixture
def proposals(policy: PolicyInForce) -> Proposals:
    return Proposals(policy.missions, policy.signer, lambda: None)


def moment(
    in_force: FlightMission | None = None, released: int = 0, start: MissionStart | None = FROM_HOME
) -> ProposalMoment:
    return ProposalMoment(time.time_ns() // 1_000, start, FLIGHT, in_force, released)


def signed(proposals: Proposals, at: ProposalMoment) -> tuple[list[Event], SignedProposal | None]:
    """Wait for the worker."""
    events: list[Event] = []
    for _ in range(2_000):
        more, document = proposals.advance(at, ready=True)
        events += more
        if document is not None or any(isinstance(each, ProposalChecked) for each in events):
            return events, document
        time.sleep(0.005)
    raise AssertionError("the worker does not end")


def propose(number: int, *steps: ProposedStep, fly: bool = True, role: str = "operator") -> Propose:
    return Propose(number, 1, role, steps, fly)


def test_a_session_is_a_bundle_and_replacements(proposals: Proposals, vehicle: Vehicle) -> None:
    assert proposals.add(propose(1, TAKEOFF)) == []
    events, first = signed(proposals, moment())
    assert events == [ProposalChecked(1, None, 0)]
    assert first is not None
    vehicle.take(first.document)
    told, mission = proposals.answered("accepted", "")
    assert told == [ProposalAnswered(1, "accepted")]
    assert mission is not None
    assert vehicle.bundle is not None
    vehicle.released = 1
    for number, longitude in enumerate(("8.5458000", "8.5452000", "8.5460000"), 2):
        proposals.add(propose(number, goto(longitude)))
        at = moment(vehicle.in_force(mission), vehicle.released, ALOFT)
        events, document = signed(proposals, at)
        assert events == [ProposalChecked(number, None, number - 1)]
        assert document is not None
        vehicle.take(document.document)
        _, mission = proposals.answered("accepted", "")
        assert mission is not None
        vehicle.released = number
    assert vehicle.steps == ["departure: takeoff"] + ["departure: goto"] * 3


def test_steps_that_were_not_released_are_replaced(proposals: Proposals, vehicle: Vehicle) -> None:
    proposals.add(propose(1, TAKEOFF, goto("8.5458000"), goto("8.5452000"), LAND))
    _, first = signed(proposals, moment())
    assert first is not None
    vehicle.take(first.document)
    _, mission = proposals.answered("accepted", "")
    assert mission is not None
    vehicle.released = 2
    proposals.add(propose(2, LAND))
    events, second = signed(proposals, moment(vehicle.in_force(mission), 2, ALOFT))
    assert events == [ProposalChecked(2, None, 2)]
    assert second is not None
    vehicle.take(second.document)
    assert vehicle.steps == ["departure: takeoff", "departure: goto", "departure: emergency_land"]


def test_a_step_that_was_released_meanwhile_is_kept(proposals: Proposals, vehicle: Vehicle) -> None:
    proposals.add(propose(1, TAKEOFF, goto("8.5458000")))
    _, first = signed(proposals, moment())
    assert first is not None
    vehicle.take(first.document)
    _, mission = proposals.answered("accepted", "")
    assert mission is not None
    proposals.add(propose(2, LAND))
    _, early = signed(proposals, moment(vehicle.in_force(mission), 1, ALOFT))
    assert early is not None
    vehicle.released = 2
    assert proposals.answered("already-released", "the replacement changes step 2") == ([], None)
    events, late = signed(proposals, moment(vehicle.in_force(mission), 2, ALOFT))
    assert events == [ProposalChecked(2, None, 2)]
    assert late is not None
    vehicle.take(late.document)
    assert vehicle.steps[-1] == "departure: emergency_land"


def test_after_many_commands_only_a_way_down_is_taken(
    proposals: Proposals, vehicle: Vehicle, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rtshcua.app.gateway.proposals._MOST_REPLACED", 1)
    mission: Mission | None = None
    for number, step in enumerate((TAKEOFF, goto("8.5458000"), goto("8.5452000"), LAND)):
        proposals.add(propose(number, step))
        at = moment() if mission is None else moment(vehicle.in_force(mission), vehicle.released, ALOFT)
        events, document = signed(proposals, at)
        if number == 2:
            assert document is None
            assert "land, and take off again" in str(events)
            continue
        assert document is not None
        vehicle.take(document.document)
        _, mission = proposals.answered("accepted", "")
        vehicle.released += 1
    assert [each.split()[-1] for each in vehicle.steps] == ["takeoff", "goto", "emergency_land"]


def test_refusals_are_in_words_for_people(proposals: Proposals) -> None:
    proposals.add(propose(1, ProposedStep("takeoff", {"altitude": "40 m"}, ())))
    events, document = signed(proposals, moment())
    assert document is None
    (refusal,) = events
    assert isinstance(refusal, ProposalChecked)
    assert "altitude" in str(refusal.refusal)
    assert "nearest accepted: 30 m" in str(refusal.refusal)
    assert "/phases/" not in str(refusal.refusal)


def test_nothing_is_proposed_from_an_unknown_place(proposals: Proposals) -> None:
    proposals.add(propose(1, TAKEOFF))
    events, document = signed(proposals, moment(start=None))
    assert events == [ProposalChecked(1, "the vehicle does not report its position", for_now=True)]
    assert document is None


def test_an_uploaded_mission_is_checked_and_not_signed(proposals: Proposals) -> None:
    proposals.add(propose(1, TAKEOFF, goto("8.5458000"), LAND, fly=False))
    events, document = signed(proposals, moment())
    assert events == [ProposalChecked(1, None)]
    assert document is None
    assert not proposals.busy


def test_missions_of_absent_clients_are_all_checked(proposals: Proposals) -> None:
    """They have the same number, 0."""
    for number in range(3):
        assert proposals.add(propose(number, TAKEOFF, fly=False)._replace(client=0)) == []
    events: list[Event] = []
    while proposals.busy:
        events += signed(proposals, moment())[0]
    assert events == [ProposalChecked(number, None) for number in range(3)]


def test_too_many_proposals_and_the_end_of_a_flight(proposals: Proposals) -> None:
    refused = [each for number in range(40) for each in proposals.add(propose(number, TAKEOFF))]
    assert len(refused) == 40 - 16
    told = proposals.forget()
    assert len(told) == 16
    proposals.close()


def test_the_flight_ends_while_a_document_is_with_it(proposals: Proposals) -> None:
    proposals.add(propose(1, TAKEOFF))
    _, document = signed(proposals, moment())
    assert document is not None
    assert proposals.forget() == [ProposalAnswered(1, "unreachable", "the flight ended")]
    assert proposals.answered("accepted", "") == ([], None)


def test_what_is_compiled_for_a_flight_that_ended_is_never_handed_in(proposals: Proposals) -> None:
    proposals.add(propose(1, TAKEOFF))
    assert proposals.advance(moment(), ready=True) == ([], None), "the worker compiles"
    assert proposals.forget() == [ProposalChecked(1, "the flight ended", for_now=True)]
    proposals.add(propose(2, LAND))
    assert [each.number for each in signed(proposals, moment())[0] if isinstance(each, ProposalChecked)] == [2]


def test_the_check_of_a_mission_goes_on_when_a_flight_ends(proposals: Proposals) -> None:
    for number in (1, 2):
        proposals.add(Propose(number, number, "operator", (TAKEOFF, LAND), fly=False))
    proposals.advance(moment(), ready=False)
    assert proposals.forget() == []
    assert [signed(proposals, moment())[0] for _ in range(2)] == [
        [ProposalChecked(1, None)],
        [ProposalChecked(2, None)],
    ]


@pytest.mark.parametrize("compiled", [False, True])
def test_a_withdrawn_proposal_is_never_handed_in(proposals: Proposals, compiled: bool) -> None:
    proposals.add(propose(1, TAKEOFF))
    proposals.add(propose(2, TAKEOFF))
    proposals.add(propose(3, TAKEOFF))
    assert proposals.advance(moment(), ready=False) == ([], None), "the worker compiles"
    while compiled and proposals._compiled is None:
        assert proposals.advance(moment(), ready=False) == ([], None)
        time.sleep(0.005)
    proposals.withdraw(1)
    proposals.withdraw(2)
    events, document = signed(proposals, moment())
    assert events == [ProposalChecked(3, None, 0)]
    assert document is not None
    assert document.number == 3


def test_a_cancellation_is_for_the_mission_in_force(proposals: Proposals, vehicle: Vehicle) -> None:
    assert proposals.cancellation(moment()) is None
    proposals.add(propose(1, TAKEOFF))
    _, first = signed(proposals, moment())
    assert first is not None
    vehicle.take(first.document)
    assert vehicle.bundle is not None
    document = proposals.cancellation(moment(vehicle.in_force(first.mission), 1))
    assert document is not None
    open_cancellation(
        document, root=vehicle.root, vehicle="gateway-01", flight=FLIGHT, bundle=vehicle.bundle, current=0,
        missions=[vehicle.bundle.mission_digest], now=vehicle.now(),
    )  # fmt: skip


def test_phases_follow_the_contracts(policy: PolicyInForce) -> None:
    contracts = {each.name: each for each in policy.missions.policy.contracts}

    def names(last: str | None, *steps: ProposedStep) -> list[tuple[str, int]]:
        return [(each["name"], len(each["steps"])) for each in arranged(steps, contracts, last)]

    assert names(None, TAKEOFF, goto("8.5")) == [("departure", 2)]
    assert names(None, goto("8.5")) == [("session", 1)]
    assert names("inspection", goto("8.5"), TAKEOFF) == [("inspection", 1), ("departure", 1)]


def test_a_policy_without_a_takeoff_for_agents_is_refused(store: KeyStore, tmp_path: Path) -> None:
    source = tmp_path / "policy.rts"
    text = policy_text(QuickRules(("goto",), 30_000, (), "gateway-01"), GeoPoint(473_977_400, 85_455_900), 30_000)
    source.write_text(str(text))
    found = policy_in_force([source], None, tmp_path, ["operator"], store, unlocking(store))
    assert isinstance(found, Refusal)
    assert found.slug == "no-takeoff"
    source.write_text("policy gateway version 1 {")
    broken = policy_in_force([source], None, tmp_path, ["operator"], store, unlocking(store))
    assert isinstance(broken, Refusal)
    assert broken.code is ExitCode.DIAGNOSTICS


def test_a_role_that_the_policy_does_not_name(store: KeyStore, policy: PolicyInForce, tmp_path: Path) -> None:
    source = policy.base.parent / "policy.rts"
    found = policy_in_force([source], None, tmp_path, ["surveyor"], store, unlocking(store))
    assert isinstance(found, Refusal)
    assert "`operator`" in found.help


def test_a_bundle_under_another_policy_is_refused(store: KeyStore, policy: PolicyInForce, tmp_path: Path) -> None:
    source = policy.base.parent / "policy.rts"
    same = policy_in_force([source], policy.base, tmp_path, ["operator"], store, unlocking(store))
    assert isinstance(same, PolicyInForce)
    assert same.base == policy.base
    other = tmp_path / "other.rts"
    other.write_text(source.read_text().replace("version 1", "version 2"))
    found = policy_in_force([other], policy.base, tmp_path, ["operator"], store, unlocking(store))
    assert isinstance(found, Refusal)
    assert found.slug == "other-policy"


def test_development_keys_are_private_and_say_so(store: KeyStore) -> None:
    folder = store.folder.parent
    assert folder.stat().st_mode & 0o077 == 0
    assert "without a passphrase" in (folder / "DEVELOPMENT-KEYS.txt").read_text()
    assert store.key_path(Duty.MISSION, whose="agent").stat().st_mode & 0o077 == 0


# ---------------------------------------------------------------- the service with its relay


class Console:
    def __init__(self) -> None:
        self.events: list[Mapping[str, object]] = []

    def tell(self, event: Mapping[str, object]) -> None:
        self.events.append(event)


@contextmanager
def serving(policy: PolicyInForce, folder: Path) -> Iterator[tuple[GatewayService, socket.socket]]:
    """A gateway without a flight, and the vehicle's socket."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vehicle:
        vehicle.bind(("127.0.0.1", 0))
        clients = [ConfiguredClient("script", "udpout:127.0.0.1:9")]
        relay = StartedRelay.start(f"udpout:127.0.0.1:{vehicle.getsockname()[1]}", clients)
        assert isinstance(relay, StartedRelay)
        words = FlightWords((), folder / "agent", {}, folder / "root")
        service = GatewayService(
            relay, policy, clients, words, Console(), folder, system=1, utc_error_us=0, renew=lambda frames, now: None
        )
        with relay.session() as flight:  # the relay's socket of the vehicle opens with the first frame to it
            flight.send(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3).pack(mavlink.MAVLink(None, 1, 191)))
            vehicle.settimeout(10)
            vehicle.connect(vehicle.recvfrom(1_000)[1])
        try:
            yield service, vehicle
        finally:
            service.close()


def test_frames_of_mavlink_1_on_the_vehicles_link_are_no_fault(policy: PolicyInForce, tmp_path: Path) -> None:
    """A camera, a gimbal or another vehicle behind the autopilot may speak it."""
    old, new = mavlink1.MAVLink(None, 1, 42), mavlink.MAVLink(None, 1, 1)
    beat = mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3).pack(new)
    landed = mavlink.MAVLink_extended_sys_state_message(0, 2).pack(new)
    said = mavlink1.MAVLink_mission_current_message(7), mavlink1.MAVLink_extended_sys_state_message(0, 1)
    others = [each.pack(old) for each in said]
    station = mavlink.MAVLink_heartbeat_message(6, 12, 0, 0, 4, 3).pack(new)
    with serving(policy, tmp_path) as (service, vehicle):
        vehicle.send(b"".join(others) + station)
        for _ in range(20):
            assert service._turn(service._wait()) is None
        assert service._heard is None, "a ground station is no vehicle"
        vehicle.send(others[0] + beat + others[1] + landed + others[0])
        end_s = time.monotonic() + 10
        while (service._frames is None or service._frames.aloft is None) and time.monotonic() < end_s:
            assert service._turn(service._wait()) is None
        assert service._frames is not None
        assert service._frames.aloft, "frames between them are read"


def test_commands_before_the_vehicle_was_heard_are_recorded(policy: PolicyInForce, tmp_path: Path) -> None:
    takeoff = mavlink.MAVLink_command_long_message(1, 1, 22, 0, 0, 0, 0, 0, 0, 0, 10).pack(
        mavlink.MAVLink(None, 245, 1)
    )
    with serving(policy, tmp_path) as (service, _):
        up = RelayMessage(RelayKind.UP, 7, msgspec.json.encode(Up(0, "127.0.0.1:9")))
        for message in (up, RelayMessage(RelayKind.CLIENT, 7, bytes(takeoff))):
            service._from_relay(message, Now(0, 0, 0))
    (line,) = map(json.loads, (tmp_path / "gateway.jsonl").read_text().splitlines())
    assert (line["client"], line["effect"], line["command"]) == ("script", "refused", 22)
    assert line["reason"] == "no vehicle was heard yet"
