"""A recorded flight, replayed through the driver and the state monitor."""

import lzma
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from math import cos, inf, radians
from pathlib import Path

from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.adapters.vehicle.driver import Driver
from rtshcua.codec.frames import Codec, ReceivedFrame
from rtshcua.decision.prepare import prepare
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.mavlink import tlog
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.situation import State
from rtshcua.model.flat.zone import SHIFT, Projection
from rtshcua.onboard.enforcement.frames import OURS, FrameSession
from rtshcua.onboard.ports import Command, Event, Readings
from rtshcua.onboard.runtime.monitor import StateMonitor
from rtshcua.wire import bundle as bundles
from rtshcua.wire import cose, names
from virtual.shipped import equipped, shipped

TRACES = Path(__file__).resolve().parents[1] / "traces"
SECOND = 1_000_000
TICK_US = 50_000
#: messages requested by REQUEST_MESSAGE
ASKED = {
    "HEARTBEAT": mavlink.MAVLINK_MSG_ID_HEARTBEAT,
    "POSITION_TARGET_GLOBAL_INT": mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT,
}
#: after such a silence the autopilot does not answer either
SILENT_US = 300_000
#: monotonic time of the autopilot's start
START_US = 5_000_000


@cache
def shipped_policy() -> Policy:
    """Return the policy of the shipped missions, with all signals that they need."""
    policy, _ = (cose.unverified(envelope).payload for envelope in bundles.envelopes(equipped("one_bridge")))
    return bundles.parse(names.POLICY, policy, Policy)


@cache
def stock() -> tuple[Policy, Mission]:
    """The policy of the shipped missions for a stock copter, and a mission."""
    policy, mission = (cose.unverified(envelope).payload for envelope in bundles.envelopes(shipped("short")))
    return bundles.parse(names.POLICY, policy, Policy), bundles.parse(names.MISSION, mission, Mission)


def at_home(latitude: int, longitude: int) -> Policy:
    """Return that policy for another home (1e-7 degree)."""
    north = round(11.1319491 * (1 << SHIFT))
    east = round(11.1319491 * cos(radians(latitude / 1e7)) * (1 << SHIFT))
    return replace(shipped_policy(), projection=Projection(latitude, longitude, east, north))


