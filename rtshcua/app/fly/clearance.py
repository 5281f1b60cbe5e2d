"""The stage before a flight: check that the bundle may fly or must be brought down, and create the run folder."""

import secrets
from pathlib import Path
from tempfile import gettempdir
from typing import NamedTuple

from rtshcua.adapters.store.runs import BUNDLE, RunFolder
from rtshcua.adapters.store.signing import LinkKeyError
from rtshcua.adapters.store.vehicle_records import BoundaryStore, OwedParameters
from rtshcua.adapters.store.writing import PRIVATE_FOLDER, make_folder
from rtshcua.adapters.vehicle.connected import ConnectedVehicle
from rtshcua.app.exit_codes import words_of
from rtshcua.app.fly.connect import Connected, record_of, unqualified, utc_notes
from rtshcua.app.fly.flight_request import FlightContext, FlightRequest
from rtshcua.app.fly.link_signing import LinkSigning
from rtshcua.app.fly.previous_log import LogBefore
from rtshcua.app.fly.replay_check import broke_off, expired, obeys
from rtshcua.app.fly.start_boundary import UNNAMED, Begun, StartedBoundary, of_link_key
from rtshcua.app.fly.verify_bundle import lapsed
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.onboard.enforcement.isolated import IsolatedExecutor
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.ports import Event
from rtshcua.wire.trust import TrustRoot

_UNVERIFIABLE = ", which has the log's key: the log is signed with a key drawn for it alone, so nobody can verify it"


class Cleared(NamedTuple):
    """A flight that may begin. `resumed`: an earlier run of the bundle broke off in the air, and the vehicle is only
    brought down. `refusal`: nothing flies, but owed parameters are restored first. `notes` are for the user.
    """

    resumed: bool
    refusal: Refusal | None
    session: StartedBoundary
    run: RunFolder
    notes: list[str]


def check_vehicle(context: FlightContext, begun: Begun, connected: Connected) -> Refusal | None:
    """The refusal if the bundle has expired by the vehicle's time, or a qualification may not begin. Adds a note if the
    vehicle is not qualified, and the events meanwhile.
    """
    request = context.request
    late = bundle_lapsed(context, begun)
    if late is not None and (request.dry_run or request.sortie is not None):
        return late
    if request.sortie is not None:
        meanwhile = request.sortie.before(connected.vehicle, context.clock)
        if isinstance(meanwhile, Refusal):
            return meanwhile
        connected.events.extend(meanwhile)
    elif request.link is not None:
        record = record_of(begun.loaded.vehicle, begun.trusted.root, context.clock.now().utc_us, request.data)
        note, meanwhile = unqualified(record, connected.vehicle, context.clock)
        connected.events.extend(meanwhile)
        connected.signing.notes += [note] if note is not None else []
    return None


def clear_for_flight(
    context: FlightContext, begun: Begun, connected: Connected, previous: LogBefore, debts: OwedParameters
) -> Cleared | Refusal:
    """Check that the flight may begin, and create its run folder. Most checks are skipped for a vehicle that must come
    down. Raises OSError.
    """
    request, loaded, vehicle, signing = context.request, begun.loaded, connected.vehicle, connected.signing
    opened = _opened(context, loaded, vehicle, connected.events)
    resumed, refusal = (False, opened) if isinstance(opened, Refusal) else (opened, None)
    if refusal is not None and not debts.left:
        return refusal
    problem = (
        _not_obeyed(context, begun, vehicle, connected.events) if resumed else bundle_lapsed(context, begun)
    ) or (timestamps_lost(signing, resumed=resumed) or revoked_link_key(signing, begun.trusted.root, resumed=resumed))
    if problem is None and not resumed:
        problem = begun.boundary_refusal() or (begun.own_key if isinstance(begun.own_key, Refusal) else None)
    if problem is not None:
        return problem
    own_key = None if isinstance(begun.own_key, Refusal) else begun.own_key
    session = StartedBoundary.open(BoundaryStore(request.kept_in, loaded.vehicle), own_key, aloft=resumed)
    if isinstance(session, Refusal):
        return session
    settled = begun.trusted.settle(resumed=resumed)
    if isinstance(settled, Refusal):
        return settled
    run, moved = run_folder(context, loaded, begun.bundle, resumed=resumed)
    alone = "" if begun.absent is None else f"{begun.why_absent}; the vehicle is brought down without its boundary"
    alone += _UNVERIFIABLE if alone and request.boundary_socket is not None else ""
    return Cleared(
        resumed, refusal, session, run, [alone, "" if resumed else hanging(previous, loaded), settled, moved]
    )


