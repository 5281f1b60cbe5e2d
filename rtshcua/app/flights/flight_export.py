"""The service `export`: a flight as a file for other programs."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Final, NamedTuple

from rtshcua import __version__
from rtshcua.adapters import exiftool
from rtshcua.adapters.exiftool import ExifToolError
from rtshcua.adapters.store.logs import lines
from rtshcua.adapters.store.reading import open_regular
from rtshcua.adapters.store.runs import LOG, TELEMETRY
from rtshcua.adapters.store.writing import write_out
from rtshcua.app.documents import kind_of, no_log
from rtshcua.app.flights.flight_reading import read_flight
from rtshcua.app.flights.telemetry_prose import doubts
from rtshcua.app.logs import NO_LOG_HELP, is_log, log_of
from rtshcua.app.pin import trusted
from rtshcua.app.telling.record_prose import Names
from rtshcua.app.verify_log import VerifyRequest, verify_log
from rtshcua.app.wording import many
from rtshcua.decision.prepare import prepare, prepare_mission
from rtshcua.diagnostics.excerpt import visible
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.kinds import BUNDLE, DOCUMENT, KEY, PROOF, SOURCE, SPECIFICATION
from rtshcua.diagnostics.kinds import LOG as FLIGHT_LOG
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.diagnostics.suggest import listed, nearest
from rtshcua.evidence.log_writer import BOUNDARY, origin_of
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import DecisionRecord, Effect, Genesis
from rtshcua.evidence.report import LogVerdict
from rtshcua.ground.flight.export import CSV, FORMATS, GEOJSON, GEOTAG, GPX, KML, MCAP, PLAN, SUFFIXES, TLOG
from rtshcua.ground.flight.export.exported import ExportedRecord, FlightExport, with_usable_track
from rtshcua.ground.flight.flight_images import FlightImage, FlightImages, NamedImage, images_of, named
from rtshcua.ground.flight.flown import Flight, FlightTelemetry
from rtshcua.ground.flight.track import home_of
from rtshcua.wire.request import STEP

_EVIDENCE: Final = (SOURCE, SPECIFICATION, BUNDLE, DOCUMENT, KEY, PROOF, FLIGHT_LOG)
#: the name that WebODM reads, and the endings of image files
GEO_TXT: Final = "geo.txt"
_IMAGES: Final = frozenset(
    {".jpg", ".jpeg", ".tif", ".tiff", ".dng", ".png", ".heic", ".arw", ".cr2", ".cr3", ".nef", ".raf"}
)
_ONLY_PLAN: Final = f"of this run only the plan can be exported: `--to {PLAN}`"


class ExportRequest(NamedTuple):
    """A log or a run folder, the format, and the file that will be written (None: standard output). `images` is the
    folder with the image files of a geotag export; with `tag` their metadata is written too.
    """

    run: Path
    format: str
    target: Path | None
    images: Path | None = None
    tag: bool = False


class LogStatus(NamedTuple):
    """Whether the log verifies; `verdict` is None if nothing could be verified, and `text` says why."""

    verdict: LogVerdict | None
    text: str

    @property
    def verified(self) -> bool:
        """Whether it verifies up to its signed close."""
        return self.verdict is LogVerdict.VERIFIED


class ExportedFile(NamedTuple):
    """The content of the file, the number of its points (items of a plan, frames of a tlog), the datum of its heights,
    the status of the log, and warnings.
    """

    data: bytes
    points: int
    datum: str
    log: LogStatus
    warnings: tuple[str, ...]


class _Made(NamedTuple):
    data: bytes
    points: int
    datum: str
    warnings: tuple[str, ...] = ()


def accepted(format: str) -> Refusal | None:
    """The refusal of an unknown format."""
    if format in FORMATS:
        return None
    near = nearest(format, FORMATS)
    help = f"did you mean `{near}`?" if near else f"accepted: {listed(FORMATS)}"
    return Refusal("usage", f"unknown format `{format}`", help)


def name_for(run: Path, format: str) -> Path:
    """The name of the file in the current folder: that of the run folder, or else of the log; `geo.txt` for geotag."""
    if format == GEOTAG:
        return Path(GEO_TXT)
    log = log_of(run)
    name = log.resolve().parent.name if log.name == LOG else log.stem
    return Path(f"{name or 'flight'}.{format}")


def export(request: ExportRequest) -> ExportedFile | Refusal:
    """Make the file, and write it if there is a target. Raises OSError."""
    refused = accepted(request.format) or _misused(request)
    refused = refused or _unwritable(request.target, log_of(request.run), request.format)
    if refused is not None:
        return refused
    log = log_of(request.run)
    if not is_log(log):
        return Refusal("input", *no_log(log, request.run, NO_LOG_HELP))
    read_back = read_flight(log)
    if isinstance(read_back, Refusal):
        return read_back
    flight, dropped = with_usable_track(read_back)
    refused = _inconsistent(request, flight) or _lacking(request, flight)
    if refused is not None:
        return refused
    status = _status(log)
    made_by = f"rtshcua {__version__}"
    exported = FlightExport(flight, _told(log, flight), made_by, status.verified, status.text)
    made = _geotag(request, exported) if request.format == GEOTAG else _made(request.format, exported, log)
    if isinstance(made, Refusal):
        return made
    if request.target is not None:
        write_out(request.target, made.data)
    warnings = made.warnings
    if request.format not in (PLAN, TLOG, GEOTAG):
        warnings += tuple(_warnings(flight.telemetry, dropped))
    return ExportedFile(made.data, made.points, made.datum, status, warnings)


def _warnings(telemetry: FlightTelemetry | None, dropped: int) -> Iterator[str]:
    """Yield what an export of telemetry leaves out or leaves open."""
    if dropped:
        yield f"left out {many(dropped, 'position')} with an impossible place or time"
    if telemetry is not None:
        yield from (f"the telemetry: {each}" for each in doubts(telemetry))
        if telemetry.damaged is not None:
            yield f"the telemetry is damaged from byte {telemetry.damaged} on; what follows was not read"


def _unwritable(target: Path | None, log: Path, format: str) -> Refusal | None:
    if target is None:
        return None
    if target.is_dir():
        return Refusal("output", f"`{target}` is a folder", "name a file with `-o`")
    if not target.parent.is_dir():
        return Refusal("output", f"there is no folder `{target.parent}` to write to", code=ExitCode.INPUT)
    if not target.is_file():
        return None
    kind = kind_of(target)
    if (target.resolve().parent / LOG).exists():
        return Refusal("output", f"`{target}` is a file of a run, and is not overwritten", "write it elsewhere")
    if kind in _EVIDENCE or target.samefile(log):
        name = "the log" if kind is None else kind.name
        return Refusal("output", f"`{target}` is {name}, and is not overwritten by an export", "name another file")
    ends = SUFFIXES.get(format, format)
    if target.suffix.lower() != f".{ends}" and target.stat().st_size and not target.is_symlink():
        what = f"`{target}` exists and is not named as {format}, and is not overwritten by it"
        return Refusal("output", what, f"name a file that ends in `.{ends}`")
    return None


def _inconsistent(request: ExportRequest, flight: Flight) -> Refusal | None:
    """The refusal of a mission that replacements, which nobody has verified, made inconsistent."""
    prepared = prepare(flight.policy)
    found = prepared if isinstance(prepared, Refusal) else prepare_mission(flight.mission, prepared)
    if not isinstance(found, Refusal):
        return None
    return Refusal("malformed", f"the replaced mission in `{request.run}` is inconsistent: {found.text}")


def _lacking(request: ExportRequest, flight: Flight) -> Refusal | None:
    """The refusal if the telemetry lacks what the format shows."""
    if request.format in (PLAN, GEOTAG):
        return None
    if flight.telemetry is None:
        return Refusal("no-telemetry", f"`{request.run}` has no telemetry", _ONLY_PLAN, ExitCode.INPUT)
    if not flight.telemetry.track and request.format not in (MCAP, TLOG):
        return Refusal("no-position", f"the telemetry of `{request.run}` has no position", _ONLY_PLAN, ExitCode.INPUT)
    return None


def _status(log: Path) -> LogStatus:
    """Verify the log and the files beside it quickly, with the key store's root."""
    pinned = trusted(None)
    if isinstance(pinned, Refusal):
        return LogStatus(None, "not verified: the key store has no root to verify it with")
    report = verify_log(log, VerifyRequest(pinned.key, pinned.roots), lambda _: None).report
    flaw = report.failure or report.shortfall
    if report.verdict is LogVerdict.VERIFIED or flaw is None:
        signed = any(each.slug == "telemetry" for each in report.proven)
        telemetry = "with the telemetry that it names" if signed else "which does not cover the telemetry"
        return LogStatus(LogVerdict.VERIFIED, f"verified with the key store's root {pinned.key.hex()}, {telemetry}")
    if report.verdict is LogVerdict.INCOMPLETE:
        return LogStatus(LogVerdict.INCOMPLETE, f"not verified: it is incomplete: {flaw.text}")
    return LogStatus(LogVerdict.FAILED, f"not verified: {flaw.slug} at record {flaw.record}: {flaw.text}")


