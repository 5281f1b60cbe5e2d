"""Threat: a compromised runtime has its memory, the socket to the boundary's process and every channel to the
vehicle. Only the boundary's process has the link's key.

Outcome: a vehicle that enforces signing, as implemented by each release (docs/flying/link.md), obeys no frame
without a permit, preparation permits included: no unsigned frames, none signed with other keys, none signed for
another purpose, and no replayed ones. A vehicle that does not enforce signing obeys anyone.
"""

import time
from math import nan
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from pymavlink.dialects.v20 import ardupilotmega as m

from boundary.sessions_in_c_and_python import PIN, SIGNED_ROOT
from reference.flat_case import S
from reference.world import ROOT, START, VEHICLE, answer_to, request_for, sealed
from rtshcua.adapters.boundary.process import BoundaryProcess, program
from rtshcua.adapters.clock import monotonic_ns
from rtshcua.codec.frames import Codec
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.mavlink.framing import FLAG_SIGNED, FLAGS
from rtshcua.mavlink.parameters import bits_of
from rtshcua.mavlink.signing import EPOCH_US, SignedLink, SigningState
from rtshcua.model.decision import Decision
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement.isolated import Caller, IsolatedGate
from rtshcua.onboard.enforcement.load import EnforcementMode, Loaded, load
from rtshcua.onboard.ports import Command
from rtshcua.simulation.config import AutopilotKind, SimulationConfig
from rtshcua.simulation.world import Simulation
from rtshcua.wire.preparation import ParameterWrite, Preparation, encode

pytestmark = pytest.mark.skipif(program() is None, reason="the boundary's program was not built")
KEY = b"the key of the link, 32 octets.."
SIGNATURE = 13
PREPARED, OTHER = ("FENCE_ALT_MAX", 50.0), ("GF_MAX_VER_DIST", 50.0)  # of ArduPilot, of PX4


class Vehicle(NamedTuple):
    """A release, and how it is connected to and set up."""

    flavour: str
    release: tuple[int, int]
    usb: bool = False
    sign_cfg: float | None = None

    def simulated(self, utc_us: int) -> Simulation:
        parameters = () if self.sign_cfg is None else (("MAV_SIGN_CFG", self.sign_cfg),)
        key = None if self.flavour == "px4" and self.release < (1, 17) else KEY
        return Simulation(SimulationConfig(
            flavour=AutopilotKind(self.flavour), release=self.release, usb=self.usb, signing_key=key, utc_us=utc_us,
            parameters=parameters,
        ))  # fmt: skip


#: every row of docs/flying/link.md in which a vehicle enforces signing,
ENFORCE = [
    Vehicle("ardupilot", (4, 6)), Vehicle("ardupilot", (4, 7)),
    Vehicle("px4", (1, 17), sign_cfg=1.0), Vehicle("px4", (1, 17), sign_cfg=2.0),
    Vehicle("px4", (1, 17), usb=True, sign_cfg=2.0), Vehicle("px4", (1, 18)), Vehicle("px4", (1, 18), usb=True),
]  # fmt: skip
#: and of vehicles that do not
OBEY_ANYONE = [
    Vehicle("ardupilot", (4, 7), usb=True), Vehicle("px4", (1, 16)), Vehicle("px4", (1, 17), sign_cfg=0.0),
    Vehicle("px4", (1, 17), usb=True, sign_cfg=1.0),
]  # fmt: skip


def named(vehicle: Vehicle) -> str:
    return "-".join(map(str, (vehicle.flavour, *vehicle.release, *("usb",) * vehicle.usb, vehicle.sign_cfg)))


def long(number: int, *parameters: float) -> Any:
    return m.MAVLink_command_long_message(1, 1, number, 0, *[*parameters, *[0.0] * (7 - len(parameters))])