def notes_before(
    context: FlightContext, begun: Begun, connected: Connected, cleared: Cleared, previous: LogBefore
) -> list[str]:
    """The notes for the user at the beginning of a flight."""
    unsigned = begun.own_key.text if isinstance(begun.own_key, Refusal) else UNNAMED if begun.own_key is None else ""
    once = filter(None, dict.fromkeys([*cleared.notes, previous.note, unsigned, cleared.session.note]))
    listens = context.request.boundary_socket is not None
    return [*connected.signing.notes, *once, *utc_notes(context, begun.apart, listens=listens)]


def bundle_lapsed(context: FlightContext, begun: Begun) -> Refusal | None:
    """The refusal if the bundle is no longer valid at the clock's present time."""
    return lapsed(begun.bundle, begun.trusted.signed, begun.log_key.kid, begun.loaded, context.clock)


def hanging(previous: LogBefore | None, loaded: Loaded) -> str:
    """The note how to bring the vehicle down if the previous flight broke off; empty if that flight ended."""
    if previous is None or previous.broken_off is None:
        return ""
    if previous.gone:
        return previous.note
    way = f"`rtshcua run {previous.broken_off / BUNDLE}` brings the vehicle down if it is still in the air"
    return f"the previous flight of `{loaded.vehicle}` broke off: {way}"


def timestamps_lost(signing: LinkSigning, *, resumed: bool) -> Refusal | None:
    """The refusal if the link's timestamps cannot be read or stored; only a note for a vehicle in the air. Raises
    OSError.
    """
    error = signing.damage
    if error is None:
        return None
    if resumed:
        reason = str(error) if isinstance(error, LinkKeyError) else words_of(error)
        signing.notes.append(f"{reason}; the vehicle is brought down anyway. Then the link needs a new key")
        return None
    if isinstance(error, LinkKeyError):
        return of_link_key(error)
    raise error


def revoked_link_key(signing: LinkSigning, root: TrustRoot, *, resumed: bool) -> Refusal | None:
    """The refusal if the trust root revokes the link's key; only a note for a vehicle in the air."""
    if signing.name is None or signing.name not in root.revocations:
        return None
    text = f"the trust root revokes the link's key {signing.name.hex()}"
    if not resumed:
        help = "put a new key on both ends with `rtshcua keys link`"
        return Refusal("link-key-revoked", text, help, ExitCode.UNTRUSTED)
    signing.notes.append(f"{text}; the vehicle is brought down anyway")
    return None


def run_folder(context: FlightContext, loaded: Loaded, bundle: bytes, *, resumed: bool) -> tuple[RunFolder, str]:
    """Create the run folder; return it with a note for the user. If that fails for a vehicle in the air, use a
    temporary folder. Raises OSError.
    """
    request, utc_us = context.request, context.clock.now().utc_us
    name = _name(request, loaded)
    try:
        return RunFolder(request.runs, name=name, bundle=bundle, utc_us=utc_us), ""
    except OSError as error:
        if not resumed:
            raise
        fresh = Path(gettempdir(), f"rtshcua-runs-{secrets.token_hex(8)}")
        make_folder(fresh, mode=PRIVATE_FOLDER)
        other = RunFolder(fresh, name=name, bundle=bundle, utc_us=utc_us)
        return other, f"cannot write to `{request.runs}` ({error.strerror or error}): the log is in `{other.path}`"


def _name(request: FlightRequest, loaded: Loaded) -> str:
    """The run's name: the name of the bundle's file, or of the mission if the bundle was handed in."""
    return request.bundle.stem if request.wait_s is None else loaded.bundle.mission.name


def _opened(context: FlightContext, loaded: Loaded, vehicle: ConnectedVehicle, events: list[Event]) -> bool | Refusal:
    """Whether an earlier run of the bundle broke off in the air; a refusal if the bundle cannot fly. Raises OSError."""
    resumed = broke_off(context.request.kept_in, loaded, vehicle, context.clock, events)
    return resumed or expired(loaded, context.clock.now()) or False


def _not_obeyed(context: FlightContext, begun: Begun, vehicle: ConnectedVehicle, events: list[Event]) -> Refusal | None:
    """The refusal if the vehicle in the air accepts signed messages only, and the listening boundary that has the key
    does not serve this run. Waiting would not help.
    """
    listens, loaded = context.request.boundary_socket, begun.loaded
    if listens is None or isinstance(loaded.executor, IsolatedExecutor) or obeys(vehicle, context.clock, events):
        return None
    why = begun.why_absent or "it does not serve this run"
    text = f"`{loaded.vehicle}` is in the air and answers signed messages only; the boundary at `{listens}` has "
    help = "run the command again once the boundary serves, as systemd does; until then the pilot lands it, or its"
    return Refusal("not-obeyed", f"{text}the key: {why}", f"{help} own failsafe for a lost link", ExitCode.REFUSED)
