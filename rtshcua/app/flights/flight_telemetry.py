"""Read the telemetry of a flight (a tlog): its track, the values of the policy's signals, and what the vehicle said.

A link can have several vehicles. Each one that is heard is read, and the one that is told is the one in whose system
the companion component sends, as we do (`ground.audit.frames`).
"""

from bisect import bisect_left
from collections.abc import Sequence
from itertools import pairwise
from operator import itemgetter
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeVar

from rtshcua.adapters.store.reading import open_regular
from rtshcua.adapters.vehicle.telemetry import Telemetry
from rtshcua.app.sidecar_files import SENDER_AND_NUMBER
from rtshcua.codec.frames import ReceivedFrame, decode, kind_of
from rtshcua.ground.audit.frames import OURS
from rtshcua.ground.flight.flown import (
    ClockJump,
    FlightTelemetry,
    GeoPlace,
    SignalSeries,
    TelemetrySilence,
    TrackPoint,
    VehicleText,
)
from rtshcua.ground.flight.track import exists, is_aloft
from rtshcua.mavlink.dialect import DATUM
from rtshcua.mavlink.enums import MAV_COMP_ID_AUTOPILOT1 as AUTOPILOT
from rtshcua.mavlink.layouts import GLOBAL_POSITION_INT, HEARTBEAT, STATUSTEXT
from rtshcua.mavlink.modes import is_vehicle
from rtshcua.mavlink.quantise import quantise
from rtshcua.mavlink.tlog import DamagedTlog, TlogEntry, stream
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.signal import ENUMERATION, POSITION, Signal
from rtshcua.model.quantity import Dimension

#: a silence of the autopilot from which it is stated, us
SILENT_US: Final = 2_000_000
#: how long a height above the ground counts, us
GROUND_US: Final = 2_000_000
#: the clock made a step if a time is before that of the frame before it by more, us; less are frames out of order
BACK_US: Final = 1_000_000
#: the least step forward, us; a shorter time without frames is a silence, and so is one that the flight has room for
FORWARD_US: Final = 60_000_000
_MOST_TEXTS: Final = 500
_HOME_POSITION, _TERRAIN_REPORT, _ALTITUDE = 242, 136, 141
_READ: Final = frozenset({HEARTBEAT, GLOBAL_POSITION_INT, STATUSTEXT, _HOME_POSITION, _TERRAIN_REPORT, _ALTITUDE})
#: kinds of messages that tell how the vehicle moves
_OF_PLACE: Final = frozenset({GLOBAL_POSITION_INT, _HOME_POSITION})
_NO_HEADING: Final = 0xFFFF
#: heights above the ground that MAVLink can say in whole mm; ALTITUDE says less than -1 km for "unknown"
_HIGHEST, _LOWEST = 1 << 31, -1_000_000
#: the parts of a frame's header
_SYSTEM, _COMPONENT, _NUMBER = 5, 6, slice(7, 10)
#: before any time
_NEVER: Final = -(1 << 62)

_Timed = TypeVar("_Timed", bound=tuple[Any, ...])


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


def read_telemetry(
    path: Path, policy: Policy, begun_utc_us: int, lasted_us: int | None = None, thinning: Thinning = EVERYTHING
) -> FlightTelemetry:
    """Read a tlog beside a log that began at `begun_utc_us` and lasted so long. Raises OSError."""
    reading = TelemetryReading(policy, begun_utc_us, thinning)
    reading.follow(path)
    return reading.telemetry(lasted_us)


class _Kind:
    """A kind of message of one sender, and when it is read again."""

    __slots__ = ("due_us", "number", "vehicle")

    def __init__(self, vehicle: "_Vehicle", number: int) -> None:
        self.vehicle, self.number, self.due_us = vehicle, number, 0


class _Vehicle:
    """What one vehicle says. Times of runs are UTC; all others are since the log's first record."""

    def __init__(self, system: int, policy: Policy, slots: list[int]) -> None:
        self.system, self.known = system, False  # it is a vehicle, by its heartbeat
        self.telemetry = Telemetry(policy)
        self.values: dict[int, list[tuple[int, int | None]]] = {slot: [] for slot in slots}
        self.kinds: list[_Kind] = []
        self.signals_due: dict[int, int] = {}  # when signals are taken from a message again
        self.reports, self.heard_us = 0, _NEVER
        self.begun_us: list[int] = []  # of runs of frames without a silence
        self.ended_us: list[int] = []  # of all but the last
        self.track: list[TrackPoint] = []
        self.ground: tuple[int, int] | None = None  # the height above the ground, and its time
        self.homes: list[tuple[int, GeoPlace]] = []
        self.texts: list[VehicleText] = []
        self.boot: list[tuple[int, int]] = []

    def hear_after_silence(self, at_us: int) -> None:
        """A frame comes long after the one before it, or before it."""
        if at_us < self.heard_us:
            if at_us >= self.heard_us - BACK_US:
                return
            for kind in self.kinds:
                kind.due_us = 0
            self.signals_due.clear()
        if self.begun_us:
            self.ended_us.append(self.heard_us)
        self.begun_us.append(at_us)
        self.heard_us = at_us

    def runs(self, zero_us: int) -> list[tuple[int, int]]:
        """The first and the last time of each run, in the order of the file."""
        ended_us = (*self.ended_us, self.heard_us)
        return [(a - zero_us, b - zero_us) for a, b in zip(self.begun_us, ended_us, strict=False)]

    def home(self) -> GeoPlace | None:
        """The home that was in force when it left the ground, or else the first one."""
        if not self.homes:
            return None
        first_us = self.homes[0][0]
        left_us = next((each.t_us for each in self.track if each.t_us >= first_us and is_aloft(each)), first_us)
        return self.homes[max(bisect_left(self.homes, left_us, key=lambda each: each[0]) - 1, 0)][1]


