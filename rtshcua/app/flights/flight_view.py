"""A flight as the content of its page: the values of `ground/flight/flight_content.py`, from its records and its
telemetry.
"""

from bisect import bisect_right
from collections.abc import Iterator, Sequence

from rtshcua import __version__
from rtshcua.app.autopilot_bindings import agreed, apart, described
from rtshcua.app.flights.collected_flight import CollectedFlight
from rtshcua.app.flights.flight_summary import FlightSummary
from rtshcua.app.flights.flight_timeline import timeline
from rtshcua.app.flights.telemetry_prose import doubts, goes_on, silences
from rtshcua.app.fly.simulated_flight import SIMULATED
from rtshcua.app.wording import many, seconds, true_to, utc
from rtshcua.decision.tree import AtMost, Both, CodeScope, Either, Negation, Node, parse, scope_of
from rtshcua.evidence.finding import Claim
from rtshcua.evidence.image_records import MOST_GAPS
from rtshcua.evidence.log_writer import origin_of
from rtshcua.evidence.records import Close, Effect
from rtshcua.evidence.report import LogReport
from rtshcua.ground.drawing.flat_site import site_of, way_of
from rtshcua.ground.flight.flight_content import (
    AutopilotLogView,
    FlightReport,
    GapView,
    ImageView,
    SignalCurve,
    SignalLimit,
    TrackView,
)
from rtshcua.ground.flight.flight_images import FlightImages, images_of
from rtshcua.ground.flight.flown import Flight
from rtshcua.ground.flight.track import distance, home_of, place_at
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.mission import Invocation
from rtshcua.model.flat.policy import Policy, Rule, RuleKind
from rtshcua.model.flat.signal import POSITION
from rtshcua.wire.autopilot_binding import AutopilotBinding


def flight_view(
    report: LogReport | None, flight: Flight, collected: CollectedFlight, bindings: Sequence[AutopilotBinding] = (), *,
    made_at_us: int, pinned: str, details: bool = True,
) -> FlightReport:  # fmt: skip
    """The content of the page of a flight, without the log. `report` is that of its verification, None while it flies;
    `bindings` are trusted ones; `pinned` names the root key. Without `details` texts from outside are left out.
    """
    genesis, ending = flight.genesis, _ending(flight, report)
    track = _track(flight)
    counted = None if track is None else _until(track, flight)
    summary = FlightSummary(report, flight, collected, counted, ending=ending, made_at_us=made_at_us, details=details)
    images = images_of(flight)
    assert collected.names is not None
    return FlightReport(
        title=f"Flight of `{collected.mission().name}` on `{genesis.vehicle}`",
        made_by=f"rtshcua {__version__}",
        made_at=utc(made_at_us),
        mission=collected.mission().name,
        vehicle=genesis.vehicle,
        begun=utc(genesis.utc_us),
        begun_utc_us=genesis.utc_us,
        lasted_us=flight.lasted_us,
        log_ends_us=_log_ends_us(flight),
        ending=ending,
        steps_done=len(summary.done),
        steps=len(flight.mission.invocations),
        highest=None if counted is None else max(each.above_home for each in counted.points),
        distance=None if counted is None else distance(counted.points, counted.places),
        verdict=_verdict(report, ending),
        pinned=pinned,
        origin=origin_of(genesis.vehicle, genesis.boot),
        root="" if report is None else report.root.hex(),
        summary=summary.lines(),
        projection=flight.policy.projection,
        site=site_of(flight.policy, home_of(flight).above_sea),
        way=way_of(flight.mission),
        track=track,
        bound=tuple(map(_bound, bindings)) if details else (),
        timeline=timeline(flight, collected.mission(), collected.names, details=details),
        decisions=tuple(each._replace(where=_where(flight, track, each.t_us)) for each in collected.decision_views()),
        images=tuple(_images(flight, images)),
        signals=_signals(flight),
        gaps=(
            *_gaps_of_log(flight, report),
            *_gaps_of_telemetry(flight),
            *_gaps_of_images(images),
            *collected.gaps(),
        ),
        proven=_texts(() if report is None else report.proven),
        unproven=_texts(() if report is None else report.unproven),
        records=tuple(collected.told),
        totals={} if report is None else dict(report.counts),
        log="",
        redacted=(),
        simulated=any(isinstance(each, Effect) and each.event == SIMULATED for each in flight.records),
    )


