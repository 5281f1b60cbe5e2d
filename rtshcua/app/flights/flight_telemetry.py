"""Read the telemetry of a flight (a tlog): its track, the values of the policy's signals, and what the vehicle said."""

from pathlib import Path
from typing import Any, Final, NamedTuple

from rtshcua.adapters.store.reading import open_regular
from rtshcua.adapters.vehicle.telemetry import Telemetry
from rtshcua.app.sidecar_files import SENDER_AND_NUMBER
from rtshcua.codec.frames import Codec, ReceivedFrame, kind_of
from rtshcua.ground.flight.flown import (
    FlightTelemetry,
    GeoPlace,
    SignalSeries,
    TelemetrySilence,
    TrackPoint,
    VehicleText,
)
from rtshcua.mavlink.enums import MAV_COMP_ID_AUTOPILOT1 as AUTOPILOT
from rtshcua.mavlink.layouts import GLOBAL_POSITION_INT, HEARTBEAT, STATUSTEXT
from rtshcua.mavlink.tlog import DamagedTlog, TlogEntry, stream
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.signal import ENUMERATION, POSITION
from rtshcua.model.flat.zone import HALF_TURN

#: a silence of the autopilot from which it is stated, us
SILENT_US: Final = 2_000_000
_MOST_TEXTS: Final = 500
_HOME_POSITION, _TERRAIN_REPORT, _ALTITUDE = 242, 136, 141
_READ: Final = frozenset({HEARTBEAT, GLOBAL_POSITION_INT, STATUSTEXT, _HOME_POSITION, _TERRAIN_REPORT, _ALTITUDE})
#: what an autopilot reports before it knows where it is, and the limit of latitude, 1e-7 degree
_NOWHERE: Final = (0, 0)
_POLE: Final = 900_000_000
_NO_HEADING: Final = 0xFFFF
#: the parts of a frame's header
_SYSTEM, _COMPONENT, _NUMBER = 5, 6, slice(7, 10)


class Thinning(NamedTuple):
    """How often a kind of message is read, in us: the position, and the others. 0: always."""

    position_us: int
    others_us: int


EVERYTHING: Final = Thinning(0, 0)


