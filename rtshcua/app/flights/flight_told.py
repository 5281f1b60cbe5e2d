"""A flight as the content of its page: the values of `ground/flight/flight_content.py`, from its records and its
telemetry.
"""

from bisect import bisect_left
from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import isqrt
from typing import Final

from rtshcua import __version__
from rtshcua.app.autopilot_bindings import agreed, apart, described
from rtshcua.app.flights.collected_flight import CollectedFlight
from rtshcua.app.flights.flight_summary import FlightSummary
from rtshcua.app.flights.flight_timeline import timeline
from rtshcua.app.flights.signal_limits import signal_limits
from rtshcua.app.wording import many, true_to, utc
from rtshcua.evidence.log_writer import origin_of
from rtshcua.evidence.records import Close
from rtshcua.evidence.report import LogReport
from rtshcua.ground.drawing.flat_site import site_of, way_of
from rtshcua.ground.flight.flight_content import (
    AutopilotLogView,
    FlightReport,
    GapView,
    SignalCurve,
    TrackView,
)
from rtshcua.ground.flight.flown import Flight, FlightTelemetry
from rtshcua.model.flat.signal import POSITION
from rtshcua.wire.autopilot_binding import AutopilotBinding

#: the most silences that are told
_MOST_SILENCES: Final = 20


def flight_told(
    report: LogReport | None, flight: Flight, collected: CollectedFlight, bindings: Sequence[AutopilotBinding] = (), *,
    made_at_us: int, pinned: str, details: bool = True,
) -> FlightReport:  # fmt: skip
    """The content of the page of a flight, without the log. `report` is that of its verification, None while it flies;
    `bindings` are trusted ones; `pinned` names the root key. Without `details` texts from outside are left out.
    """
    genesis, last = flight.genesis, flight.records[-1]
    ending = last.ending if isinstance(last, Close) else "flying" if report is None else "not closed"
    track, elevation = _track(flight)
    summary = FlightSummary(report, flight, collected, track, ending=ending, made_at_us=made_at_us, details=details)
    assert collected.names is not None
    return FlightReport(
        title=f"Flight of `{collected.mission().name}` on `{genesis.vehicle}`",
        made_by=f"rtshcua {__version__}",
        made_at=utc(made_at_us),
        mission=collected.mission().name,
        vehicle=genesis.vehicle,
        begun=utc(genesis.utc_us),
        begun_utc_us=genesis.utc_us,
        lasted_us=flight.since_begun(last.at_us),
        ending=ending,
        steps_done=len(summary.done),
        steps=len(flight.mission.invocations),
        highest=None if track is None else max(each.above_home for each in track.points),
        distance=None if track is None else _distance(track.places),
        verdict="growing" if report is None else report.verdict.value,
        pinned=pinned,
        origin=origin_of(genesis.vehicle, genesis.boot),
        root="" if report is None else report.root.hex(),
        summary=summary.lines(),
        projection=flight.policy.projection,
        site=site_of(flight.policy, elevation),
        way=way_of(flight.mission),
        track=track,
        bound=tuple(map(_bound, bindings)) if details else (),
        timeline=timeline(flight, collected.mission(), collected.names, details=details),
        decisions=tuple(each._replace(where=_where(track, each.t_us)) for each in collected.decisions_told()),
        signals=_signals(flight),
        gaps=(*_gaps_of_log(flight, report), *_gaps_of_telemetry(flight.telemetry), *collected.gaps()),
        proven=() if report is None else tuple(claim.text for claim in report.proven),
        unproven=() if report is None else tuple(claim.text for claim in report.unproven),
        records=tuple(collected.told),
        totals={} if report is None else dict(report.counts),
        log="",
        redacted=(),
    )


def _track(flight: Flight) -> tuple[TrackView | None, int | None]:
    """The flown track, and the height of home above mean sea level."""
    telemetry = flight.telemetry
    if telemetry is None or not telemetry.track:
        return None, None
    first = telemetry.track[0]
    elevation = first.above_sea - first.above_home if telemetry.home is None else telemetry.home.above_sea
    places = tuple(flight.local(each.latitude, each.longitude) for each in telemetry.track)
    return TrackView(telemetry.track, places), elevation


def _where(track: TrackView | None, t_us: int) -> tuple[int, int] | None:
    if track is None:
        return None
    at = min(bisect_left(track.points, t_us, key=lambda each: each.t_us), len(track.points) - 1)
    return track.places[at]


def _distance(places: Sequence[tuple[int, int]]) -> int:
    """The length of a track over ground, mm."""
    return sum(isqrt((x1 - x0) ** 2 + (y1 - y0) ** 2) for (x0, y0), (x1, y1) in pairwise(places))


def _bound(binding: AutopilotBinding) -> AutopilotLogView:
    return AutopilotLogView(
        described(binding), agreed(binding), "" if binding.agreed == binding.points else apart(binding)
    )


def _signals(flight: Flight) -> tuple[SignalCurve, ...]:
    if flight.telemetry is None:
        return ()
    limits = signal_limits(flight.policy, flight.mission)
    slots = {each.name: each.slot for each in flight.policy.signals if each.kind != POSITION}
    return tuple(SignalCurve(each, limits.get(slots[each.name], ())) for each in flight.telemetry.signals)


def _gaps_of_log(flight: Flight, report: LogReport | None) -> Iterator[GapView]:
    yield GapView("clock", f"times of day are {true_to(flight.genesis.utc_error_us)}")
    if report is None:
        return
    tail = report.records - report.anchored
    if tail:
        yield GapView("witnesses", f"{many(tail, 'record')} at the end, which no witness holds")
    for gap in report.gaps:
        yield GapView("records", f"nothing was recorded for {_seconds(gap.us)} before record {gap.record}")


def _gaps_of_telemetry(telemetry: FlightTelemetry | None) -> Iterator[GapView]:
    if telemetry is None:
        yield GapView("telemetry", "there is none: no track, no signals")
        return
    if telemetry.damaged is not None:
        yield GapView("telemetry", f"the file breaks off at octet {telemetry.damaged}")
    for silence in telemetry.silences[:_MOST_SILENCES]:
        between = f"from {_seconds(silence.from_us)} to {_seconds(silence.to_us)}"
        yield GapView("frames", f"no frame of the autopilot {between}")
    if len(telemetry.silences) > _MOST_SILENCES:
        yield GapView("frames", f"and {len(telemetry.silences) - _MOST_SILENCES} more silences")
    silent = [each.name for each in telemetry.signals if all(value is None for _, value in each.points)]
    if silent:
        named = ", ".join(f"`{name}`" for name in silent)
        yield GapView("signals", f"never known in the telemetry: {named}")


def _seconds(us: int) -> str:
    return f"{us / 1_000_000:.1f} s"
