"""Setting a link key on the simulated vehicle, in explicit time: frames, refusals and effects."""

from collections.abc import Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.adapters.link_setup import LinkSetup, SetUp, after_setup, carry_out
from rtshcua.codec.frames import Codec
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.simulation.config import Answers, AutopilotKind, SimulationConfig
from rtshcua.simulation.world import Simulation

KEY = b"shared/traces test key, 32 bytes"
OTHER = bytes(range(32))
UTC_US = 1_767_225_600_000_000
TICK_US = 20_000
MOST_US = 40_000_000


class Bench:
    """A vehicle on the bench, and a set-up connected to it. `lose` drops frames to the vehicle."""

    def __init__(self, flavour: str, **config: Any) -> None:
        self.simulation = Simulation(
            SimulationConfig(flavour=AutopilotKind(flavour), utc_us=UTC_US, answers=Answers.RECORDED, **config)
        )
        self.sent: list[bytes] = []
        self.advance(1_500_000)

    def advance(self, us: int) -> list[bytes]:
        return self.simulation.advance(self.simulation.now_us + us)

    def say(self, message: Any) -> None:
        self.simulation.receive(Codec(255, 190).pack(message), self.simulation.now_us)

    def set_up(
        self, key: bytes = KEY, system: int | None = None, lose: Callable[[bytes], bool] = lambda _: False
    ) -> Any:
        begun_us = self.simulation.now_us
        setup = LinkSetup(key, UTC_US + begun_us, begun_us, system)
        while setup.result is None:
            now_us = self.simulation.now_us
            assert now_us < begun_us + MOST_US
            for frame in setup.tick(now_us):
                self.sent.append(frame)
                if not lose(frame):
                    for answer in self.simulation.receive(frame, now_us):
                        setup.receive(answer, now_us)
            for datagram in self.advance(TICK_US):
                setup.receive(datagram, self.simulation.now_us)
        return setup.result

    @property
    def keys_sent(self) -> int:
        return sum(KEY in frame for frame in self.sent)


BOTH = pytest.mark.parametrize(("flavour", "config"), [("ardupilot", {}), ("px4", {"release": (1, 18)})])


@BOTH
def test_the_key_holds_and_that_was_seen(flavour: str, config: dict[str, Any]) -> None:
    bench = Bench(flavour, **config)
    seen = bench.set_up()
    assert isinstance(seen, SetUp)
    assert (seen.already, seen.signs, seen.answers_signed, seen.answers_unsigned) == (False, True, True, False)
    assert seen.insists
    assert bench.keys_sent == 1
    assert seen.release == {"px4": (1, 18, 0), "ardupilot": (4, 7, 0)}[flavour]
    names = {frame.name for sent in bench.sent for frame in Codec(0, 0).parse(sent)}
    assert names == {"COMMAND_LONG", "SETUP_SIGNING"}, "nothing that moves it, and nothing that sets anything else"
    again = bench.set_up()
    assert isinstance(again, SetUp)
    assert (again.already, again.insists, bench.keys_sent) == (True, True, 1)
    other = bench.set_up(OTHER)
    assert isinstance(other, Refusal)
    assert other.slug == "other-key"


@pytest.mark.parametrize(
    ("flavour", "config", "signs", "unsigned"),
    [
        ("ardupilot", {"usb": True}, True, True),
        ("px4", {"release": (1, 16)}, False, True),
        ("px4", {"release": (1, 17)}, False, True),
        ("px4", {"release": (1, 17), "usb": True}, True, True),
        ("px4", {"release": (1, 17), "usb": True, "parameters": (("MAV_SIGN_CFG", 2.0),)}, True, False),
    ],
)
def test_link_setup_detects_key_without_full_effect(
    flavour: str, config: dict[str, Any], signs: bool, unsigned: bool
) -> None:
    seen = Bench(flavour, **config).set_up()
    assert isinstance(seen, SetUp)
    assert (seen.signs, seen.answers_signed, seen.answers_unsigned) == (signs, True, unsigned)
    assert seen.insists is (signs and not unsigned)


@BOTH
def test_an_armed_vehicle_gets_no_key(flavour: str, config: dict[str, Any]) -> None:
    bench = Bench(flavour, **config)
    if flavour == "ardupilot":
        bench.say(mavlink.MAVLink_command_long_message(1, 1, 176, 0, 1, 4, 0, 0, 0, 0, 0))
    bench.say(mavlink.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0))
    bench.advance(1_000_000)
    refusal = bench.set_up()
    assert isinstance(refusal, Refusal)
    assert (refusal.slug, bench.keys_sent) == ("armed", 0)


