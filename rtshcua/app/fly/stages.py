"""A flight from its request to its end: verify, start the boundary, connect, check before flight, fly, close.

Each stage takes the result of the previous stage and returns its own. After a refusal the flight does not begin.
Resources that a stage opened are closed at the end of the flight in every case.
"""

import gc
from collections.abc import Iterable
from contextlib import ExitStack
from typing import TYPE_CHECKING, NamedTuple

from rtshcua.adapters.boundary.process import ListeningBoundary
from rtshcua.adapters.store.reading import open_regular
from rtshcua.adapters.store.runs import LOG
from rtshcua.adapters.store.vehicle_records import OwedParameters
from rtshcua.adapters.vehicle.transport import Transport
from rtshcua.app.fly.clearance import check_vehicle, clear_for_flight, hanging, notes_before
from rtshcua.app.fly.connect import Connected, connect
from rtshcua.app.fly.dry_run import FlightRehearsal, rehearse_flight
from rtshcua.app.fly.flight_request import FlightContext, FlightRequest, open_context
from rtshcua.app.fly.flight_session import FlightSession
from rtshcua.app.fly.previous_log import LogBefore
from rtshcua.app.fly.replay_check import expired, give_back, mark_opened
from rtshcua.app.fly.start_boundary import Begun, connect_boundary, start_boundary
from rtshcua.app.fly.stop_wishes import breakable
from rtshcua.app.fly.story import Note, Summary
from rtshcua.app.fly.verify_bundle import Verified, may_have_flown, read_bundle, verify
from rtshcua.app.fly.view_ports import Console, LiveView
from rtshcua.app.fly.waiting import await_mission
from rtshcua.app.fly.witnesses import FlightWitnesses, find_witnesses
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.onboard.enforcement.preparation import PreparationIssuer
from rtshcua.onboard.ports import Ending

if TYPE_CHECKING:
    from rtshcua.app.fly.incidents import Incidents


class FinishedFlight(NamedTuple):
    """A finished flight: its exit code, summary, view and connection."""

    code: ExitCode
    summary: Summary
    view: LiveView
    connected: Connected


def fly(
    request: FlightRequest, console: Console, transport: Transport | None = None
) -> ExitCode | FlightRehearsal | Refusal:
    """Fly, and show the end; return the exit code, or the result of a rehearsal. `transport`: a link that is already
    open. Raises OSError for files that cannot be read or written.
    """
    if request.boundary_socket is None:
        return _fly(open_context(request, console, transport=transport))
    listening = connect_boundary(request.boundary_socket, paced=request.speed != 1)
    try:  # without it, a vehicle in the air is still brought down
        return _fly(open_context(request, console, listening, transport))
    finally:
        if isinstance(listening, ListeningBoundary):
            listening.close()


def _fly(context: FlightContext) -> ExitCode | FlightRehearsal | Refusal:
    request, root = context.request, read_bundle(context.request.bundle)
    if isinstance(root, Refusal):
        return root
    verified = verify(context, root)
    if isinstance(verified, Refusal):
        return verified
    keys = verified.trusted.root.witnesses(verified.loaded.vehicle, context.clock.now().utc_us)
    witnesses = find_witnesses(request.witnesses, keys)
    if isinstance(witnesses, Refusal):
        return witnesses
    previous = None
    if not request.dry_run:
        log_key = verified.log_key.key() if request.boundary_socket is None else None
        previous = LogBefore.settle(request.kept_in, verified.loaded.vehicle, log_key)
        del log_key
    with ExitStack() as view:  # the view may outlast all other resources
        view.enter_context(breakable())
        with context.resources:
            ended = _stages(context, verified, previous, witnesses, view)
        if isinstance(ended, Refusal):  # the refusal also says what may still be in the air
            help = "; ".join(filter(None, (ended.help, hanging(previous, verified.loaded))))
            return ended._replace(help=help)
        if isinstance(ended, FlightRehearsal):
            return ended
        trouble = ended.connected.signing.trouble
        if trouble is not None:
            ended.view.post(Note(trouble))
        ended.view.post(ended.summary)
    return ended.code if ended.view.shown or ended.code is not ExitCode.OK else ExitCode.FULL