def _told(log: Path, flight: Flight) -> tuple[ExportedRecord, ...]:
    """The decisions and events in words; statements of the boundary are left out."""
    with open_regular(log) as file:
        first = read(next(lines(file), b""))
    names = Names.of(first) if isinstance(first, Genesis) else Names(None)
    told = []
    for record in flight.records:
        if isinstance(record, DecisionRecord) or (isinstance(record, Effect) and record.event != BOUNDARY):
            told.append(_told_record(record, flight, names))
        names.follow(record)
    return tuple(told)


def _told_record(record: DecisionRecord | Effect, flight: Flight, names: Names) -> ExportedRecord:
    words = " ".join(names.tell(record).removeprefix("· ").split())
    t_us, step = flight.since_begun(record), record.step if record.kind >= STEP else -1
    if isinstance(record, DecisionRecord):
        return ExportedRecord(t_us, True, record.outcome, record.reason, step, words)
    return ExportedRecord(t_us, False, record.event, "", step, words)


def _made(format: str, exported: FlightExport, log: Path) -> _Made | Refusal:
    """The content in a format."""
    if format == PLAN:
        return _plan(exported)
    if format == MCAP:
        return _mcap(exported)
    if format == TLOG:
        return _tlog(log)
    make, datum = _text_format(format, exported)
    return _Made(make(exported), len(exported.track), datum)