def _ending(flight: Flight, report: LogReport | None) -> str:
    last = flight.records[-1]
    if isinstance(last, Close):
        return last.ending
    return "flying" if report is None else "not closed"


def _verdict(report: LogReport | None, ending: str) -> str:
    if report is not None:
        return report.verdict.value
    return "growing" if ending == "flying" else "unverified"


def _texts(claims: Sequence[Claim]) -> tuple[str, ...]:
    return tuple(each.text for each in claims)


def _track(flight: Flight) -> TrackView | None:
    telemetry = flight.telemetry
    if telemetry is None or not telemetry.track:
        return None
    places = tuple(flight.local(each.latitude, each.longitude) for each in telemetry.track)
    return TrackView(telemetry.track, places)


def _images(flight: Flight, images: FlightImages) -> Iterator[ImageView]:
    """Yield the images and the pictures that failed, in the order of their records."""
    for each in sorted((*images.taken, *images.failed), key=lambda each: each.seq):
        detail, where = each.detail, None
        if detail.latitude is not None and detail.longitude is not None:
            where = flight.local(detail.latitude, detail.longitude)
        yield ImageView(
            each.seq, each.t_us, detail.camera, detail.index, detail.asked, detail.above_home_mm, where,
            None if detail.yaw_cd is None else detail.yaw_cd % 36_000, detail.pitch_cd, detail.attitude == "vehicle",
            detail.horizontal_mm,
        )  # fmt: skip


def _gaps_of_images(images: FlightImages) -> Iterator[GapView]:
    """Yield the last list of missing images of each camera that has some, and what failed."""
    for each in images.missing:
        if each.missing:
            lost = ", ".join(str(low) if low == high else f"{low} to {high}" for low, high in each.lost)
            more = "" if len(each.lost) < MOST_GAPS else " and more"
            yield GapView("images", f"{each.missing} of camera {each.camera}: {lost}{more}")
    if images.failed:
        yield GapView("images", f"{many(len(images.failed), 'picture')} failed, as the camera reported")
    if images.commands_failed:
        yield GapView("payload", f"{many(images.commands_failed, 'command')} to cameras or other payload failed")


def _log_ends_us(flight: Flight) -> int | None:
    """The time of the last record; None if the telemetry does not go on after it."""
    return flight.lasted_us if flight.telemetry is not None and goes_on(flight.telemetry) else None


def _until(track: TrackView, flight: Flight) -> TrackView | None:
    """The track up to the last record of the log, which is counted; None if it has no point there."""
    log_ends_us = _log_ends_us(flight)
    if log_ends_us is None:
        return track
    end = bisect_right(track.points, log_ends_us, key=lambda each: each.t_us)
    return TrackView(track.points[:end], track.places[:end]) if end else None


def _where(flight: Flight, track: TrackView | None, t_us: int) -> tuple[int, int] | None:
    """Where the vehicle was; None where no report tells."""
    known = None if track is None else place_at(track.points, t_us)
    return None if known is None else flight.local(known.point.latitude, known.point.longitude)


def _bound(binding: AutopilotBinding) -> AutopilotLogView:
    return AutopilotLogView(
        described(binding), agreed(binding), "" if binding.agreed == binding.points else apart(binding)
    )


def _signals(flight: Flight) -> tuple[SignalCurve, ...]:
    if flight.telemetry is None:
        return ()
    limits = signal_limits(flight.policy, flight.steps)
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
        yield GapView("records", f"nothing was recorded for {seconds(gap.us)} before record {gap.record}")