def told_wrongly(setup: LinkSetup, state: int | None, autopilot: Codec) -> Refusal:
    """The result of a set-up for a disarmed vehicle that reports this landed state, or none."""
    for tick in range(MOST_US // TICK_US):
        now_us = tick * TICK_US
        if tick % 50 == 0:
            setup.receive(autopilot.pack(mavlink.MAVLink_heartbeat_message(2, 12, 81, 0, 3, 3)), now_us)
            if state is not None:
                setup.receive(autopilot.pack(mavlink.MAVLink_extended_sys_state_message(0, state)), now_us)
        sent = setup.tick(now_us)
        assert not any(KEY in frame for frame in sent)
        if sent:
            setup.receive(autopilot.pack(mavlink.MAVLink_command_ack_message(512, 0)), now_us)
        if setup.result is not None:
            break
    assert isinstance(setup.result, Refusal)
    return setup.result


def test_vehicle_not_known_on_ground_gets_no_key() -> None:
    assert told_wrongly(LinkSetup(KEY, UTC_US, 0), 2, Codec(1, 1)).slug == "not-landed"
    assert told_wrongly(LinkSetup(KEY, UTC_US, 0), None, Codec(1, 1)).slug == "not-landed"


def test_several_vehicles_silence_and_deafness_are_refused() -> None:
    assert LinkSetup(KEY, UTC_US, 0).tick(0) == []
    nobody = LinkSetup(KEY, UTC_US, 0, begins=True)
    assert [frame.name for sent in nobody.tick(0) for frame in Codec(0, 0).parse(sent)] == ["HEARTBEAT"]
    nobody.tick(11_000_000)
    assert isinstance(nobody.result, Refusal)
    assert nobody.result.slug == "no-vehicle"

    for system, slug in ((None, "two-vehicles"), (2, "no-answer")):
        setup = LinkSetup(KEY, UTC_US, 0, system)
        for tick in range(0, MOST_US, TICK_US):
            for each in (1, 2) if tick % 1_000_000 == 0 else ():
                setup.receive(Codec(each, 1).pack(mavlink.MAVLink_heartbeat_message(2, 12, 81, 0, 3, 3)), tick)
            setup.tick(tick)
            if setup.result is not None:
                break
        assert isinstance(setup.result, Refusal)
        assert setup.result.slug == slug


class TwoSenders:
    """A transport with frames of a vehicle, and then of another sender; `sent` lists the recipients."""

    begins = False

    def __init__(self, other: int) -> None:
        self.waiting = [(1, 1), (2, other)]
        self.sent: list[object] = []

    def readable(self) -> list[int]:
        return []

    def receive(self) -> tuple[bytes, int] | None:
        if not self.waiting:
            return None
        sender, system = self.waiting.pop(0)
        return Codec(system, 1).pack(mavlink.MAVLink_heartbeat_message(2, 12, 81, 0, 3, 3)), sender

    def send(self, frame: bytes, to: object) -> None:
        self.sent.append(to)

    def tend(self, _now_us: int) -> list[str]:
        return []


@pytest.mark.parametrize(
    ("other", "wanted", "slug"), [(2, None, "two-vehicles"), (1, 1, "two-vehicles"), (2, 1, "no-answer")]
)
def test_another_sender_is_noticed_and_gets_nothing(other: int, wanted: int | None, slug: str) -> None:
    transport, times = TwoSenders(other), iter(range(0, 10**9, 200_000))
    result = carry_out(LinkSetup(KEY, UTC_US, 0, wanted), transport, lambda: next(times))  # type: ignore[arg-type]
    assert isinstance(result, Refusal)
    assert result.slug == slug
    assert set(transport.sent) <= {1}


@BOTH
def test_lost_key_is_resent_and_lost_link_proves_nothing(flavour: str, config: dict[str, Any]) -> None:
    bench = Bench(flavour, **config)
    seen = bench.set_up(lose=lambda frame: KEY in frame and bench.keys_sent < 3)
    assert isinstance(seen, SetUp)
    assert (seen.insists, bench.keys_sent) == (True, 3)
    bench = Bench(flavour, **config)
    lost = bench.set_up(lose=lambda _: bench.keys_sent > 0)
    assert isinstance(lost, Refusal), "nothing is answered, and that is not taken for an unsigned request refused"
    assert lost.slug == "no-answer"


@pytest.mark.parametrize(
    ("autopilot", "release", "says"),
    [
        ("ardupilot", (4, 5, 7), "first port (SERIAL0, usually USB)"),
        ("ardupilot", (4, 7, 0), "MAVn_OPTIONS"),
        ("px4", (1, 16, 0), "does not know SETUP_SIGNING"),
        ("px4", (1, 17, 0), "MAV_SIGN_CFG"),
        ("px4", (1, 18, 0), "USB included"),
        ("px4", None, "does not report its release"),
    ],
)
def test_link_setup_describes_signing_of_each_release(
    autopilot: str, release: tuple[int, int, int] | None, says: str
) -> None:
    assert says in after_setup(autopilot, release)
