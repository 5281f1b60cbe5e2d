"""Read the telemetry of a flight (a tlog): its track, the values of the policy's signals, and what the vehicle said."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from rtshcua.adapters.store.reading import open_regular
from rtshcua.adapters.vehicle.telemetry import Telemetry
from rtshcua.codec.frames import Codec, ReceivedFrame
from rtshcua.ground.flight.flown import FlightTelemetry, GeoPlace, SignalSeries, Silence, TrackPoint, VehicleText
from rtshcua.mavlink.enums import MAV_COMP_ID_AUTOPILOT1 as AUTOPILOT
from rtshcua.mavlink.framing import message_id
from rtshcua.mavlink.layouts import GLOBAL_POSITION_INT, HEARTBEAT, STATUSTEXT
from rtshcua.mavlink.tlog import DamagedTlog, TlogEntry, stream
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.signal import ENUMERATION, POSITION

#: a silence of the autopilot from which it is stated, us
SILENT_US: Final = 2_000_000
#: the interval of a thinned reading, us: shorter than what a page can show of an hour
THINNED_US: Final = 250_000
_MOST_TEXTS: Final = 500
_HOME_POSITION, _TERRAIN_REPORT, _ALTITUDE = 242, 136, 141
_NO_HEADING: Final = 0xFFFF


def read_telemetry(
    path: Path,
    policy: Policy,
    begun_utc_us: int,
    every_us: int = THINNED_US,
    each: Callable[[int], None] = lambda _: None,
) -> FlightTelemetry:
    """Read a tlog beside a log that began at `begun_utc_us`. Of each kind of message, one is read every `every_us`, or
    all if that is 0. `each` gets the number of octets that were read. Raises OSError.
    """
    reading = _Reading(policy, begun_utc_us, every_us)
    damaged = None
    with open_regular(path) as file:
        entries = stream(file)
        try:
            for number, entry in enumerate(entries):
                reading.take(entry)
                if not number & 0xFFFF:
                    each(file.tell())
        except DamagedTlog as damage:
            damaged = damage.offset
    return reading.finished(damaged)


class _Reading:
    def __init__(self, policy: Policy, begun_utc_us: int, every_us: int) -> None:
        self._begun_us, self._every_us = begun_utc_us, every_us
        self._codec = Codec(0, 0)
        self._telemetry = Telemetry(policy)
        self._signals = {each.slot: each for each in policy.signals if each.kind != POSITION}
        self._values: dict[int, list[tuple[int, int | None]]] = {slot: [] for slot in self._signals}
        self._needed = {name for sources in self._telemetry.sources for name in sources}
        self._next: dict[int, int] = {}
        self._system: int | None = None
        self._frames, self._last_us = 0, 0
        self._track: list[TrackPoint] = []
        self._ground: int | None = None
        self._home: GeoPlace | None = None
        self._texts: list[VehicleText] = []
        self._silences: list[Silence] = []
        self._boot: list[tuple[int, int]] = []

    def take(self, entry: TlogEntry) -> None:
        frame = entry.frame
        component, number = frame[6], message_id(frame, 0)
        if component != AUTOPILOT or (self._system is not None and frame[5] != self._system):
            return
        t_us = entry.at_us - self._begun_us
        if self._frames and t_us - self._last_us > SILENT_US:
            self._silences.append(Silence(self._last_us, t_us))
        self._frames, self._last_us = self._frames + 1, t_us
        if number != STATUSTEXT and t_us < self._next.get(number, t_us):
            return
        found = self._codec.parse(frame)
        if found:
            self._next[number] = t_us + self._every_us
            self._read(t_us, number, found[0])

    def _read(self, t_us: int, number: int, frame: ReceivedFrame) -> None:
        message: Any = frame.message
        if number == HEARTBEAT and self._system is None:
            self._system = frame.system
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
        if frame.name in self._needed:
            for slot, value in self._telemetry.read(frame.name, message, AUTOPILOT, now_us=t_us):
                if slot in self._values:
                    self._values[slot].append((t_us, value))

    def _place(self, t_us: int, message: Any) -> None:
        self._boot.append((t_us, message.time_boot_ms * 1_000))
        heading = None if message.hdg == _NO_HEADING else message.hdg
        self._track.append(
            TrackPoint(
                t_us, message.lat, message.lon, message.alt, message.relative_alt, self._ground,
                10 * message.vx, 10 * message.vy, 10 * message.vz, heading,
            )
        )  # fmt: skip

    def finished(self, damaged: int | None) -> FlightTelemetry:
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
            self._frames, tuple(self._track), self._home, signals, tuple(self._texts), tuple(self._silences),
            tuple(self._boot), damaged,
        )  # fmt: skip