def _gaps_of_telemetry(flight: Flight) -> Iterator[GapView]:
    telemetry = flight.telemetry
    if telemetry is None:
        what = "the file that the log names is not beside it" if flight.names_telemetry else "there is none"
        yield GapView("telemetry", f"{what}: no track, no signals")
        return
    if telemetry.damaged is not None:
        yield GapView("telemetry", f"the file breaks off at octet {telemetry.damaged}")
    yield from (GapView("telemetry", each) for each in doubts(telemetry, drawn=True))
    yield from (GapView("frames", each) for each in silences(telemetry, flight.lasted_us))
    silent = [each.name for each in telemetry.signals if all(value is None for _, value in each.points)]
    if silent:
        named = ", ".join(f"`{name}`" for name in silent)
        yield GapView("signals", f"never known in the telemetry: {named}")


def signal_limits(policy: Policy, steps: Sequence[Invocation]) -> dict[int, tuple[SignalLimit, ...]]:
    """The limits by state slot: of a comparison of one signal with a constant, the side on which the condition that has
    to hold is false. `steps` are all that were ever in force; conditions of skills that none of them has are left out.
    """
    found: dict[int, dict[tuple[int, bool], SignalLimit]] = {}
    scope = scope_of(policy)
    for clause, holds, told, of in _clauses(policy, steps, scope):
        node = parse(clause.code, of)
        if isinstance(node, str):
            continue
        for slot, limit, low in _compared(node, holds=holds):
            text = f"{told}: {' '.join(clause.text.split())}"
            found.setdefault(slot, {}).setdefault((limit, low), SignalLimit(limit, low, text))
    return {slot: tuple(limits.values()) for slot, limits in found.items()}


def _clauses(
    policy: Policy, steps: Sequence[Invocation], scope: CodeScope
) -> Iterator[tuple[Clause, bool, str, CodeScope]]:
    """Yield conditions, whether they have to hold or must not hold, whose they are, and their scope."""
    for contract in dict.fromkeys(each.contract for each in steps):
        for clause in (*contract.require, *contract.assume, *contract.maintain):
            yield clause, True, contract.name, scope.about(contract)
    flown = {each.skill for each in steps}
    for number, rule in enumerate(policy.rules):
        about = [at for at in rule.skills or range(len(policy.contracts)) if at in flown]
        known = all(0 <= at < len(policy.contracts) for at in about)
        if rule.when is not None and about and known and _counts(policy, rule, about):
            of = scope.about(*(policy.contracts[at] for at in rule.skills))
            kind = RuleKind(rule.kind)
            yield rule.when, kind is RuleKind.PERMIT, f"rule {number + 1}, {kind.name.lower()}", of


def _counts(policy: Policy, rule: Rule, about: Sequence[int]) -> bool:
    """Whether a rule limits one of these skills: a permit need not hold where another rule permits the skill too."""
    permits = [each for each in policy.rules if each.kind == RuleKind.PERMIT]
    return rule.kind != RuleKind.PERMIT or any(sum(_is_about(each, at) for each in permits) == 1 for at in about)


def _is_about(rule: Rule, skill: int) -> bool:
    return not rule.skills or skill in rule.skills


def _compared(node: Node, *, holds: bool) -> Iterator[tuple[int, int, bool]]:
    """Yield slot, limit, and whether it is a lower limit. A branch of an `or` that has to hold, or of an `and` that
    must not hold, is no limit alone.
    """
    match node:
        case Both(left, right) if holds:
            yield from _compared(left, holds=holds)
            yield from _compared(right, holds=holds)
        case Either(left, right) if not holds:
            yield from _compared(left, holds=holds)
            yield from _compared(right, holds=holds)
        case Negation(operand):
            yield from _compared(operand, holds=not holds)
        case AtMost(((argument, slot, factor),), bound) if not argument and abs(factor) == 1:
            # the signal is at most `bound`, or at least `-bound`
            yield slot, factor * bound, (factor < 0) == holds
