"""Threat: an attacker reaches the vehicle's own port, behind the gateway, hears the whole link and sends under the
gateway's address and ids. The link has a key (`--signing-key`), which the attacker does not have.

Outcome: no frame of the attacker moves the vehicle, sets a parameter or changes the key, and the flight through the
gateway goes on. What the vehicle does is judged by its reports, not by acknowledgements. After each attack a request
with the right signature is answered over the same path, so the frames before it did arrive. The last two tests sign
the same commands rightly: then they have their effect.
"""

import math
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from select import select
from typing import Any, Final, NamedTuple

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from hostile.relayed import HERE, udp
from rtshcua.adapters.simulator import Simulator
from rtshcua.codec.frames import Codec, ReceivedFrame
from rtshcua.mavlink.framing import FLAG_SIGNED, SIGNATURE, message_id, octets_of_checksum, with_flags
from rtshcua.mavlink.modes import CopterMode, Px4Mode
from rtshcua.mavlink.signing import EPOCH_US, MINUTE, SignedLink, SigningState, timestamp_in
from virtual.gateway_run import NAN, GatewayRun, ScriptClient, free_port, running, taken_off, verified

pytestmark = [pytest.mark.slow, pytest.mark.long]

KEY: Final = b"the key of the link, 32 octets.."
OTHER_KEY: Final = bytes(range(32))
#: system and component id of a ground station; link ids that the gateway does not use
STATION: Final = (255, 190)
WITNESS_LINK, STRANGE_LINK = 9, 7
ACCEPTED: Final = mavlink.MAV_RESULT_ACCEPTED
#: two places of the flight, and where the attacker wants the vehicle: latitude and longitude in degrees
FIRST, SECOND, ABDUCTED = (47.39792, 8.54560), (47.39780, 8.54590), (47.39745, 8.54500)
HOME_AMSL_M: Final = 488.0
HEIGHT_M: Final = 5.0
#: how long the vehicle is watched after an attack, in s, and how far it may be from where it hovers, in m
WATCH_S, STILL_M = 1.2, 1.0
#: how many frames are sent at once: a socket's buffer holds them
_BLOCK: Final = 120
#: how long something may take that has to happen, in s
_PATIENCE_S: Final = 30.0
_METRES_PER_UNIT: Final = 0.011_132
"""Of latitude, 1e-7 degrees."""

#: messages that move a vehicle or set it up
_ACTS: Final = {
    of.id
    for of in (
        mavlink.MAVLink_command_long_message, mavlink.MAVLink_command_int_message, mavlink.MAVLink_param_set_message,
        mavlink.MAVLink_set_position_target_global_int_message, mavlink.MAVLink_mission_count_message,
        mavlink.MAVLink_mission_item_int_message,
    )
}  # fmt: skip

Message = Any


class Setting(NamedTuple):
    """A parameter, its type, and the value that the attacker writes."""

    name: bytes
    type: int
    value: float