def thinning_of(path: Path) -> Thinning:
    """The thinning of a file for a page, which shows some 4,000 positions and 1,000 other reports of a kind of an hour.
    Raises OSError.
    """
    octets = path.stat().st_size  # about 3,800 a second
    return Thinning(max(200_000, octets // 16), max(400_000, octets // 4))


def read_telemetry(path: Path, policy: Policy, begun_utc_us: int, thinning: Thinning = EVERYTHING) -> FlightTelemetry:
    """Read a tlog beside a log that began at `begun_utc_us`. Raises OSError."""
    reading = TelemetryReading(policy, begun_utc_us, thinning)
    reading.follow(path)
    return reading.telemetry()


class TelemetryReading:
    """Reads a tlog, also while it is written."""

    def __init__(self, policy: Policy, begun_utc_us: int, thinning: Thinning) -> None:
        self._begun_us, self._thinning = begun_utc_us, thinning
        self._codec = Codec(0, 0)
        self._telemetry = Telemetry(policy)
        self._signals = {each.slot: each for each in policy.signals if each.kind != POSITION}
        self._values: dict[int, list[tuple[int, int | None]]] = {slot: [] for slot in self._signals}
        self._needed = {name for sources in self._telemetry.sources for name in sources}
        #: frames that need not be taken, by the sender and the number of the message
        self.skipped: set[bytes] = set()
        #: how much of the file was read, octets
        self.offset = 0
        self._due: dict[bytes, int] = {}  # when a kind of message is read again
        self._signals_due: dict[int, int] = {}  # when signals are taken from it again
        self._damaged: int | None = None
        self._system: int | None = None
        self._reports, self._heard_us = 0, 0
        self._track: list[TrackPoint] = []
        self._ground: int | None = None
        self._home: GeoPlace | None = None
        self._texts: list[VehicleText] = []
        self._silences: list[TelemetrySilence] = []
        self._boot: list[tuple[int, int]] = []

    def follow(self, path: Path) -> bool:
        """Read what the file has more than before; return whether there was any. Raises OSError."""
        before = self.offset
        with open_regular(path) as file:
            file.seek(before)
            self._damaged = None
            try:
                for entry in stream(file):
                    if entry.frame[SENDER_AND_NUMBER] not in self.skipped:
                        self.take(entry)
                self.offset = file.tell()
            except DamagedTlog as damage:
                self.offset = self._damaged = before + damage.offset
        return self.offset > before

    def take(self, entry: TlogEntry) -> None:
        """Take the next entry of the file that is not `skipped`."""
        frame, at_us = entry.frame, entry.at_us
        due_us = self._due.get(frame[SENDER_AND_NUMBER])
        if due_us is None:
            if not self._is_read(frame):
                self.skipped.add(frame[SENDER_AND_NUMBER])
                return
            due_us = 0
        if at_us - self._heard_us > SILENT_US and self._reports:
            self._silences.append(TelemetrySilence(self._heard_us - self._begun_us, at_us - self._begun_us))
        self._heard_us = at_us
        self._reports += 1
        if at_us >= due_us:
            self._decode(at_us, frame)

    def _is_read(self, frame: bytes) -> bool:
        """Whether such frames are of the autopilot and of any use here."""
        if frame[_COMPONENT] != AUTOPILOT or (self._system is not None and frame[_SYSTEM] != self._system):
            return False
        number = int.from_bytes(frame[_NUMBER], "little")
        kind = kind_of(number)
        return kind is not None and (number in _READ or kind.name in self._needed)

    def _decode(self, at_us: int, frame: bytes) -> None:
        found = self._codec.parse(frame)
        if not found:
            return
        number = int.from_bytes(frame[_NUMBER], "little")
        every_us = self._thinning.position_us if number == GLOBAL_POSITION_INT else self._thinning.others_us
        self._due[frame[SENDER_AND_NUMBER]] = at_us + (0 if number == STATUSTEXT else every_us)
        self._read(at_us - self._begun_us, number, found[0])

    def _read(self, t_us: int, number: int, frame: ReceivedFrame) -> None:
        message: Any = frame.message
        if number == HEARTBEAT and self._system is None:
            self._system = frame.system
            self._due = {key: due_us for key, due_us in self._due.items() if key[0] == frame.system}
        elif number == GLOBAL_POSITION_INT:
            self._place(t_us, message)
        elif number == _HOME_POSITION:
            self._home = GeoPlace(message.latitude, message.longitude, message.altitude)
        elif number == _TERRAIN_REPORT:
            self._ground = round(message.current_height * 1_000) if message.loaded else None
        elif number == _ALTITUDE:
            self._ground = round(message.altitude_terrain * 1_000) if message.altitude_terrain > -1_000 else None
        elif number == STATUSTEXT and len(self._texts) < _MOST_TEXTS:
            self._texts.append(VehicleText(t_us, message.severity, message.text))
        if frame.name in self._needed and t_us >= self._signals_due.get(number, t_us):
            self._signals_due[number] = t_us + self._thinning.others_us
            for slot, value in self._telemetry.read(frame.name, message, AUTOPILOT, now_us=t_us):
                if slot in self._values:
                    self._values[slot].append((t_us, value))

    def _place(self, t_us: int, message: Any) -> None:
        if (message.lat, message.lon) == _NOWHERE or abs(message.lat) > _POLE or abs(message.lon) > HALF_TURN:
            return  # it does not know where it is
        self._boot.append((t_us, message.time_boot_ms * 1_000))
        heading = None if message.hdg == _NO_HEADING else message.hdg
        self._track.append(
            TrackPoint(
                t_us, message.lat, message.lon, message.alt, message.relative_alt, self._ground,
                10 * message.vx, 10 * message.vy, 10 * message.vz, heading,
            )
        )  # fmt: skip

    def telemetry(self) -> FlightTelemetry:
        """What was read so far."""
        signals = tuple(
            SignalSeries(
                each.name,
                each.dimension,
                dict(each.labels) if each.kind == ENUMERATION else {},
                each.stale_us,
                tuple(self._values[slot]),
            )
            for slot, each in self._signals.items()
        )
        return FlightTelemetry(
            self._reports, tuple(self._track), self._home, signals, tuple(self._texts), tuple(self._silences),
            tuple(self._boot), self._damaged,
        )  # fmt: skip
