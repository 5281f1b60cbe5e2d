"""The stage before a flight: that the bundle may fly, or what of it hangs in the air, and where the evidence lies."""

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

_UNVERIFIABLE = ", which has the log's key: nobody can verify this log, its key is drawn for it alone"


class Cleared(NamedTuple):
    """A flight that may begin, or one that goes on: `resumed`, an earlier run of the bundle broke off in the air, and
    it is brought down. `refusal`: nothing flies, but what is owed to the vehicle is put back first. `notes` are told.
    """

    resumed: bool
    refusal: Refusal | None
    session: StartedBoundary
    run: RunFolder
    notes: list[str]


def check_vehicle(context: FlightContext, begun: Begun, connected: Connected) -> Refusal | None:
    """Why nothing of this begins, by the vehicle's time and by what it says it is; a note where it is not qualified.
    What happened meanwhile is added to its events.
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
    """Whether it may fly, and where its evidence lies; what is in the air comes down without most of that. Raises
    OSError.
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
    alone = "" if begun.absent is None else f"{begun.why_absent}; it is brought down without a boundary of its own"
    alone += _UNVERIFIABLE if alone and request.boundary_socket is not None else ""
    return Cleared(
        resumed, refusal, session, run, [alone, "" if resumed else hanging(previous, loaded), settled, moved]
    )


def notes_before(
    context: FlightContext, begun: Begun, connected: Connected, cleared: Cleared, previous: LogBefore
) -> list[str]:
    """What there is to tell of a flight once its log has begun."""
    unsigned = begun.own_key.text if isinstance(begun.own_key, Refusal) else UNNAMED if begun.own_key is None else ""
    once = filter(None, dict.fromkeys([*cleared.notes, previous.note, unsigned, cleared.session.note]))
    listens = context.request.boundary_socket is not None
    return [*connected.signing.notes, *once, *utc_notes(context, begun.apart, listens=listens)]


def bundle_lapsed(context: FlightContext, begun: Begun) -> Refusal | None:
    """Why the bundle that flies is not to be trusted by the time that the clock has now."""
    return lapsed(begun.bundle, begun.trusted.signed, begun.log_key.kid, begun.loaded, context.clock)


def hanging(previous: LogBefore | None, loaded: Loaded) -> str:
    """What brings down what the flight before may have left in the air; nothing where it ended."""
    if previous is None or previous.broken_off is None:
        return ""
    if previous.gone:
        return previous.note
    way = f"`rtshcua run {previous.broken_off / BUNDLE}` brings down what hangs in the air"
    return f"the flight of `{loaded.vehicle}` before broke off: {way}"


def timestamps_lost(signing: LinkSigning, *, resumed: bool) -> Refusal | None:
    """What keeps the link's timestamps from being known or kept keeps a vehicle on the ground, and none in the air.
    Raises OSError.
    """
    error = signing.damage
    if error is None:
        return None
    if resumed:
        reason = str(error) if isinstance(error, LinkKeyError) else words_of(error)
        signing.notes.append(f"{reason}; it is brought down all the same. The link needs a new key then")
        return None
    if isinstance(error, LinkKeyError):
        return of_link_key(error)
    raise error


def revoked_link_key(signing: LinkSigning, root: TrustRoot, *, resumed: bool) -> Refusal | None:
    """That the trust root revokes the link's key, which keeps a vehicle on the ground, and none in the air."""
    if signing.name is None or signing.name not in root.revocations:
        return None
    text = f"the trust root revokes the link's key {signing.name.hex()}"
    if not resumed:
        help = "a new key on both ends; `rtshcua keys link`"
        return Refusal("link-key-revoked", text, help, ExitCode.UNTRUSTED)
    signing.notes.append(f"{text}; it is brought down all the same")
    return None


def run_folder(context: FlightContext, loaded: Loaded, bundle: bytes, *, resumed: bool) -> tuple[RunFolder, str]:
    """Where the evidence of this run lies, and what there is to tell of it. What comes down keeps it in a temporary
    folder where it cannot lie among the others. Raises OSError.
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
        return other, f"`{request.runs}` takes no run ({error.strerror or error}): the log is in `{other.path}`"


def _name(request: FlightRequest, loaded: Loaded) -> str:
    """What is handed in has no name of a file."""
    return request.bundle.stem if request.wait_s is None else loaded.bundle.mission.name


def _opened(context: FlightContext, loaded: Loaded, vehicle: ConnectedVehicle, events: list[Event]) -> bool | Refusal:
    """Whether an earlier run of the bundle broke off in the air; why it does not open. Raises OSError."""
    resumed = broke_off(context.request.kept_in, loaded, vehicle, context.clock, events)
    return resumed or expired(loaded, context.clock.now()) or False


def _not_obeyed(context: FlightContext, begun: Begun, vehicle: ConnectedVehicle, events: list[Event]) -> Refusal | None:
    """A vehicle in the air that obeys nothing unsigned is not waited for where a boundary listens that has the key, and
    does not serve: waiting would not begin it.
    """
    listens, loaded = context.request.boundary_socket, begun.loaded
    if listens is None or isinstance(loaded.executor, IsolatedExecutor) or obeys(vehicle, context.clock, events):
        return None
    why = begun.why_absent or "it does not serve this run"
    text = f"`{loaded.vehicle}` is in the air and answers nothing that is not signed; the boundary at `{listens}` has "
    help = "begin this run again once the boundary serves, as systemd does; until then the pilot brings it down, or its"
    return Refusal("not-obeyed", f"{text}the key: {why}", f"{help} own failsafe for a lost link", ExitCode.REFUSED)
