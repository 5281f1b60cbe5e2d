"""`run --dry-run`: decide all steps of the mission in the vehicle's present state, and send no motion command."""

import time
from collections.abc import Sequence
from typing import NamedTuple

from msgspec import structs

from rtshcua.adapters.utc import certain_from_us
from rtshcua.adapters.vehicle.connected import ConnectedVehicle
from rtshcua.app.fly.connect import Connected, utc_notes
from rtshcua.app.fly.flight_request import FlightContext
from rtshcua.app.fly.setting_notes import untold, would_set
from rtshcua.app.fly.start_boundary import Begun
from rtshcua.app.fly.verify_bundle import not_begun
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.ports import Event, Readings, Ready
from rtshcua.onboard.rehearsal import Rehearsed, rehearse
from rtshcua.onboard.runtime.monitor import StateMonitor

#: the longest wait until the vehicle is ready, in seconds of the machine's time
READY_S = 60.0
#: the longest wait after that for signals without a value, in seconds
SIGNALS_S = 3.0
#: the longest wait for the values of parameters, in seconds
SETTINGS_S = 8.0
#: the interval between two notes about the wait, in seconds
NOTE_S = 5.0

_POLL_S = 0.05


class FlightRehearsal(NamedTuple):
    """The predicted decision of each step. `refusal` is the reason why a flight would not begin, `unready` why the
    vehicle is not ready; `notes` are those of a flight.
    """

    loaded: Loaded
    steps: Sequence[Rehearsed]
    notes: Sequence[str]
    refusal: str | None
    unready: str | None
    interrupted: bool

    @property
    def exit_code(self) -> ExitCode:
        """OK if every step may fly."""
        if self.interrupted:
            return ExitCode.INTERRUPTED
        would = self.unready is None and self.refusal is None and all(each.hopeful for each in self.steps)
        return ExitCode.OK if would else ExitCode.REFUSED


def rehearse_flight(context: FlightContext, begun: Begun, connected: Connected) -> FlightRehearsal:
    """Rehearse the mission in the vehicle's present state. It is judged at the UTC time of the request, without the
    wait here, or at the earliest time at which the flight would begin.
    """
    request, loaded, vehicle, clock = context.request, begun.loaded, connected.vehicle, context.clock
    sets = tuple(request.settings)
    notes = (
        *connected.signing.notes,
        *would_set(request.settings),
        *utc_notes(context, begun.apart, listens=False),
    )
    refusal = not_begun(request, loaded, clock)
    requested_us = clock.now().utc_us
    for note in notes:
        context.console.say(f"note: {note}")
    for name in sets:
        vehicle.driver.settings.read(name)
    monitor = StateMonitor(loaded.policy)
    ready, interrupted = _await_state(context, monitor, vehicle, connected.events, sets)
    now = structs.replace(clock.now(), utc_us=requested_us)
    now = structs.replace(now, utc_us=requested_us + certain_from_us(loaded.issued_us, now) - now.monotonic_us)
    found = rehearse(loaded, monitor.state(now.monotonic_us), now, connected.signing.unheard)
    unready = None if ready else (vehicle.driver.unready or "it did not report that it is ready")
    flavour = vehicle.driver.flavour if sets and not interrupted else None
    if refusal is None and flavour is not None:
        refusal = untold(sets, vehicle.driver.settings.values, flavour.name)
    return FlightRehearsal(loaded, found, notes, refusal, unready, interrupted)


def _await_state(
    context: FlightContext, monitor: StateMonitor, vehicle: ConnectedVehicle, events: Sequence[Event],
    sets: Sequence[str],
) -> tuple[bool, bool]:  # fmt: skip
    """Wait until all signals, and all parameters that a flight would set, have values, or time is over. Return whether
    the vehicle is ready, and whether the user interrupted.
    """
    clock, driver = context.clock, vehicle.driver
    ready, begun_s = False, time.monotonic()
    until_s, noted_s, waited = begun_s + READY_S, begun_s, ""
    while time.monotonic() < until_s:
        if context.interrupts.wish() is not None:
            return ready, True
        if not ready and time.monotonic() - noted_s >= NOTE_S:
            noted_s, waits = time.monotonic(), driver.unready or "its telemetry"
            if waits != waited:
                waited = waits
                context.console.say(f"waiting for the vehicle: {waits}; until {READY_S:.0f} s")
        for event in events:
            if isinstance(event, Readings):
                monitor.update(event)
            elif isinstance(event, Ready):
                ready, until_s = True, max(time.monotonic() + SIGNALS_S, begun_s + SETTINGS_S if sets else 0)
        now = clock.now()
        monitor.observe(now)
        known = all(map(driver.settings.is_known, sets))
        if ready and known and None not in monitor.state(now.monotonic_us).values:
            break
        events = vehicle.poll(now.monotonic_us, clock.us_in(_POLL_S))
    return ready, False
