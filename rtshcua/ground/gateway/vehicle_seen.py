"""What was seen of the vehicle: its last frame of each message, and what the gateway reads from them."""

from typing import Final

from rtshcua.ground.gateway.client_frames import Received, received
from rtshcua.mavlink import enums, layouts
from rtshcua.mavlink.framing import HEADER, message_id, sender_of, unsigned
from rtshcua.mavlink.layouts import LAYOUTS

#: the most kinds of messages that are kept; the dialect has about 250
_MOST_KINDS: Final = 512
_MOST_PARAMETERS: Final = 4_096
#: how old a position may be that stands for "here", us
FRESH_US: Final = 2_000_000
#: messages that stay true, however old they are, until the vehicle starts again
LASTING: Final = frozenset({layouts.AUTOPILOT_VERSION, layouts.HOME_POSITION})
#: by how much the time since the vehicle's start goes back only at another start, ms
_RESTART_MS: Final = 2_000


class VehicleSeen:
    """The last frames of the autopilot, raw, with their times, and its parameters."""

    def __init__(self, system: int) -> None:
        self._system = system
        self._frames: dict[int, tuple[bytes, int]] = {}
        self._boot_ms: dict[int, int] = {}  # the time since its start in the last message of each kind
        self._read: dict[int, tuple[bytes, Received | None]] = {}
        #: the last PARAM_VALUE of each parameter, by name
        self.parameters: dict[str, Received] = {}

    def take(self, frame: bytes, now_us: int) -> int:
        """Keep a frame of the autopilot; return its message number, -1 if it is from elsewhere."""
        if len(frame) < HEADER or sender_of(frame) != (self._system, enums.MAV_COMP_ID_AUTOPILOT1):
            return -1
        number = message_id(frame, 0)
        if number in self._frames or len(self._frames) < _MOST_KINDS:
            self._frames[number] = frame, now_us
        if number == layouts.PARAM_VALUE:
            self._learn(received(frame))
        return number

    def restarted(self, number: int) -> bool:
        """Whether the time since its start went back in this message, which has come: then what was taken as lasting
        is forgotten, because its settings may be others now.
        """
        before = self._boot_ms.get(number, 0)
        now_ms = self._boot_ms[number] = self._since_start(number, before)
        if now_ms >= before - _RESTART_MS:
            return False
        self._boot_ms, self.parameters = {number: now_ms}, {}
        for each in LASTING:
            self._frames.pop(each, None)
        return True

    def _since_start(self, number: int, before_ms: int) -> int:
        """The time since its start in the last frame of a message, ms; as before for a damaged frame. Its checksum is
        verified only where the time is not near the one before: these frames come often.
        """
        frame, of = self._frames.get(number, (b"", 0))[0], LAYOUTS[number]
        if frame and frame[1] <= of.fields.size:
            now_ms = int(of.read(frame)[of.at("time_boot_ms")])
            if abs(now_ms - before_ms) <= _RESTART_MS:
                return now_ms
        message = self.message(number)
        return before_ms if message is None else int(message.fields["time_boot_ms"])

    def frame(self, number: int) -> bytes | None:
        """The last frame of a message, without its signature; None if none came."""
        found = self._frames.get(number)
        return None if found is None else unsigned(found[0])

    def message(self, number: int, within_us: int | None = None, now_us: int = 0) -> Received | None:
        """The fields of the last frame of a message; None if none came, or none within this time before now."""
        found = self._frames.get(number)
        if found is None or (within_us is not None and now_us - found[1] > within_us):
            return None
        kept = self._read.get(number)
        if kept is None or kept[0] is not found[0]:
            kept = self._read[number] = found[0], received(found[0])
        return kept[1]

    @property
    def home_amsl(self) -> int | None:
        """The height of home above mean sea level, mm."""
        home = self.message(layouts.HOME_POSITION)
        return None if home is None else int(home.fields["altitude"])

    def here(self, now_us: int) -> Received | None:
        """The last GLOBAL_POSITION_INT, if it is fresh."""
        return self.message(layouts.GLOBAL_POSITION_INT, FRESH_US, now_us)

    @property
    def armed(self) -> bool:
        """Whether the last HEARTBEAT says armed."""
        heartbeat = self.message(layouts.HEARTBEAT)
        return heartbeat is not None and bool(heartbeat.fields["base_mode"] & enums.MAV_MODE_FLAG_SAFETY_ARMED)

    @property
    def mode(self) -> int | None:
        """`custom_mode` of the last HEARTBEAT."""
        heartbeat = self.message(layouts.HEARTBEAT)
        return None if heartbeat is None else int(heartbeat.fields["custom_mode"])

    @property
    def landed_state(self) -> int:
        """`landed_state` of the last EXTENDED_SYS_STATE; 0 (undefined) without one."""
        state = self.message(layouts.EXTENDED_SYS_STATE)
        return 0 if state is None else int(state.fields["landed_state"])

    @property
    def on_ground(self) -> bool:
        """Whether it is certainly on the ground: EXTENDED_SYS_STATE says so, or it is disarmed and does not say."""
        landed = self.landed_state
        return landed == enums.MAV_LANDED_STATE_ON_GROUND or (landed == 0 and not self.armed)

    def parameter(self, name: str) -> float | None:
        """The value of a floating-point parameter; None if it was not seen."""
        found = self.parameters.get(name)
        return None if found is None else float(found.fields["param_value"])

    def _learn(self, value: Received | None) -> None:
        if value is not None:
            name = parameter_name(value)
            if name in self.parameters or len(self.parameters) < _MOST_PARAMETERS:
                self.parameters[name] = value


def parameter_name(value: Received) -> str:
    """The name in a PARAM_VALUE, PARAM_SET or PARAM_REQUEST_READ."""
    raw: bytes = value.fields["param_id"]
    return raw.split(b"\0")[0].decode("latin-1")