def hostile() -> list[Any]:
    """Frames that move a vehicle, set its parameters, or remove its key."""
    place = (473_980_000, 85_460_000)
    sets = [
        m.MAVLink_param_set_message(1, 1, name, value, kind)
        for name in (b"MAV_SIGN_CFG", b"FENCE_ENABLE", b"FENCE_ALT_MAX", b"RTL_ALT", b"GF_ACTION", b"GF_MAX_VER_DIST")
        for value, kind in ((0.0, 9), (0.0, 6), (77.0, 9))
    ]
    return [
        *(long(400, *arm) for arm in ((1, 0), (1, 21196), (0, 21196))),
        *(long(22, 0, 0, 0, turn, nan, nan, up) for turn in (0, nan) for up in (30, 530)),
        *(long(176, 1, mode, sub) for mode in range(7) for sub in range(7)),
        *(long(number, 1) for number in (20, 21, 84, 178, 179, 185, 192, 241, 245, 246, 252, 300, 3000)),
        m.MAVLink_command_int_message(1, 1, 0, 192, 0, 0, -1, 1, 0, nan, *place, 520.0),
        m.MAVLink_set_position_target_global_int_message(0, 1, 1, 6, 0x0DF8, *place, 40, 0, 0, 0, 0, 0, 0, 0, 0),
        *(m.MAVLink_set_mode_message(1, 1, mode) for mode in (4, 5, 6, 9, 4 << 16, 2 << 24 | 4 << 16)),
        *sets,
        *(m.MAVLink_setup_signing_message(1, 1, list(key), 9) for key in (bytes(32), b"x" * 32)),
        m.MAVLink_mission_count_message(1, 1, 3, 0), m.MAVLink_mission_clear_all_message(1, 1, 0),
        m.MAVLink_manual_control_message(1, 0, 0, 900, 0, 0),
        m.MAVLink_rc_channels_override_message(1, 1, 1900, 1900, 1900, 1900, 1900, 1900, 1900, 1900),
    ]  # fmt: skip


