"""`rtshcua run --dry-run`: listen to the vehicle, decide the whole mission against the present, and send no motion."""

import time
from collections.abc import Callable, Sequence

import msgspec
from msgspec import structs

from rtshcua.adapters.clock import LinkClock
from rtshcua.adapters.utc import certain_from_us
from rtshcua.adapters.vehicle.connected import ConnectedVehicle
from rtshcua.app.fly.interrupts import Interrupts
from rtshcua.app.fly.parameters import untold
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.faults import say
from rtshcua.front.cli.showing import words
from rtshcua.front.cli.showing.page import Page, for_terminal
from rtshcua.front.cli.showing.why import would_pass
from rtshcua.front.cli.stdout import out_json, out_rendered
from rtshcua.model.outcome import Outcome
from rtshcua.model.step_number import number_of
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.ports import Event, Readings, Ready
from rtshcua.onboard.rehearsal import Rehearsed, rehearse
from rtshcua.onboard.runtime.monitor import StateMonitor

#: how long the vehicle may take to be ready, in seconds of the machine,
READY_S = 60.0
#: and then for a signal that it has not told yet
TOLD_S = 3.0
#: within which a parameter that it has was told, or was asked for often enough
SETTINGS_S = 8.0
#: how often it is said what is waited for
SAID_S = 5.0

_POLL_S = 0.05


def dry_run(
    loaded: Loaded, vehicle: ConnectedVehicle, clock: LinkClock, interrupts: Interrupts, events: Sequence[Event],
    *, as_json: bool, notes: Sequence[str] = (), refusal: str | None = None, unheard: frozenset[int] = frozenset(),
    sets: Sequence[str] = (), say: Callable[[str], None] = say,
) -> ExitCode:  # fmt: skip
    """Rehearse the mission on the vehicle as it stands. `events` came while it was met.

    `notes` are what a run would tell first, `refusal` why it would not begin at all. `unheard` are the slots that
    nothing can fill on this link, `sets` the parameters that a flight would set, which the vehicle must tell. It is
    judged by the UTC time at which it was asked for, or would begin: the wait here is not the flight's.
    """
    monitor = StateMonitor(loaded.policy)
    asked_us, interrupted = clock.now().utc_us, False
    for note in notes:
        say(f"note: {note}")
    ready, begun_s = False, time.monotonic()
    until_s, said_s, waited = begun_s + READY_S, begun_s, ""
    for name in sets:
        vehicle.driver.settings.read(name)
    while time.monotonic() < until_s:
        if interrupts.wish() is not None:
            interrupted = True
            break
        if not ready and time.monotonic() - said_s >= SAID_S:
            said_s, waits = time.monotonic(), vehicle.driver.unready or "its telemetry"
            if waits != waited:
                waited = waits
                say(f"waiting for the vehicle: {waits}; until {READY_S:.0f} s")
        for event in events:
            if isinstance(event, Readings):
                monitor.update(event)
            elif isinstance(event, Ready):
                ready, until_s = True, max(time.monotonic() + TOLD_S, begun_s + SETTINGS_S if sets else 0)
        now = clock.now()
        monitor.observe(now)
        settled = all(map(vehicle.driver.settings.is_known, sets)) if sets else True
        if ready and settled and None not in monitor.state(now.monotonic_us).values:
            break
        events = vehicle.poll(now.monotonic_us, clock.us_in(_POLL_S))
    now = structs.replace(clock.now(), utc_us=asked_us)
    now = structs.replace(now, utc_us=asked_us + certain_from_us(loaded.issued_us, now) - now.monotonic_us)
    found = rehearse(loaded, monitor.state(now.monotonic_us), now, unheard)
    unready = None if ready else (vehicle.driver.unready or "it did not say that it is")
    flavour = vehicle.driver.flavour if sets and not interrupted else None
    if refusal is None and flavour is not None:
        refusal = untold(sets, vehicle.driver.settings.values, flavour.name)
    would = ready and refusal is None and all(each.hopeful for each in found)
    code = ExitCode.INTERRUPTED if interrupted else ExitCode.OK if would else ExitCode.REFUSED
    if as_json:
        told = {"refusal": refusal, "notes": list(notes), "interrupted": interrupted}
        out_json(msgspec.json.encode(_object(loaded, found, unready, code) | told).decode())
    else:
        page = _page(loaded, found, unready, refusal)
        if interrupted:
            page.text("(interrupted: this is as it stood then)")
        out_rendered(str(page))
    return code


def _page(loaded: Loaded, found: Sequence[Rehearsed], unready: str | None, refusal: str | None) -> Page:
    mission, page = loaded.bundle.mission, for_terminal()
    page.head(f"Rehearsal of {mission.name} on {loaded.vehicle}: nothing is sent, nothing is used up")
    if refusal is not None:
        page.row("would not begin", refusal)
    if unready is not None:
        page.row("not ready", unready)
    for each in found:
        invocation, decision = mission.invocations[each.step], each.decision
        outcome = decision.outcome.name.lower()
        called = words.call(loaded.bundle.policy, invocation)
        page.text(f"{number_of(each.step):>3}  {outcome:<8}  {mission.phases[invocation.phase]:<12}  {called}")
        if decision.outcome is not Outcome.ALLOW:
            quoted = words.quoted(loaded.bundle.policy, invocation, decision.clause)
            clause = f": {quoted}" if quoted else ""
            page.row("because", f"{decision.reason.value}{clause}", indent=7, width=10)
            if each.observing:
                page.row(
                    "waits", "until it was observed for as long as it looks back, from the run on", indent=7, width=10
                )
            page.rows("would pass", [would_pass(one) for one in each.nearest], indent=7, width=10)
    page.text("")
    waits = sum(each.hopeful and each.decision.outcome is not Outcome.ALLOW for each in found)
    admitted = sum(each.decision.outcome is Outcome.ALLOW for each in found)
    others = len(found) - admitted - waits
    page.text(f"{admitted} of {len(found)} steps admitted, {waits} waiting for what will come, {others} would not fly")
    page.text("(a later step is judged where those before it end, with all else as it is now)")
    return page


def _object(loaded: Loaded, found: Sequence[Rehearsed], unready: str | None, code: ExitCode) -> dict[str, object]:
    mission = loaded.bundle.mission
    steps = []
    for each in found:
        invocation, decision = mission.invocations[each.step], each.decision
        steps.append(
            {
                "step": each.step,
                "step_number": number_of(each.step),
                "phase": mission.phases[invocation.phase],
                "text": words.call(loaded.bundle.policy, invocation),
                "outcome": decision.outcome.name.lower(),
                "reason": decision.reason.value,
                "clause": None if decision.clause is None else decision.clause.text,
                "target": None if decision.target is None else decision.target.text,
                "nearest": [one._asdict() for one in each.nearest],
                "hopeful": each.hopeful,
                "observing": each.observing,
            }
        )
    return {
        "event": "rehearsal",
        "mission": mission.name,
        "vehicle": loaded.vehicle,
        "ready": unready is None,
        "unready": unready,
        "steps": steps,
        "exit_code": int(code),
    }