class TelemetryReading:
    """Reads a tlog, also while it is written."""

    def __init__(self, policy: Policy, begun_utc_us: int, thinning: Thinning) -> None:
        self._begun_us, self._thinning, self._policy = begun_utc_us, thinning, policy
        self._signals = {each.slot: each for each in policy.signals if each.kind != POSITION}
        self._needed = {name for sources in Telemetry(policy).sources for name in sources}
        #: frames that need not be taken, by the sender and the number of the message
        self.skipped: set[bytes] = set()
        #: how much of the file was read, octets
        self.offset = 0
        self._kinds: dict[bytes, _Kind] = {}
        self._vehicles: dict[int, _Vehicle] = {}
        #: the systems in which the companion component sends, and whether more than heartbeats
        self._companions: dict[int, bool] = {}
        self._damaged: int | None = None

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
        kind = self._kinds.get(frame[SENDER_AND_NUMBER]) or self._met(frame)
        if kind is None:
            return
        vehicle = kind.vehicle
        if 0 <= at_us - vehicle.heard_us <= SILENT_US:
            vehicle.heard_us = at_us
        else:
            vehicle.hear_after_silence(at_us)
        vehicle.reports += 1
        if at_us >= kind.due_us:
            self._decode(at_us, frame, kind)

    def _met(self, frame: bytes) -> _Kind | None:
        """The first frame of a kind: what to read of such frames; None if they are of no use here."""
        system, key, number = frame[_SYSTEM], frame[SENDER_AND_NUMBER], int.from_bytes(frame[_NUMBER], "little")
        of = kind_of(number)
        if of is not None and frame[_COMPONENT] == OURS:
            if decode(frame) is None:
                return None  # damaged: anybody may have sent it
            self._companions[system] = self._companions.get(system, False) or number != HEARTBEAT
        if of is None or frame[_COMPONENT] != AUTOPILOT or not (number in _READ or of.name in self._needed):
            self.skipped.add(key)
            return None
        vehicle = self._vehicles.get(system)
        if vehicle is None:
            vehicle = self._vehicles[system] = _Vehicle(system, self._policy, list(self._signals))
        kind = self._kinds[key] = _Kind(vehicle, number)
        vehicle.kinds.append(kind)
        return kind

    def _decode(self, at_us: int, frame: bytes, kind: _Kind) -> None:
        found = decode(frame)
        if found is None:
            return
        every_us = self._thinning.position_us if kind.number in _OF_PLACE else self._thinning.others_us
        kind.due_us = at_us + every_us if every_us and kind.number != STATUSTEXT else 0
        self._read(at_us - self._begun_us, kind, found)

    def _read(self, t_us: int, kind: _Kind, frame: ReceivedFrame) -> None:
        message: Any = frame.message
        vehicle, number = kind.vehicle, kind.number
        self._keep(t_us, vehicle, number, message)
        if frame.name in self._needed and t_us >= vehicle.signals_due.get(number, t_us):
            if self._thinning.others_us:
                vehicle.signals_due[number] = t_us + self._thinning.others_us
            for slot, value in vehicle.telemetry.read(frame.name, message, AUTOPILOT, now_us=t_us):
                if slot in vehicle.values:
                    vehicle.values[slot].append((t_us, value))

    def _keep(self, t_us: int, vehicle: _Vehicle, number: int, message: Any) -> None:
        """Keep what is no signal."""
        if number == HEARTBEAT:
            vehicle.known = vehicle.known or is_vehicle(message.type, message.autopilot)
        elif number == GLOBAL_POSITION_INT:
            self._place(t_us, vehicle, message)
        elif number == _HOME_POSITION:
            home = GeoPlace(message.latitude, message.longitude, message.altitude)
            if exists(home):
                vehicle.homes.append((t_us, home))
        elif number == _TERRAIN_REPORT:
            vehicle.ground = _ground(t_us, message.current_height) if message.loaded else None
        elif number == _ALTITUDE:
            vehicle.ground = _ground(t_us, message.altitude_terrain)
        elif number == STATUSTEXT and len(vehicle.texts) < _MOST_TEXTS:
            vehicle.texts.append(VehicleText(t_us, message.severity, message.text))

    def _place(self, t_us: int, vehicle: _Vehicle, message: Any) -> None:
        ground = vehicle.ground
        if ground is not None and not 0 <= t_us - ground[1] <= GROUND_US + self._thinning.others_us:
            ground = vehicle.ground = None
        heading = None if message.hdg == _NO_HEADING else message.hdg
        point = TrackPoint(
            t_us, message.lat, message.lon, message.alt, message.relative_alt, None if ground is None else ground[0],
            10 * message.vx, 10 * message.vy, 10 * message.vz, heading,
        )  # fmt: skip
        if exists(point):  # it knows where it is
            vehicle.boot.append((t_us, message.time_boot_ms * 1_000))
            vehicle.track.append(point)

    def telemetry(self, lasted_us: int | None = None) -> FlightTelemetry:
        """What was read so far, beside a log that lasted so long; if that is not known, no step forward is noticed, and
        no silence before the first or after the last frame.
        """
        candidates = self._candidates()
        told = candidates[0] if candidates else _Vehicle(0, self._policy, list(self._signals))
        runs = told.runs(self._begun_us)
        steps = _steps(runs, lasted_us)
        span = None if not steps or lasted_us is None else (-FORWARD_US, lasted_us + FORWARD_US)
        track = _in_order(told.track, span)
        signals = tuple(
            SignalSeries(
                each.name, each.dimension, _datum(each), dict(each.labels) if each.kind == ENUMERATION else {},
                each.stale_us, _in_order(told.values[slot], span),
            )
            for slot, each in self._signals.items()
        )  # fmt: skip
        return FlightTelemetry(
            told.reports, track, told.home(), signals, _in_order(told.texts, span), _silences(runs, span, lasted_us),
            _in_order(told.boot, span), self._damaged, tuple(each.system for each in candidates[1:] and candidates),
            steps, len(told.track) - len(track), 0 if lasted_us is None else max(_ended(runs, span) - lasted_us, 0),
        )  # fmt: skip

    def _candidates(self) -> list[_Vehicle]:
        """The vehicles that may be the one that was commanded; several if the telemetry does not tell."""
        heard = list(self._vehicles.values())
        heard = [each for each in heard if each.known] or heard
        for systems in ({system for system, more in self._companions.items() if more}, set(self._companions)):
            ours = [each for each in heard if each.system in systems]
            if ours:
                return ours
        return heard