def _text_format(format: str, exported: FlightExport) -> tuple[Callable[[FlightExport], bytes], str]:
    """The function that makes a format, and its datum."""
    from rtshcua.ground.flight.export import csv_table, geojson_file, gpx, kml

    if format == KML:
        return kml.kml, kml.datum(home_of(exported.flight))
    if format == GPX:
        return gpx.gpx, gpx.DATUM
    if format == GEOJSON:
        return geojson_file.geojson, geojson_file.DATUM
    assert format == CSV
    return csv_table.csv_table, csv_table.DATUM


def _misused(request: ExportRequest) -> Refusal | None:
    """The refusal of options that another format has, or that need each other."""
    if request.format != GEOTAG and (request.images is not None or request.tag):
        return Refusal("usage", f"`--images` and `--tag` are for `--to {GEOTAG}`")
    if request.tag and request.images is None:
        return Refusal("usage", "`--tag` needs the files", "name their folder with `--images`")
    if request.images is not None and not request.images.is_dir():
        return Refusal("input", f"`{request.images}` is not a folder", "name the folder with the images")
    if request.tag and exiftool.installed() is None:
        help = "install ExifTool (https://exiftool.org), or leave out `--tag`: `geo.txt` alone needs no tool"
        return Refusal("no-exiftool", "`--tag` needs ExifTool, which is not installed", help, ExitCode.USAGE)
    return None


def _geotag(request: ExportRequest, exported: FlightExport) -> _Made | Refusal:
    """The places of the images, written into their files too if that is requested."""
    from rtshcua.ground.flight.export import geotag

    images = images_of(exported.flight)
    placed = [each for each in images.taken if each.is_placed]
    if not placed:
        return Refusal("no-image", f"the log of `{request.run}` has no image with a place", code=ExitCode.INPUT)
    files = None if request.images is None else list(_files(request.images))
    found = _matched(request, images.taken, files)
    if isinstance(found, Refusal):
        return found
    pairs, how = found
    pairs = tuple(each for each in pairs if each.image.is_placed)
    if request.tag and request.images is not None:
        origin = origin_of(exported.flight.genesis.vehicle, exported.flight.genesis.boot)
        failed = _tag(geotag.exif_arguments(request.images.resolve(), pairs, origin), len(pairs))
        if failed is not None:
            return failed
    warnings = tuple(_image_warnings(images, placed, pairs, files))
    return _Made(geotag.geo_txt(exported, pairs, how), len(pairs), geotag.DATUM, warnings)


