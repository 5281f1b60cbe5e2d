"""The service `bind`: compare an autopilot's own log with a flight, and sign that it belongs to the flight's log."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from rtshcua import __version__
from rtshcua.adapters.autopilot_log.limited_reading import ReadFile, read_autopilot_log
from rtshcua.adapters.store.folders import data_folder
from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.adapters.store.runs import TELEMETRY
from rtshcua.adapters.store.writing import replace_inside
from rtshcua.app.autopilot_bindings import binding_name, genesis_leaf, roots_of, trusted_binding
from rtshcua.app.documents import no_log
from rtshcua.app.exit_codes import untrusted
from rtshcua.app.flights.flight_reading import read_flight
from rtshcua.app.logs import NO_LOG_HELP, finding_code, is_log, log_of
from rtshcua.app.pin import Pin
from rtshcua.app.verify_log import VerifyRequest, verify_log
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evidence.report import LogReport
from rtshcua.ground.flight.agreement import TrackAgreement, TrackDeviation, agreement
from rtshcua.ground.flight.boot_clock import BootClock, boot_times
from rtshcua.wire.autopilot_binding import (
    MAX_DEVIATIONS,
    AutopilotBinding,
    BoundDeviation,
    sign_autopilot_binding,
)
from rtshcua.wire.keys import SigningKey
from rtshcua.wire.untrusted import Untrusted


class BindRequest(NamedTuple):
    """The run (a folder, or the log in it), the autopilot's log, the pinned root, and who signs. `unlock` is called
    after everything else was checked, because it may prompt.
    """

    run: Path
    file: Path
    pin: Pin
    unlock: Callable[[KeyStore], SigningKey]


class BoundLog(NamedTuple):
    """The written binding, its content, and the key that signed it."""

    path: Path
    binding: AutopilotBinding
    kid: bytes


def bind(request: BindRequest, progress: Callable[[int, int], None] = lambda _done, _all: None) -> BoundLog | Refusal:
    """Bind an autopilot's log to a flight. `progress` gets the octets of it that were read, and their number.

    Raises `Untrusted` for a key that cannot be used, and OSError.
    """
    log = log_of(request.run)
    if not is_log(log):
        return Refusal("input", *no_log(log, request.run, NO_LOG_HELP), ExitCode.INPUT)
    verified = verify_log(log, VerifyRequest(request.pin.key, request.pin.roots), lambda _: None)
    report = verified.report
    if report.failure is not None:
        text = f"`{log}` fails verification at record {report.failure.record}: {report.failure.text}"
        help = "run `rtshcua verify-log` for details"
        return Refusal(report.failure.slug, text, help, finding_code(report.failure.slug))
    if not request.file.name.isprintable():  # nor one that is not UTF-8
        return Refusal("input", f"the name of `{request.file}` has characters that cannot be shown", "rename the file")
    read = read_autopilot_log(request.file, progress)
    if isinstance(read, Refusal):
        return read
    compared = _compared(log, read)
    if isinstance(compared, Refusal):
        return compared
    clock, found = compared
    binding = _binding(request, report, genesis_leaf(log), read, clock, found)
    key = request.unlock(KeyStore(data_folder()))
    signed = sign_autopilot_binding(binding, key)
    roots = roots_of(None if verified.basis is None else verified.basis.root, request.pin.roots)
    try:
        trusted_binding(signed, roots, binding.vehicle)
    except Untrusted as error:
        return untrusted(Untrusted(error.slug, f"the key cannot sign for this log: {error}"))
    path = log.parent / binding_name(read.digest)
    replace_inside(path, signed)
    return BoundLog(path, binding, key.kid)


def _compared(log: Path, read: ReadFile) -> tuple[BootClock, TrackAgreement] | Refusal:
    flight = read_flight(log)
    if isinstance(flight, Refusal):
        return flight
    if flight.telemetry is None or len(flight.telemetry.track) < 2:
        text = f"there is nothing to compare with: no positions in a `{TELEMETRY}` beside `{log}`"
        return Refusal("no-telemetry", text, "name the folder of the run", ExitCode.INPUT)
    times = boot_times(flight, flight.telemetry, read.log)
    if isinstance(times, Refusal):
        return times._replace(code=ExitCode.INPUT)
    track = flight.telemetry.track
    return times.clock, agreement(track, times.boot_us, read.log.track, flight.policy.projection)


def _binding(
    request: BindRequest, report: LogReport, genesis: bytes, read: ReadFile, clock: BootClock, found: TrackAgreement
) -> AutopilotBinding:
    assert report.genesis is not None
    deviations = _largest(found.deviations)
    return AutopilotBinding(
        vehicle=report.genesis.vehicle,
        flight=bytes.fromhex(report.genesis.boot),
        genesis=genesis,
        records=report.records,
        root=report.root,
        closed=report.close is not None,
        file=request.file.name,
        digest=read.digest,
        size=read.size,
        kind=read.log.kind.value,
        condition=read.log.condition.value,
        source=read.log.source,
        clock=clock.source.value,
        offset_us=clock.offset_us,
        error_us=clock.error_us,
        utc_apart_us=clock.utc_apart_us,
        points=found.points,
        compared=found.compared,
        agreed=found.agreed,
        horizontal=found.horizontal,
        vertical=found.vertical,
        flown_us=found.flown_us,
        covered_us=found.covered_us,
        deviations=tuple(BoundDeviation(*each) for each in deviations),
        others=len(found.deviations) - len(deviations),
        release=__version__,
        issued_at_us=time.time_ns() // 1_000,
    )


def _largest(deviations: tuple[TrackDeviation, ...]) -> list[TrackDeviation]:
    """The largest deviations, in order of time."""
    worst = sorted(deviations, key=lambda each: -max(each.horizontal, each.vertical))[:MAX_DEVIATIONS]
    return sorted(worst, key=lambda each: each.from_us)