def _stages(
    context: FlightContext, verified: Verified, previous: LogBefore | None, witnesses: FlightWitnesses,
    view: ExitStack,
) -> FinishedFlight | FlightRehearsal | Refusal:  # fmt: skip
    request, loaded = context.request, verified.loaded
    context.resources.enter_context(context.interrupts)
    sets = None if request.dry_run else bool(request.settings)
    debts = OwedParameters(request.kept_in, loaded.vehicle, sets=sets)
    context.resources.callback(debts.close)
    refusal = _too_old(context, verified, owes=bool(debts.left))
    if refusal is not None:
        return refusal
    begun = start_boundary(context, verified, previous, debts.left)
    if not isinstance(begun, Refusal) and begun.apart is not None:  # use the boundary's time of day here too
        context.utc.follow(begun.apart.time)
    if not isinstance(begun, Refusal) and request.wait_s is not None:
        begun = await_mission(context, begun, previous)
    if isinstance(begun, Refusal):
        return begun
    if isinstance(begun.loaded.preparation, PreparationIssuer):  # a boundary process received them at its start
        begun.loaded.preparation.owes(debts.left)
    connected = connect(context, begun, previous, debts)
    if isinstance(connected, Refusal):
        return connected
    refusal = check_vehicle(context, begun, connected)
    if refusal is not None:
        return refusal
    if previous is None:
        return rehearse_flight(context, begun, connected)
    return _flown(context, begun, connected, previous, debts, witnesses, view)


def _too_old(context: FlightContext, verified: Verified, *, owes: bool) -> Refusal | None:
    """The refusal if the mission is already too old, before anything starts. Not if the vehicle may be in the air or is
    owed parameters. With `--wait` the mission does not count.
    """
    request, loaded = context.request, verified.loaded
    decides = request.wait_s is None and (request.link is None or not (owes or may_have_flown(request, loaded)))
    return expired(loaded, context.clock.now()) if decides else None


def _flown(
    context: FlightContext, begun: Begun, connected: Connected, previous: LogBefore, debts: OwedParameters,
    witnesses: FlightWitnesses, views: ExitStack,
) -> FinishedFlight | Refusal:  # fmt: skip
    """Check before flight, fly, and close."""
    request, loaded, clock = context.request, begun.loaded, context.clock
    cleared = clear_for_flight(context, begun, connected, previous, debts)
    if isinstance(cleared, Refusal):
        return cleared
    view = views.enter_context(context.console.view())
    session = FlightSession(context, begun, connected, cleared, previous, debts, witnesses, view)
    refusal = session.begin()
    if refusal is not None:
        return refusal
    if cleared.refusal is not None:
        session.settle()
        return cleared.refusal
    if not cleared.resumed:
        refusal = mark_opened(request.kept_in, loaded, clock, session)
        if refusal is not None:
            return refusal
    for note in notes_before(context, begun, connected, cleared, previous):
        view.post(Note(note))
    _freeze_loaded_objects(hurried=cleared.resumed)
    code, summary = session.fly()
    if request.sortie is not None:
        ending = Ending(summary.ending)
        request.sortie.after(connected.vehicle, clock, context.interrupts, ending, session.final_hash)
    kept = None if cleared.resumed else give_back(request.kept_in, loaded, session, clock.now())
    if kept is not None:
        view.post(Note(kept))
    if request.incidents is not None:
        with open_regular(cleared.run.path / LOG) as log:
            code = _report_scenario(request.incidents, Ending(summary.ending), code, log, view)
    return FinishedFlight(code, summary, view, connected)


def _freeze_loaded_objects(*, hurried: bool) -> None:
    """Freeze loaded objects, so that the garbage collector skips them during the flight. `hurried`: do not collect
    first, which takes 30 ms.
    """
    if not hurried:
        gc.collect()
    gc.freeze()


def _report_scenario(
    incidents: "Incidents", ending: Ending, code: ExitCode, lines: Iterable[bytes], view: LiveView
) -> ExitCode:
    """Report the results of the scenario; return the exit code."""
    for text in incidents.happened:
        view.post(Note(f"the scenario: {text}"))
    met = incidents.met(ending, list(lines))
    for each in met:
        view.post(Note(f"{'met' if each.met else 'NOT MET'}: {each.expectation.text}: {each.found}"))
    left = len(incidents.scenario.expectations) - len(met)
    if left:
        text = (
            f"{left} more expectations can be checked only by `rtshcua test`, which knows the vehicle's true position"
        )
        view.post(Note(text))
    return code if all(each.met for each in met) else ExitCode.TESTS
