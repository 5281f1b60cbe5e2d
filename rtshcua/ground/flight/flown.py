"""A flight as one immutable value: what its log recorded, and what its telemetry says of its way and its signals.

Times are in us since the log's first record, by the clock of the computer on board; `Flight.utc_of` converts them.
Latitude and longitude are WGS 84 in 1e-7 degree; heights in mm, each with its datum in its name. Nothing is verified
here: only the log is evidence, and the telemetry is what was heard on the link.
"""

from collections.abc import Mapping
from typing import NamedTuple

from rtshcua.evidence.records import AnyRecord, Close, Genesis
from rtshcua.ground.flight.log_times import LogSegment, since_begun
from rtshcua.model.flat.mission import Invocation, Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.zone import project


class TrackPoint(NamedTuple):
    """Where the autopilot said that the vehicle was (GLOBAL_POSITION_INT); `above_ground` is None if it did not know
    (TERRAIN_REPORT, else ALTITUDE), and `heading` is in 1/100 degree from true north, None if unknown.
    """

    t_us: int
    latitude: int
    longitude: int
    above_sea: int
    above_home: int
    above_ground: int | None
    north: int  # mm/s over ground, as the next two
    east: int
    down: int
    heading: int | None


class GeoPlace(NamedTuple):
    """A place with its height above mean sea level."""

    latitude: int
    longitude: int
    above_sea: int


class SignalSeries(NamedTuple):
    """The values of one of the policy's signals, in canonical units (`dimension`); None means "reported as unknown".
    `labels` name the values of an enumeration; `datum` is that of an altitude (`Datum`), else empty.
    """

    name: str
    dimension: str
    datum: str
    labels: Mapping[int, str]
    stale_us: int
    points: tuple[tuple[int, int | None], ...]


class VehicleText(NamedTuple):
    """A text of the vehicle (STATUSTEXT), which is not to be trusted; `severity` is a MAV_SEVERITY."""

    t_us: int
    severity: int
    text: str


class TelemetrySilence(NamedTuple):
    """A time of the log without a report of the autopilot's position, signals or state in the telemetry."""

    from_us: int
    to_us: int


class ClockJump(NamedTuple):
    """A step of the clock that the telemetry's times are from: after which time it was, and by how much, us."""

    after_us: int
    by_us: int


class FlightTelemetry(NamedTuple):
    """What the telemetry of a flight says, in the order of time; `reports` is the number of frames with these, and
    `damaged` says where the file breaks off (an octet), None if it is whole. `home` is the one in force when the
    vehicle left the ground. `boot_us` has for each point of the track its time and the autopilot's own time since its
    boot, in us. If it has the reports of several vehicles (MAVLink system ids) that may be the one that was commanded,
    `vehicles` are these, and the first is the one that is told. Of `stray` positions nobody knows the time, because
    the clock made `steps`; they are left out. `later_us` is how long
    it goes on after the last record of a log that is not recorded any more.
    """

    reports: int
    track: tuple[TrackPoint, ...]
    home: GeoPlace | None
    signals: tuple[SignalSeries, ...]
    texts: tuple[VehicleText, ...]
    silences: tuple[TelemetrySilence, ...]
    boot_us: tuple[tuple[int, int], ...]
    damaged: int | None
    vehicles: tuple[int, ...] = ()
    steps: tuple[ClockJump, ...] = ()
    stray: int = 0
    later_us: int = 0


class Flight(NamedTuple):
    """A flight. `mission` is the one that was in force at the end, with the steps that replaced others; `records` are
    those of the log, in order, without the octets of bundle and trust root. `telemetry` is None if there is none.
    `lasted_us` is the time of the last record that the flight itself wrote, and `steps` are all that were ever in
    force.
    """

    genesis: Genesis
    policy: Policy
    mission: Mission
    records: tuple[AnyRecord, ...]
    telemetry: FlightTelemetry | None
    segments: tuple[LogSegment, ...]
    lasted_us: int
    steps: tuple[Invocation, ...]

    @property
    def names_telemetry(self) -> bool:
        """Whether the end of the log names the telemetry that was recorded beside it."""
        last = self.records[-1]
        return isinstance(last, Close) and last.tlog is not None

    def since_begun(self, record: AnyRecord) -> int:
        """The time of a record of the log since its first one."""
        return since_begun(self.segments, record)

    def utc_of(self, t_us: int) -> int:
        """The UTC of a time in us since the Unix epoch, by the clock at the beginning of the log."""
        return self.genesis.utc_us + t_us

    def local(self, latitude: int, longitude: int) -> tuple[int, int]:
        """A place in the policy's local plane: mm east and north of the declared home."""
        return project(self.policy.projection, latitude, longitude)