@dataclass
class Recorded:
    """One flight. `late_us` is the time of the first frame, in us after the autopilot's start (second 0 of the page).

    The recording holds only frames of the vehicle, sent to another client, so it has no answers to the driver's
    requests: `parameters` and the last mode are answered instead, and the fence is not uploaded. TIMESYNC is answered
    after `round_trip_us`, by the time since boot of the recorded time stamps. `commands` begin at their seconds, as if
    the recorded client's commands were the runtime's; with `acknowledges` every command is acknowledged. Frames after
    `until_s` are dropped.
    """

    name: str
    late_us: int
    policy: Policy
    parameters: dict[str, float]
    commands: Sequence[tuple[float, Command]] = ()
    acknowledges: bool = False
    until_s: float = inf
    events: list[tuple[float, Event]] = field(default_factory=list)
    states: list[dict[str, int | None]] = field(default_factory=list)
    monitored: list[State] = field(default_factory=list)  # the same in the decision's form
    sent: list[tuple[float, ReceivedFrame]] = field(default_factory=list)
    round_trip_us: int = 20_000

    def __post_init__(self) -> None:
        prepared = prepare(self.policy)
        assert not isinstance(prepared, Refusal)
        self._monitor = StateMonitor(prepared)
        self._frames = FrameSession()
        self.driver = Driver(self.policy, self._frames, fence=False)
        self._reader, self._teller = Codec(0, 0), Codec(1, 1)
        self._told: dict[int, bytes] = {}  # the last report of mode and target
        self._told_us: dict[str, int] = {}  # its time
        self._alive_us = START_US  # when the autopilot itself was last heard
        self._now_us = START_US
        self._boots: deque[int] = deque(maxlen=20)  # boot time minus own time, by the last time stamps
        self._clock_answers: deque[tuple[int, int]] = deque()  # when, and `ts1`
        self.states.append(self._state())
        waiting = list(self.commands)
        for entry in self._entries():
            if entry.at_us > START_US + self.until_s * SECOND:
                break
            while self._now_us < entry.at_us:
                next_us = min(entry.at_us, self._now_us + TICK_US)
                self._pass(next_us, waiting)
            if entry.frame[6] == 1:
                if self._now_us - self._alive_us > SILENT_US:
                    self._boots.clear()  # its clock may have stopped meanwhile
                self._alive_us = self._now_us
            self._receive(entry.frame)

    @property
    def second(self) -> float:
        return (self._now_us - START_US) / SECOND

    def of(self, *kinds: type[Event]) -> list[tuple[float, Event]]:
        """Return the events of these kinds, with their times."""
        return [(at, event) for at, event in self.events if isinstance(event, kinds)]

    def first(self, kind: type[Event]) -> float:
        """Return the time of the first event of a kind."""
        return self.of(kind)[0][0]

    def known(self, signal: str) -> list[tuple[int, int]]:
        """Return the intervals of seconds in which a signal was known and not stale."""
        stretches: list[tuple[int, int]] = []
        for second, state in enumerate(self.states):
            if state[signal] is None:
                continue
            if stretches and stretches[-1][1] == second - 1:
                stretches[-1] = (stretches[-1][0], second)
            else:
                stretches.append((second, second))
        return stretches

    def _entries(self) -> Iterator[tlog.TlogEntry]:
        data = lzma.decompress((TRACES / f"{self.name}.tlog.xz").read_bytes())
        first_us: int | None = None
        for entry in tlog.read(data):
            first_us = entry.at_us if first_us is None else first_us
            yield tlog.TlogEntry(START_US + self.late_us + entry.at_us - first_us, entry.frame)

    def _pass(self, to_us: int, waiting: list[tuple[float, Command]]) -> None:
        before_us, self._now_us = self._now_us, to_us
        while self._clock_answers and self._clock_answers[0][0] <= to_us:
            self._answer_clock(*self._clock_answers.popleft())
        events, frames = self.driver.tick(to_us)
        self._take(events)
        self._sent(frames)
        while waiting and waiting[0][0] <= self.second:
            begun = waiting.pop(0)[1]
            self._frames.open(replace(begun, not_after_us=to_us + SECOND))
            events, frames = self.driver.begin(begun, to_us)
            self._take(events)
            self._sent(frames)
        if (before_us - START_US) // SECOND < (to_us - START_US) // SECOND:
            self.states.append(self._state())

    def _state(self) -> dict[str, int | None]:
        state = self._monitor.state(self._now_us)
        self.monitored.append(state)
        return {
            signal.name: state.values[signal.slot] if state.ages[signal.slot] <= signal.stale_us else None
            for signal in self.policy.signals
        }

    def _take(self, events: Sequence[Event]) -> None:
        for event in events:
            self.events.append((round(self.second, 2), event))
            if isinstance(event, Readings):
                self._monitor.update(event)

    def _receive(self, frame: bytes, *, again: bool = False) -> None:
        for received in self._reader.parse(frame):
            if received.name in ASKED and received.component == 1:
                self._told[ASKED[received.name]] = frame
                self._told_us[received.name] = self._told_us.get(received.name, 0) if again else self._now_us
        heard = self.driver.receive(frame, self._now_us)
        self._boots += [boot_us - self._now_us for boot_us in map(_boot_us, heard.frames) if boot_us]
        self._take(heard.events)
        self._sent(heard.answers)

    def _sent(self, frames: Sequence[bytes]) -> None:
        for frame in frames:
            (received,) = self._reader.parse(frame)
            self.sent.append((round(self.second, 2), received))
            if received.name == "COMMAND_LONG" and received.message.command == mavlink.MAV_CMD_REQUEST_MESSAGE:
                self._tell(int(received.message.param1))
            elif received.name.startswith("COMMAND_") and self.acknowledges:
                self._acknowledge(received.message.command)
            elif received.name == "TIMESYNC" and self._boots:
                self._clock_answers.append((self._now_us + self.round_trip_us, received.message.ts1))
            elif received.name == "PARAM_REQUEST_READ" and received.message.param_id in self.parameters:
                self._answer(received.message.param_id)

    def _acknowledge(self, number: int) -> None:
        if self._now_us - self._alive_us > SILENT_US:
            return
        self._receive(self._teller.pack(mavlink.MAVLink_command_ack_message(number, 0, 0, 0, 1, OURS)))

    def _tell(self, number: int) -> None:
        """Answer like both autopilots: an acknowledgement, and the last report; a target only while it is streamed."""
        self._acknowledge(mavlink.MAV_CMD_REQUEST_MESSAGE)
        streamed = self._now_us - self._told_us.get("POSITION_TARGET_GLOBAL_INT", 0) <= SILENT_US
        if number == ASKED["POSITION_TARGET_GLOBAL_INT"] and not streamed:
            return
        if number in self._told and self._now_us - self._alive_us <= SILENT_US:
            self._receive(self._told[number], again=True)

    def _answer_clock(self, at_us: int, ts1_ns: int) -> None:
        if self._now_us - self._alive_us > SILENT_US:
            return
        boot_us = at_us - self.round_trip_us // 2 + max(self._boots)
        answer = mavlink.MAVLink_timesync_message(boot_us * 1_000, ts1_ns)
        self._take(self.driver.receive(Codec(1, 1).pack(answer), self._now_us).events)

    def _answer(self, name: str) -> None:
        value = mavlink.MAVLink_param_value_message(name.encode(), self.parameters[name], 9, 1, 0)
        self._take(self.driver.receive(Codec(1, 1).pack(value), self._now_us).events)


def _boot_us(frame: ReceivedFrame) -> int:
    """Return the time of measurement of messages that are sent at once; 0 for others."""
    match frame.name:
        case "GLOBAL_POSITION_INT":
            return int(frame.message.time_boot_ms) * 1_000
        case "GPS_RAW_INT" | "ESTIMATOR_STATUS":
            return int(frame.message.time_usec)
    return 0


def command(token: int, kind: MotionKind, *geo: int, altitude: int = 0, speed: int = 0) -> Command:
    """Return a command with a place in 1e-7 degree."""
    return Command(token, kind.name.lower(), kind, (0,) * len(geo), geo, altitude, speed)