def _ground(t_us: int, metres: float) -> tuple[int, int] | None:
    """A height above the ground in mm and its time; None if it is unknown or impossible."""
    height = quantise(metres, 1_000, 1)
    return (height, t_us) if height is not None and _LOWEST < height < _HIGHEST else None


def _datum(signal: Signal) -> str:
    """The datum of an altitude, by its first message and field."""
    if signal.dimension != Dimension.ALTITUDE.value or not signal.sources:
        return ""
    datum = DATUM.get((signal.sources[0].message, signal.sources[0].fields[0]))
    return "" if datum is None else datum.value


def _in_order(points: Sequence[_Timed], span: tuple[int, int] | None) -> tuple[_Timed, ...]:
    """What has a time (its first item) within a span, in the order of time."""
    within = points if span is None else [each for each in points if span[0] <= each[0] <= span[1]]
    return tuple(sorted(within, key=itemgetter(0)))


def _steps(runs: Sequence[tuple[int, int]], lasted_us: int | None) -> tuple[ClockJump, ...]:
    """The steps of the clock between runs: back, or forward by more than the flight has room for."""
    most_us = -_NEVER if lasted_us is None else max(lasted_us, FORWARD_US)
    between = [(one[1], other[0] - one[1]) for one, other in pairwise(runs)]
    return tuple(ClockJump(after_us, by_us) for after_us, by_us in between if by_us < 0 or by_us > most_us)


def _ended(runs: Sequence[tuple[int, int]], span: tuple[int, int] | None) -> int:
    """The time of the last frame within a span."""
    return max((b if span is None else min(b, span[1]) for a, b in runs if span is None or a <= span[1]), default=0)


def _silences(
    runs: Sequence[tuple[int, int]], span: tuple[int, int] | None, lasted_us: int | None
) -> tuple[TelemetrySilence, ...]:
    """The times between runs within a span, and those between them and both ends of the log, if these are known."""
    if span is not None:
        runs = [(max(a, span[0]), min(b, span[1])) for a, b in runs if a <= span[1] and b >= span[0]]
    ordered = sorted(runs)
    if lasted_us is not None:
        ordered.append((lasted_us, lasted_us))
    silences = []
    heard_us = 0 if lasted_us is not None else ordered[0][0] if ordered else 0
    for begun_us, ended_us in ordered:
        if begun_us - heard_us > SILENT_US:
            silences.append(TelemetrySilence(heard_us, begun_us))
        heard_us = max(heard_us, ended_us)
    return tuple(silences)