def _matched(
    request: ExportRequest, images: Sequence[FlightImage], files: Sequence[str] | None
) -> tuple[tuple[NamedImage, ...], str] | Refusal:
    """Each image with its file. The times of files are read only if neither names nor order tell."""
    found = named(images, files, {})
    program = exiftool.installed()
    if not isinstance(found, Refusal) or found.slug != "no-match" or program is None:
        return found
    assert request.images is not None
    try:
        times_us = exiftool.times_us(program, request.images.resolve(), files or ())
    except ExifToolError:
        return found
    return named(images, files, times_us)


def _tag(arguments: Sequence[str], files: int) -> Refusal | None:
    program = exiftool.installed()
    assert program is not None
    try:
        exiftool.write(program, arguments, files)
    except ExifToolError as error:
        help = "each changed file has its original beside it, as `NAME_original`"
        return Refusal("not-tagged", f"ExifTool failed: {visible(str(error))}", help, ExitCode.INPUT)
    return None


def _files(folder: Path) -> Iterator[str]:
    """Yield the names of the images in a folder; links are left out."""
    for each in folder.iterdir():
        if each.suffix.lower() in _IMAGES and each.is_file() and not each.is_symlink():
            yield each.name


def _image_warnings(
    images: FlightImages, placed: Sequence[FlightImage], pairs: Sequence[NamedImage], files: Sequence[str] | None
) -> Iterator[str]:
    """Yield what is missing or left out."""
    if len(placed) < len(images.taken):
        yield f"left out {many(len(images.taken) - len(placed), 'image')} without a place"
    if len(pairs) < len(placed):
        yield f"{many(len(placed) - len(pairs), 'image')} of the log without a file in the folder"
    if files is not None and len(pairs) < len(files):
        yield f"{many(len(files) - len(pairs), 'file')} in the folder without an image in the log"
    if images.lost:
        yield f"{many(images.lost, 'image')} of the flight missing: the log lists which"
    if images.failed:
        yield f"{many(len(images.failed), 'picture')} failed"


def _plan(exported: FlightExport) -> _Made:
    from rtshcua.adapters.vehicle.fence import fence_of
    from rtshcua.adapters.vehicle.flavour import FenceHabits
    from rtshcua.ground.flight.export import qgc_plan
    from rtshcua.mavlink.enums import MAV_FRAME_GLOBAL

    # the autopilot is not known: what each of them would make narrower than the policy is left out
    fence = fence_of(exported.flight.policy, FenceHabits(MAV_FRAME_GLOBAL, all_inclusions=True, switches=()))
    warnings = [f"the fence of the plan leaves out {each}" for each in fence.left_out]
    if home_of(exported.flight).above_sea is None:
        warnings.append("home's height above the sea is not known; the plan says 0 m")
    data, items = qgc_plan.qgc_plan(exported, fence.items)
    return _Made(data, items, qgc_plan.DATUM, tuple(warnings))


def _mcap(exported: FlightExport) -> _Made | Refusal:
    try:
        from rtshcua.ground.flight.export import mcap_file
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "mcap":
            raise
        help = "run `pip install '.[export]'` in the checkout"
        return Refusal("input", f"the package `{error.name}` is required and not installed", help)
    return _Made(mcap_file.mcap_file(exported), len(exported.track), mcap_file.DATUM)


def _tlog(log: Path) -> _Made | Refusal:
    from rtshcua.ground.flight.export.whole_tlog import DATUM, whole_tlog

    with open_regular(log.parent / TELEMETRY) as file:
        whole = whole_tlog(file.read())
    if not whole.frames:
        return Refusal("no-telemetry", f"`{log.parent / TELEMETRY}` has no whole frame", _ONLY_PLAN, ExitCode.INPUT)
    cut = f"the telemetry is damaged: cut after {many(whole.frames, 'frame')}; {many(whole.left_out, 'byte')} left out"
    return _Made(whole.data, whole.frames, DATUM, (cut,) if whole.left_out else ())
