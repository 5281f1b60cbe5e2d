"""The state of the vehicle for a first answer, made of the last frames of each message: those of the time between two
ticks at once, and the newest when it is asked for.

The flight decides on its own state, with the age of each measurement at its source. Here a value is as old as its
report, so that it is never taken for older than it is.
"""

from collections import deque
from typing import Final

from rtshcua.adapters.vehicle.telemetry import Telemetry
from rtshcua.codec.frames import Codec
from rtshcua.decision.prepare import PreparedPolicy
from rtshcua.ground.prove.step_starts import MissionStart, StartPlace
from rtshcua.mavlink import dialect
from rtshcua.mavlink.enums import MAV_COMP_ID_AUTOPILOT1 as AUTOPILOT
from rtshcua.mavlink.enums import MAV_LANDED_STATE_ON_GROUND
from rtshcua.mavlink.framing import HEADER, message_id, sender_of
from rtshcua.mavlink.layouts import EXTENDED_SYS_STATE
from rtshcua.model.flat.limits import FULL
from rtshcua.model.flat.situation import Now, State
from rtshcua.onboard.ports import Readings
from rtshcua.onboard.runtime.monitor import StateMonitor

_LANDED: Final = 1  # the offset of `landed_state` in its payload
#: frames of one message that are kept: a battery counts from its second report on, and sensors have several instances
_KEPT: Final = 4


class VehicleFrames:
    """The last frames of the messages that a policy reads, of the vehicle with this system id."""

    def __init__(self, policy: PreparedPolicy, system: int) -> None:
        self.policy = policy.policy
        self._system = system
        self._telemetry = Telemetry(policy.policy)
        self._monitor = StateMonitor(policy)
        self._codec = Codec(0, 0)
        messages = dialect.load().messages
        self._read = frozenset(messages[name].id for name in self._telemetry.rates if name in messages)
        self._last: dict[tuple[int, int], deque[tuple[int, bytes]]] = {}
        #: whether the vehicle is in the air; None if it did not report it
        self.aloft: bool | None = None

    def take(self, frame: bytes, at_us: int) -> None:
        """Keep a frame that arrived at a monotonic time, in us."""
        number, (system, component) = message_id(frame, 0), sender_of(frame)
        if system != self._system:
            return
        if number == EXTENDED_SYS_STATE and component == AUTOPILOT:
            landed = frame[HEADER + _LANDED] if frame[1] > _LANDED else 0
            self.aloft = landed != MAV_LANDED_STATE_ON_GROUND if landed else None
        if number in self._read:
            key = number, component
            if key not in self._last:
                self._last[key] = deque(maxlen=_KEPT)
            self._last[key].append((at_us, frame))

    def start(self, now: Now) -> MissionStart | None:
        """Where a mission would begin now, and the charge; None if the position is not known."""
        state, vehicle = self.state(now), self.policy.vehicle
        x, y, height = (state.values[each] for each in (vehicle.position, vehicle.position + 1, vehicle.height))
        if x is None or y is None or height is None or self.aloft is None:
            return None
        charge = state.values[vehicle.battery]
        place = StartPlace(x, y, height if self.aloft else 0, self.aloft)
        return MissionStart(place, FULL if charge is None else charge)

    def landed_at(self, now: Now) -> tuple[int, int] | None:
        """Where it stands on the ground, in local mm; None if it is in the air or that is not known."""
        start = self.start(now)
        return None if start is None or start.place.aloft else (start.place.x, start.place.y)

    @property
    def needed_us(self) -> dict[int, int]:
        """The shortest interval of each message that the policy's signals need, us by message number."""
        messages = dialect.load().messages
        return {messages[name].id: rate.suffices for name, rate in self._telemetry.rates.items() if name in messages}

    def state(self, now: Now) -> State:
        """The state now. Conditions over time need observations without a gap, so they are unknown here."""
        self.read()
        return self._monitor.state(now.monotonic_us)

    def read(self) -> None:
        """Read the frames that are kept."""
        frames = sorted((each for kept in self._last.values() for each in kept), key=lambda each: each[0])
        for at_us, data in frames:
            for frame in self._codec.parse(data, at_us):
                values = self._telemetry.read(frame.name, frame.message, frame.component, now_us=at_us)
                if values:
                    self._monitor.update(Readings(at_us, values))
        for kept in self._last.values():
            kept.clear()
