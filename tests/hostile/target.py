"""The target of attacks: a driver with a known autopilot on the ground, with or without a key."""

from collections import deque
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.adapters.vehicle.driver import Driver
from rtshcua.codec.frames import Codec
from rtshcua.mavlink.signing import SignedLink, SigningState
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.enforcement.frames import FrameSession
from rtshcua.onboard.ports import Command, Event
from virtual.policy import POLICY

KEY = bytes(range(1, 33))
UTC_US = 1_767_225_600_000_000
AUTOPILOT = {"px4": 12, "ardupilot": 3}
NEW = SigningState(0, {})
PLAIN = (int, float, str, bytes, type(None))
COUNTED = ("counts", "_counts", "damaged", "refused", "unknown", "foreign", "_policy")
#: that another vehicle is heard, before a flight, is for people to know, and believed of nobody: `VehicleLink.crowd`
TOLD = ("crowd",)


class Target:
    """`heard` has the vehicle's frames so far; `known` is the state that the driver has from frames."""

    def __init__(self, flavour: str, *, keyed: bool, stored: SigningState = NEW, greet: bool = True) -> None:
        self.link = SignedLink(KEY, stored, UTC_US, 0)
        self.frames = FrameSession()
        if keyed:
            self.frames.sign_with(self.link)
        self.driver = Driver(POLICY, self.frames, verifier=self.link if keyed else None)
        self.heard: list[bytes] = []
        self.sent: list[bytes] = []
        self.events: list[Event] = []
        self.now_us = 0
        self._keyed = keyed
        self._codec = Codec(1, 1)
        self._autopilot = SignedLink(KEY, NEW, UTC_US, 0, link=1)
        if greet:
            for message in greeting(flavour):
                self.receive(self.says(message))
            self._synchronise(self.driver.tick(0)[1])
            self.sent.clear()
            self.events.clear()

    def _synchronise(self, frames: list[bytes]) -> None:
        """Answer TIMESYNC, so that reports have an age; the vehicle has been up for a second."""
        for frame in frames:
            for each in self._codec.parse(frame):
                if each.name == "TIMESYNC":
                    self.receive(self.says(mavlink.MAVLink_timesync_message(1_000_000_000, each.message.ts1)))

    def says(self, message: Any, ahead_us: int = 0) -> bytes:
        """A frame of the vehicle's own."""
        frame = self._codec.pack(message)
        frame = self._autopilot.sign(frame, self.now_us + ahead_us) if self._keyed else frame
        self.heard.append(frame)
        return frame

    def receive(self, datagram: bytes) -> None:
        """Receive a datagram."""
        heard = self.driver.receive(datagram, self.now_us)
        self.sent += heard.answers
        self.events += heard.events

    def known(self) -> object:
        """The complete state of driver, boundary and link, except for counters."""
        return remembered(self.driver)

    def moved(self) -> list[bytes]:
        """The motion frames that would be sent."""
        commands = [Command(1, "skill", kind, (0, 0), (1, 1), 5_000, 1_000) for kind in MotionKind]
        frames = [frame for command in commands for frame in self.driver.begin(command, self.now_us)[1]]
        return [frame for frame in frames if not _asks(frame)]


def _asks(frame: bytes) -> bool:
    """Whether the frame only requests a message."""
    message = Codec(9, 9).parse(frame)[0].message
    return getattr(message, "command", None) == mavlink.MAV_CMD_REQUEST_MESSAGE


def remembered(thing: object) -> object:
    """The state of an object and all its parts, as a value."""
    if isinstance(thing, dict):
        return {repr(key): remembered(value) for key, value in thing.items()}
    if isinstance(thing, list | tuple | set | frozenset | deque):
        return [type(thing).__name__, *map(remembered, sorted(thing, key=repr) if isinstance(thing, set) else thing)]
    if not type(thing).__module__.startswith("rtshcua"):
        return repr(thing) if isinstance(thing, PLAIN) else type(thing).__name__
    names = [*vars(thing)] if hasattr(thing, "__dict__") else []
    names += [name for kind in type(thing).__mro__ for name in getattr(kind, "__slots__", ())]
    kept = [name for name in names if name not in (*COUNTED, *TOLD) and hasattr(thing, name)]
    return {name: remembered(getattr(thing, name)) for name in kept}


def greeting(flavour: str) -> list[Any]:
    """A vehicle on the ground."""
    return [
        mavlink.MAVLink_heartbeat_message(2, AUTOPILOT[flavour], 81, 0, 3, 3),
        mavlink.MAVLink_extended_sys_state_message(0, 1),
        mavlink.MAVLink_estimator_status_message(0, 831, 0, 0, 0, 0, 0, 0, 0, 0),
        mavlink.MAVLink_ekf_status_report_message(831, 0, 0, 0, 0, 0),
        mavlink.MAVLink_global_position_int_message(1, 473_977_400, 85_455_900, 488_000, 100, 0, 0, 0, 0),
        mavlink.MAVLink_gps_raw_int_message(1, 3, 473_977_400, 85_455_900, 488_000, 100, 100, 0, 0, 12),
        mavlink.MAVLink_battery_status_message(0, 0, 0, 2_000, [12_000] * 10, 100, 0, 0, 90),
    ]