class Target(NamedTuple):
    """What the attacker knows of an autopilot."""

    flavour: str
    modes: type[Px4Mode] | type[CopterMode]
    settings: tuple[Setting, ...]

    def takeoff(self) -> list[Message]:
        """Arm and take off from the ground; on PX4 also climb in the air."""
        amsl = HOME_AMSL_M if self.flavour == "px4" else 0.0
        rise = long(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, NAN, NAN, NAN, amsl + 25)
        arm = long(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
        if self.flavour == "px4":
            return [rise, arm]
        return [self.mode(CopterMode.GUIDED), arm, rise]

    def mode(self, mode: Px4Mode | CopterMode) -> Message:
        return long(mavlink.MAV_CMD_DO_SET_MODE, 1, *mode.parameters)

    def writes(self) -> list[Message]:
        """Change the parameters."""
        return [mavlink.MAVLink_param_set_message(1, 1, name, value, kind) for name, kind, value in self.settings]

    def goto(self) -> Message:
        """Fly away, in the mode of the gateway's flight."""
        place = (round(each * 1e7) for each in ABDUCTED)
        px4 = self.flavour == "px4"
        frame = mavlink.MAV_FRAME_GLOBAL if px4 else mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT
        up = HOME_AMSL_M + HEIGHT_M if px4 else HEIGHT_M
        return mavlink.MAVLink_command_int_message(
            1, 1, frame, mavlink.MAV_CMD_DO_REPOSITION, 0, 0, -1, 1, 0, NAN, *place, up
        )

    def land(self) -> Message:
        return self.mode(self.modes.LAND)

    def disarm(self) -> Message:
        """Stop the motors in the air."""
        return long(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, 21196)

    def commands(self) -> list[Message]:
        """Everything; the last ones leave traces whatever the others did."""
        place = [round(each * 1e7) for each in ABDUCTED]
        return [
            *self.takeoff(), *self.writes(), self.goto(),
            mavlink.MAVLink_set_position_target_global_int_message(
                0, 1, 1, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, 0x0DF8, *place, HEIGHT_M, *[0] * 8),
            self.land(), mavlink.MAVLink_set_mode_message(1, 1, self.modes.LAND), self.disarm(),
        ]  # fmt: skip


def long(number: int, *values: float) -> Message:
    return mavlink.MAVLink_command_long_message(1, 1, number, 0, *values, *[0.0] * (7 - len(values)))


def key_set_to(key: bytes) -> Message:
    """SETUP_SIGNING; a key of zeros turns signing off."""
    return mavlink.MAVLink_setup_signing_message(1, 1, list(key), 0)


PX4 = Target("px4", Px4Mode, (
    Setting(b"MPC_XY_CRUISE", mavlink.MAV_PARAM_TYPE_REAL32, 11.5),
    Setting(b"GF_MAX_VER_DIST", mavlink.MAV_PARAM_TYPE_REAL32, 500.0),
))  # fmt: skip
COPTER = Target("ardupilot", CopterMode, (
    Setting(b"WPNAV_SPEED", mavlink.MAV_PARAM_TYPE_REAL32, 1150.0),
    Setting(b"FENCE_ALT_MAX", mavlink.MAV_PARAM_TYPE_REAL32, 500.0),
))  # fmt: skip
TARGETS = pytest.mark.parametrize("target", [PX4, COPTER], ids=lambda target: target.flavour)


def signed(frame: bytes, timestamp: int, link: int, key: bytes = KEY) -> bytes:
    """The frame, signed with this timestamp."""
    return SignedLink(key, SigningState(timestamp - 1, {}), EPOCH_US, 0, link).sign(frame, 0)


def restamped(frame: bytes, timestamp: int) -> bytes:
    """A signed frame with another timestamp; its signature does not fit any more."""
    return frame[: -SIGNATURE + 1] + timestamp.to_bytes(6, "little") + frame[-6:]


def on_link(frame: bytes, link: int) -> bytes:
    """A signed frame with another link id; its signature does not fit any more."""
    return frame[:-SIGNATURE] + bytes([link]) + frame[-SIGNATURE + 1 :]


def without_signature(frame: bytes) -> bytes:
    return with_flags(frame[:-SIGNATURE], 0)


def pretended(frame: bytes, signature: bytes) -> bytes:
    """An unsigned frame with the signature of another one."""
    return with_flags(frame, FLAG_SIGNED) + signature


class Tap:
    """Forwards datagrams between the vehicle and the gateway, each frame once and in order; the attacker reads all of
    them, and what he sends reaches the vehicle from the gateway's address.
    """

    def __init__(self) -> None:
        self._vehicle, self._gateway = udp(), udp()
        self.gateway_port = free_port()
        self.vehicle_port = 0
        #: what the vehicle was sent by the gateway, and what the vehicle sent
        self.sent: list[bytes] = []
        self.heard: list[ReceivedFrame] = []
        self.lost = 0  # datagrams of the vehicle that are no frame
        self._ended = False
        self._thread = threading.Thread(target=self._forward, daemon=True)

    @property
    def port(self) -> int:
        """Where the vehicle sends to."""
        return int(self._vehicle.getsockname()[1])

    def open(self, vehicle_port: int) -> None:
        self.vehicle_port = vehicle_port
        self._thread.start()

    def close(self) -> None:
        self._ended = True
        self._thread.join()
        self._vehicle.close()
        self._gateway.close()

    def inject(self, frames: Sequence[bytes]) -> None:
        for frame in frames:
            self._vehicle.sendto(frame, (HERE, self.vehicle_port))

    def _forward(self) -> None:
        reader = Codec(*STATION)
        while not self._ended:
            for link in select([self._vehicle, self._gateway], [], [], 0.05)[0]:
                datagram, (_, sender) = link.recvfrom(65_535)
                if link is self._gateway:
                    # noted before it is sent: the vehicle never has a later timestamp than the attacker knows
                    self.sent.append(datagram)
                    self._vehicle.sendto(datagram, (HERE, self.vehicle_port))
                elif sender == self.vehicle_port:
                    frames = reader.parse(datagram)
                    self.lost += not frames
                    self.heard += frames
                    self._gateway.sendto(datagram, (HERE, self.gateway_port))

    # ------------------------------------------------------------------------------------- what the vehicle reports

    def all(self, name: str, since: int = 0) -> list[Message]:
        """The vehicle's messages of a name, from an index of `heard` on."""
        return [each.message for each in self.heard[since:] if each.name == name and each.component == 1]

    def last(self, name: str) -> Message:
        return self.all(name)[-1]

    @property
    def mode(self) -> int:
        return int(self.last("HEARTBEAT").custom_mode)

    @property
    def height_m(self) -> float:
        return float(self.last("GLOBAL_POSITION_INT").relative_alt / 1_000)

    @property
    def latest(self) -> int:
        """The latest timestamp of the link, of both directions."""
        theirs = [each.frame for each in self.heard[-20:] if each.signed]
        return max(timestamp_in(frame) for frame in [*theirs, *self.sent[-20:]])


def is_armed(beat: Message) -> bool:
    return bool(beat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)


def distance_m(one: Message, other: Message) -> float:
    """Between two reports of the position."""
    north, east = one.lat - other.lat, (one.lon - other.lon) * math.cos(math.radians(one.lat / 1e7))
    return math.hypot(north * _METRES_PER_UNIT, east * _METRES_PER_UNIT, (one.alt - other.alt) / 1_000)


class Attacker:
    """Makes the frames of the attacks, and observes the vehicle. The key is for attacks with a right signature and a
    wrong timestamp, and for requests by which the test knows that its frames arrive.
    """

    def __init__(self, tap: Tap, target: Target, wait: Callable[[Callable[[], bool]], None]) -> None:
        self.tap, self.target = tap, target
        self.wait = wait  # until something is so
        self._stamp = 0
        self._key = KEY

    @property
    def gateway_ids(self) -> tuple[int, int]:
        """System and component id of the flight's boundary."""
        return self.tap.sent[-1][5], self.tap.sent[-1][6]

    def frames(self, messages: Sequence[Message]) -> list[bytes]:
        """Unsigned, under the ids of the gateway and of a ground station."""
        return [Codec(*ids).pack(each) for ids in (self.gateway_ids, STATION) for each in messages]

    def rightly(self, *messages: Message) -> list[bytes]:
        """With the key, and timestamps that the vehicle accepts, on a link that the gateway does not use."""
        made = []
        for each in messages:
            self._stamp = max(self._stamp + 1, self.tap.latest)
            made.append(signed(Codec(*STATION).pack(each), self._stamp, WITNESS_LINK, self._key))
        return made

    def signed_with(self, key: bytes) -> None:
        """From now on the vehicle has this key."""
        self._key = key

    def value(self, setting: Setting) -> float:
        """A parameter's value, as the vehicle answers to a request with the right signature."""
        since, again_s = len(self.tap.heard), 0.0
        name, found = setting.name.decode(), list[float]()

        def answered() -> bool:
            nonlocal again_s
            if time.monotonic() > again_s:  # a datagram may be lost
                again_s = time.monotonic() + 2.0
                self.tap.inject(self.rightly(mavlink.MAVLink_param_request_read_message(1, 1, setting.name, -1)))
            found[:] = [each.param_value for each in self.tap.all("PARAM_VALUE", since) if each.param_id == name]
            return bool(found)

        self.wait(answered)
        return found[-1]

    def values(self) -> list[float]:
        return [self.value(each) for each in self.target.settings]

    def attack(self, frames: Sequence[bytes]) -> None:
        """Send the frames; the vehicle has read all of them at the end."""
        for start in range(0, len(frames), _BLOCK):
            self.tap.inject(frames[start : start + _BLOCK])
            self.value(self.target.settings[0])

    # ----------------------------------------------------------------------------------------------------- attacks

    def unsigned(self, messages: Sequence[Message]) -> list[bytes]:
        return self.frames(messages)

    def wrongly_signed(self, messages: Sequence[Message]) -> list[bytes]:
        """With another key; with the signature of another, unused frame; with one octet changed after signing; with
        the signature of a frame of the gateway, as it is and with a fresh timestamp.
        """
        made, fresh = [], self.tap.latest + 1_000
        for number, frame in enumerate(self.frames(messages)):
            stamp = fresh + number
            good = signed(frame, stamp, WITNESS_LINK)
            nothing = Codec(*frame[5:7]).pack(long(mavlink.MAV_CMD_REQUEST_MESSAGE, 148))
            turned = bytearray(good)
            turned[4] ^= 1  # the sequence number: the command is the same
            kind = mavlink.mavlink_map[int.from_bytes(frame[7:10], "little")]
            end = 10 + frame[1]
            turned[end : end + 2] = octets_of_checksum(bytes(turned[1:end]) + bytes([kind.crc_extra]))
            genuine = self.tap.sent[-1][-SIGNATURE:]
            made += [
                *(signed(frame, stamp, link, OTHER_KEY) for link in (0, STRANGE_LINK, WITNESS_LINK)),
                pretended(frame, signed(nothing, stamp, WITNESS_LINK)[-SIGNATURE:]), bytes(turned),
                good[:-1] + bytes([good[-1] ^ 1]), pretended(frame, genuine),
                restamped(pretended(frame, genuine), stamp), pretended(frame, bytes(SIGNATURE)),
            ]  # fmt: skip
        return made

    @property
    def acts(self) -> list[bytes]:
        """The frames of the gateway that act on the vehicle."""
        return [frame for frame in self.tap.sent if message_id(frame, 0) in _ACTS]

    def replayed(self) -> list[bytes]:
        """All frames of the gateway that act again, in their order and backwards; then without their signatures, and
        with a fresh timestamp: the signature does not fit.
        """
        genuine, fresh = self.acts, self.tap.latest + 1_000
        newest = [restamped(frame, fresh + number) for number, frame in enumerate(genuine)]
        return [*genuine, *genuine[::-1], *map(without_signature, genuine), *newest]

    def older(self, messages: Sequence[Message]) -> list[bytes]:
        """With the right key, on the gateway's own link, each with an unused timestamp before its last one."""
        last, link = timestamp_in(self.tap.sent[-1]), self.tap.sent[-1][-SIGNATURE]
        used = {timestamp_in(frame) for frame in self.tap.sent}
        free = (stamp for stamp in range(last - 1, 0, -1) if stamp not in used)
        made = [Codec(*self.gateway_ids).pack(each) for each in messages]
        return [signed(frame, next(free), link) for frame in made]

    def elsewhere(self, messages: Sequence[Message]) -> list[bytes]:
        """The gateway's frames under another link id; and new links of the gateway and of a station, with the right
        key and a timestamp just over a minute old.
        """
        stale = self.tap.latest - MINUTE - 1_000
        overheard = [on_link(frame, link) for frame in self.acts for link in (1, STRANGE_LINK)]
        return [*overheard, *(signed(frame, stale, STRANGE_LINK) for frame in self.frames(messages))]

    def rekeying(self, *, right_key: bool = True) -> list[bytes]:
        """SETUP_SIGNING with another key and with none: unsigned, signed with the other key, with the right one."""
        messages = [key_set_to(OTHER_KEY), key_set_to(bytes(32))]
        frames = self.frames(messages)
        forged = [signed(frame, self.tap.latest + 1_000, STRANGE_LINK, OTHER_KEY) for frame in frames]
        return [*frames, *forged, *(self.rightly(*messages) if right_key else [])]

    def everything(self) -> list[bytes]:
        """All attacks, one after the other."""
        commands = self.target.commands()
        return [
            *self.unsigned(commands), *self.wrongly_signed(commands), *self.replayed(), *self.older(commands),
            *self.elsewhere(commands), *self.rekeying(),
        ]  # fmt: skip


def signed_rightly(frames: Sequence[bytes]) -> bool:
    """Whether each frame has a signature of the key."""
    return all(SignedLink(KEY, SigningState(0, {}), EPOCH_US, 0).accept(frame, 0) for frame in frames)


@contextmanager
def flying(folder: Path, target: Target) -> Iterator[tuple[GatewayRun, ScriptClient, Attacker]]:
    """A vehicle with a key, a gateway with the same, and the attacker between them."""
    key = folder / "link.key"
    key.write_bytes(KEY)
    key.chmod(0o600)
    tap = Tap()
    options = ("--port", str(tap.port), "--flavour", target.flavour, "--signing-key", str(key))
    with Simulator(options) as vehicle:
        tap.open(vehicle.ready["local"])
        try:
            words = ("--connect", f"udpin:{HERE}:{tap.gateway_port}", "--signing-key", str(key), "--utc-error", "500ms")
            with running(folder, *words, "--sessions", "1") as (run, client):

                def wait(wanted: Callable[[], bool]) -> None:
                    end_s = time.monotonic() + _PATIENCE_S
                    while not wanted():
                        assert time.monotonic() < end_s, client.texts
                        with suppress(AssertionError):  # nothing comes once the gateway has ended
                            client.until(lambda _: True, 0.05)

                client.meet()
                run.wait_for("ready")
                wait(lambda: bool(tap.sent))
                yield run, client, Attacker(tap, target, wait)
        finally:
            tap.close()


def undisturbed(client: ScriptClient, attacker: Attacker, attack: Callable[[], Sequence[bytes]]) -> None:
    """Attack; the vehicle stays where it is, in its mode, with its motors on or off and its parameters."""
    tap = attacker.tap
    values, mode, place = attacker.values(), tap.mode, tap.last("GLOBAL_POSITION_INT")
    armed, since = is_armed(tap.last("HEARTBEAT")), len(tap.heard)
    frames = attack()
    assert len(frames) > 5
    attacker.attack(frames)
    assert attacker.values() == values
    client.until_s(WATCH_S)
    beats, places = tap.all("HEARTBEAT", since), tap.all("GLOBAL_POSITION_INT", since)
    assert beats
    assert len(places) >= 5
    assert {(each.custom_mode, is_armed(each)) for each in beats} == {(mode, armed)}
    assert max(distance_m(place, each) for each in places) < STILL_M
    assert signed_rightly([each.frame for each in tap.heard[since:] if each.component == 1])


@TARGETS
def test_attacker_without_the_key_has_no_effect(tmp_path: Path, target: Target) -> None:
    with flying(tmp_path, target) as (run, client, attacker):
        tap, commands = attacker.tap, target.commands()
        # on the ground: it does not arm and take off
        takeoff = target.takeoff()
        undisturbed(client, attacker, lambda: [
            *attacker.unsigned(takeoff), *attacker.wrongly_signed(takeoff), *attacker.older(takeoff),
            *attacker.elsewhere(takeoff), *attacker.rekeying(right_key=False),
        ])  # fmt: skip

        taken_off(client, HEIGHT_M)
        for place in (FIRST, SECOND):
            assert client.goto(*place, HEIGHT_M) == ACCEPTED, client.texts
            client.until_at(*place)
        client.until_s(3.0)  # it hovers

        undisturbed(client, attacker, lambda: attacker.unsigned(commands))
        undisturbed(client, attacker, lambda: attacker.wrongly_signed(commands))
        undisturbed(client, attacker, attacker.replayed)
        undisturbed(client, attacker, lambda: attacker.older(commands))
        undisturbed(client, attacker, lambda: attacker.elsewhere(commands))
        undisturbed(client, attacker, attacker.rekeying)
        undisturbed(client, attacker, lambda: attacker.unsigned(commands))  # the key is still demanded

        # on the way, and during the landing
        values, since = attacker.values(), len(tap.heard)
        assert client.goto(*FIRST, HEIGHT_M) == ACCEPTED
        client.until_s(0.5)
        attacker.attack(attacker.everything())
        client.until_at(*FIRST)
        assert all(is_armed(each) for each in tap.all("HEARTBEAT", since))
        assert min(each.relative_alt for each in tap.all("GLOBAL_POSITION_INT", since)) > (HEIGHT_M - 2) * 1_000
        assert client.command(mavlink.MAV_CMD_NAV_LAND) == ACCEPTED
        attacker.wait(lambda: tap.height_m < HEIGHT_M - 2)
        above = tap.last("GLOBAL_POSITION_INT")
        attacker.attack(attacker.everything())
        attacker.wait(lambda: not is_armed(tap.last("HEARTBEAT")))
        below = tap.last("GLOBAL_POSITION_INT")
        assert below.relative_alt < 500
        below.alt = above.alt
        assert distance_m(above, below) < STILL_M
        assert attacker.values() == values
        assert run.wait() == 0
        assert [each["ending"] for each in run.all("session")] == ["completed"]
        told = run.wait_for("session")

    assert tap.lost == 0
    assert signed_rightly(tap.sent), "all that the gateway sends is signed"
    audit = verified(run, ["--audit", told["log"]], tmp_path)
    assert audit.returncode == 0, audit.stdout + audit.stderr


@pytest.mark.parametrize(
    "target", [PX4, pytest.param(COPTER, marks=pytest.mark.soak)], ids=lambda target: target.flavour
)
def test_same_commands_with_the_key_have_their_effect(tmp_path: Path, target: Target) -> None:
    """During a flight through the gateway, over the same path, once signed rightly with a fresh timestamp."""
    with flying(tmp_path, target) as (_, client, attacker):
        tap = attacker.tap
        taken_off(client, HEIGHT_M)
        client.until_s(2.0)
        before = attacker.values()
        assert all(now != each.value for now, each in zip(before, target.settings, strict=True))
        tap.inject(attacker.rightly(*target.writes()))
        assert attacker.values() == [each.value for each in target.settings]
        tap.inject(attacker.rightly(key_set_to(OTHER_KEY)))
        attacker.values()  # refused: it still answers to the first key, because it is armed

        place = tap.last("GLOBAL_POSITION_INT")
        tap.inject(attacker.rightly(target.goto()))
        attacker.wait(lambda: distance_m(place, tap.last("GLOBAL_POSITION_INT")) > 10 * STILL_M)
        assert tap.mode != target.modes.LAND
        tap.inject(attacker.rightly(target.land()))
        attacker.wait(lambda: tap.mode == target.modes.LAND)
        flew = tap.last("GLOBAL_POSITION_INT")
        assert flew.relative_alt > 3_000
        tap.inject(attacker.rightly(target.disarm()))
        attacker.wait(lambda: not is_armed(tap.last("HEARTBEAT")))
        assert tap.last("GLOBAL_POSITION_INT").time_boot_ms - flew.time_boot_ms < 3_000, "it did not land first"


@TARGETS
def test_on_the_ground_the_key_sets_another_key_and_takes_off(tmp_path: Path, target: Target) -> None:
    key = tmp_path / "link.key"
    key.write_bytes(KEY)
    tap = Tap()

    def wait(wanted: Callable[[], bool]) -> None:
        end_s = time.monotonic() + _PATIENCE_S
        while not wanted():
            assert time.monotonic() < end_s
            time.sleep(0.02)

    options = ("--port", str(tap.port), "--flavour", target.flavour, "--signing-key", str(key), "--speed", "4")
    with Simulator(options) as vehicle:
        tap.open(vehicle.ready["local"])
        try:
            attacker = Attacker(tap, target, wait)
            wait(lambda: bool(tap.all("HEARTBEAT")))
            tap.inject(attacker.rightly(key_set_to(OTHER_KEY)))
            attacker.signed_with(OTHER_KEY)
            attacker.values()
            interval = long(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 33, 100_000)
            tap.inject(attacker.rightly(interval))
            wait(lambda: len(tap.all("GLOBAL_POSITION_INT")) > 30)  # it is ready
            tap.inject(attacker.rightly(*target.takeoff()))
            wait(lambda: tap.height_m > 2)
            assert is_armed(tap.last("HEARTBEAT"))
        finally:
            tap.close()