class TakenOver:
    """The runtime, a vehicle that it reaches directly, and the boundary."""

    def __init__(self, vehicle: Vehicle, folder: Path) -> None:
        key = folder / "link.key"
        key.write_bytes(KEY)
        key.chmod(0o600)
        self.px4 = vehicle.flavour == "px4"
        self.name, value = PREPARED if vehicle.flavour == "ardupilot" else OTHER
        bits = bits_of(value)
        assert bits is not None
        self.bits = bits
        write = ParameterWrite(self.name, 0, bits)
        self.process = BoundaryProcess(
            SIGNED_ROOT, PIN, VEHICLE, folder, link_key=key, settings=encode(Preparation(0, False, 0, (write,))),
            paced=True,
        )  # fmt: skip
        self.began_us, self.utc_us = monotonic_ns() // 1_000, time.time_ns() // 1_000
        self.simulation = vehicle.simulated(self.utc_us)
        self.caller = Caller(self.process.call, signs=True)
        made = load(
            sealed(), root=ROOT, vehicle=VEHICLE, now=self.now, mode=EnforcementMode.PROCESS, session_key=bytes(32),
            flight=bytes(16), peer_is_own_simulator=False, settings={self.name: bits}, caller=self.caller,
        )  # fmt: skip
        assert isinstance(made, Loaded), made
        self.loaded = made
        gate = made.executor.frames
        assert isinstance(gate, IsolatedGate)
        self.gate = gate
        self.codec, self.good = Codec(1, 191), list[bytes]()
        self.wait(S)
        standing = self.seal(long(511, 245, 200_000))  # whether it stands on the ground, five times a second
        assert isinstance(standing, bytes), standing
        self.put(standing)
        self.wait(2 * S)

    @property
    def us(self) -> int:
        return self.began_us + self.simulation.now_us

    @property
    def now(self) -> Now:
        return Now(self.us, START.utc_us + self.us - self.began_us, START.utc_error_us)

    def wait(self, us: int) -> None:
        for _ in range(us // 100_000):
            self.heard(self.simulation.advance(self.simulation.now_us + 100_000))

    def heard(self, frames: list[bytes]) -> list[bytes]:
        for frame in frames:
            if frame[FLAGS] & FLAG_SIGNED:
                self.gate.accept(frame, self.us)
        return frames

    def put(self, frame: bytes) -> list[bytes]:
        return self.heard(self.simulation.receive(frame, self.simulation.now_us))

    def seal(self, message: Any) -> bytes | Refusal:
        return self.gate.seal(self.codec.pack(message), self.us)

    def housekeeping(self) -> bytes:
        """A frame that leaves without a permit."""
        frame = self.seal(long(512, 148))
        assert isinstance(frame, bytes), frame
        return frame

    def attack(self, messages: list[Any]) -> list[bytes]:
        """Send all that the runtime can make of these: its own frames, and frames that the boundary signed."""
        forger = SignedLink(b"x" * 32, SigningState(0, {}), self.utc_us + 90 * S, 0)
        passed = []
        for message in messages:
            self.codec.seq = 0
            own = self.codec.pack(message)
            station = Codec(255, 190).pack(message)
            signed = self.housekeeping()
            made = own[:FLAGS] + bytes([own[FLAGS] | FLAG_SIGNED]) + own[FLAGS + 1 :] + signed[-SIGNATURE:]
            sealed_ = self.gate.seal(own, self.us)
            if isinstance(sealed_, bytes):
                passed.append(sealed_)
            late = self.gate.seal(own, self.us + 5 * 60 * S)
            for frame in (own, station, made, forger.sign(own, self.simulation.now_us), *self.good[-3:]):
                self.put(frame)
            assert isinstance(late, bytes) == isinstance(sealed_, bytes)
            self.put(signed)
            self.good.append(signed)
        return passed

    def state(self) -> object:
        """The state that a successful attack would change."""
        a, truth = self.simulation._autopilot, self.simulation.truth()
        return truth.armed, a.vehicle.mode, dict(a.parameters._values), a.signing.on, len(a.mission.items)

    def close(self) -> None:
        self.process.close()


@pytest.fixture
def taken_over(request: pytest.FixtureRequest, tmp_path: Path) -> Any:
    made = TakenOver(request.param, tmp_path)
    yield made
    made.close()


enforcing = pytest.mark.parametrize("taken_over", ENFORCE, ids=named, indirect=True)


@enforcing
def test_vehicle_obeys_nothing_without_permit(taken_over: TakenOver) -> None:
    before = taken_over.state()
    answers = taken_over.put(taken_over.housekeeping())
    assert "AUTOPILOT_VERSION" in [f.name for each in answers for f in Codec(255, 1).parse(each)], "its key is good"
    assert taken_over.attack(hostile()) == []
    taken_over.wait(2 * S)
    assert taken_over.state() == before
    key = SignedLink(KEY, SigningState(0, {}), taken_over.utc_us + 300 * S, 0)
    for message in (long(176, 1, 4, 0), long(400, 1, 0)):
        taken_over.put(key.sign(taken_over.codec.pack(message), taken_over.simulation.now_us))
    assert taken_over.state() != before, "who has the key is obeyed: the vehicle would have done so"


@enforcing
def test_vehicle_obeys_only_permitted_command(taken_over: TakenOver) -> None:
    of = taken_over.loaded
    answer = answer_to(of, request_for(of, now=taken_over.now, released_us=taken_over.us))
    assert isinstance(answer, Decision)
    assert answer.permit, answer
    dispatch = of.executor.dispatch(answer.permit, taken_over.us)
    assert isinstance(dispatch, Command), dispatch
    before = taken_over.state()
    covered = {(400, 1.0, 0.0), (176, 1.0, 4.0)}
    uncovered = [each for each in hostile() if (getattr(each, "command", 0), getattr(each, "param1", 0.0),
                                                getattr(each, "param2", 0.0)) not in covered]  # fmt: skip
    assert taken_over.attack(uncovered) == []
    assert taken_over.state() == before
    mode = long(176, 1, 4, 3) if taken_over.px4 else long(176, 1, 4)
    for message in (mode, long(400, 1)):
        frame = taken_over.seal(message)
        assert isinstance(frame, bytes), frame
        taken_over.put(frame)
    assert taken_over.simulation.truth().armed, "what it covers"


@enforcing
def test_preparation_sets_only_configured_parameters(taken_over: TakenOver) -> None:
    issuer, name = taken_over.loaded.preparation, taken_over.name.encode()
    other = bits_of(77.0)
    assert other is not None
    for write in (ParameterWrite(taken_over.name, 0, other), ParameterWrite("RTL_ALT", 0, taken_over.bits)):
        for restoring in (False, True):
            refused = issuer.permit(encode(Preparation(0, restoring, 0, (write,))), taken_over.us)
            assert isinstance(refused, Refusal), write
    configured = Preparation(0, False, 0, (ParameterWrite(taken_over.name, 0, taken_over.bits),))
    permit = issuer.permit(encode(configured), taken_over.us)
    assert isinstance(permit, bytes), permit
    prepared = taken_over.loaded.executor.prepare(permit, taken_over.us)
    assert isinstance(prepared, Preparation), prepared
    before = taken_over.state()
    assert taken_over.attack(hostile()) == []
    assert taken_over.state() == before
    frame = taken_over.seal(m.MAVLink_param_set_message(1, 1, name, 50.0, 9))
    assert isinstance(frame, bytes), frame
    taken_over.put(frame)
    assert taken_over.simulation._autopilot.parameters.value(taken_over.name) == 50.0


@pytest.mark.parametrize("vehicle", OBEY_ANYONE, ids=named)
def test_vehicle_without_signing_obeys_anyone(vehicle: Vehicle) -> None:
    """The limit, stated: there the runtime needs no boundary."""
    simulation, codec = vehicle.simulated(EPOCH_US + 3_600 * S), Codec(1, 191)
    simulation.advance(3 * S)
    for message in (long(176, 1, 4, 0), long(400, 1)):
        simulation.receive(codec.pack(message), simulation.now_us)
    assert simulation.truth().armed
