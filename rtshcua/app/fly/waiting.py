"""`rtshcua run --wait`: connect to the vehicle and wait until a bundle is handed in.

The bundle on the command line names the policy and the vehicle; its mission does not fly. A bundle that is handed in at
a socket is admitted if `run` would accept it. A recall ends the wait. During the wait no motion command is sent, and
the geofence is not changed.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import msgspec

from rtshcua.adapters.clock import LinkClock
from rtshcua.adapters.store.reading import read_regular
from rtshcua.adapters.store.runs import BUNDLE
from rtshcua.adapters.utc import UtcWatch
from rtshcua.adapters.vehicle.connected import ConnectedVehicle
from rtshcua.adapters.vehicle.transport import UdpTransport
from rtshcua.app.fly.agents import Agents
from rtshcua.app.fly.connect import (
    await_heartbeat,
    make_driver,
    open_agents,
    open_link,
    record_of,
    sign_link,
    start_simulator,
    stranded_signal,
    too_slow,
    unqualified,
)
from rtshcua.app.fly.flight_request import FlightContext
from rtshcua.app.fly.link_signing import LinkSigning
from rtshcua.app.fly.previous_log import LogBefore
from rtshcua.app.fly.replay_check import expired, not_opened, still_flies
from rtshcua.app.fly.start_boundary import KEYLESS, Begun, BoundaryClient, own_key_of
from rtshcua.app.fly.stop_wishes import Interrupts
from rtshcua.app.fly.vehicle_trust import Trusted
from rtshcua.app.fly.verify_bundle import Verified, lapsed, load_bundle, local_log_key, verify
from rtshcua.app.fly.view_ports import Console
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.onboard.enforcement.isolated import IsolatedExecutor
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.ports import Event, Presented, Readings
from rtshcua.onboard.runtime.monitor import StateMonitor
from rtshcua.onboard.runtime.seen import value_in_words
from rtshcua.wire import names
from rtshcua.wire.bundle import MAX_BUNDLE
from rtshcua.wire.document import kind_of
from rtshcua.wire.receipt import Receipt, decode
from rtshcua.wire.untrusted import Untrusted

#: the interval between two reports of the vehicle's state to the sockets, in seconds
REPORT_S: Final = 1.0
#: the least time between two refusals that are shown, in seconds: a client may hand in hundreds of documents
REFUSAL_S: Final = 1.0
#: the text that ground stations on the link show
ANNOUNCED: Final = "waits for a mission"

_INFO: Final = 6  # MAV_SEVERITY_INFO
_POLL_S: Final = 0.05
_ADMITTED: Final = "admitted: the flight begins, and each step is decided before it is sent"
_NOTHING_FLIES: Final = "no mission is in force yet: hand in a bundle first"

_encode = msgspec.json.Encoder().encode


class Admitted(NamedTuple):
    """The bundle that flies: its octets and its loaded form."""

    data: bytes
    loaded: Loaded


class MissionWait:
    """One wait. `admit` loads a bundle or refuses it. `superseded` and `lost` return a refusal once no bundle can fly.
    `most_s` is the longest wait, in seconds; `notes` are shown first.
    """

    def __init__(
        self, base: Loaded, admit: Callable[[bytes], Loaded | Refusal], superseded: Callable[[], Refusal | None],
        lost: Callable[[], Refusal | None], vehicle: ConnectedVehicle, clock: LinkClock, utc: UtcWatch,
        interrupts: Interrupts, agents: Agents, *,
        console: Console, most_s: float, notes: Sequence[str] = (),
    ) -> None:  # fmt: skip
        self._base = base
        self._admit = admit
        self._superseded, self._lost = superseded, lost
        self._vehicle = vehicle
        self._clock = clock
        self._utc = utc
        self._interrupts = interrupts
        self._agents = agents
        self._most_s = most_s
        self._console = console
        self._notes = notes
        self._monitor = StateMonitor(base.policy)
        self._refused = 0
        self._refused_s = -REFUSAL_S

    def follow(self, events: Sequence[Event]) -> Admitted | Refusal:
        """Wait until a bundle is admitted. `events` are those received while connecting."""
        policy = self._base.bundle.policy
        begun_s = time.monotonic()
        reported_s, unready = begun_s - REPORT_S, ""
        text = (
            f"{self._base.vehicle} waits under {policy.name}@{policy.version}: nothing flies until a bundle is "
            f"handed in"
        )
        for note in self._notes:
            self._report("note", f"note: {note}")
        self._report("waiting", f"{text}; Ctrl-C or a recall ends the wait", vehicle=self._base.vehicle)
        self._vehicle.announce(_INFO, ANNOUNCED)
        while True:
            if self._interrupts.wish() is not None:
                return _ended("interrupted", "interrupted while waiting: nothing was flown", ExitCode.INTERRUPTED)
            now_s = time.monotonic()
            if now_s - begun_s >= self._most_s:
                text = f"no bundle was admitted within {self._most_s:g} s: nothing was flown"
                return _ended("nothing-handed-in", text, ExitCode.REFUSED)
            for event in events:
                if isinstance(event, Readings):
                    self._monitor.update(event)
            if now_s - reported_s >= REPORT_S:
                over = self._superseded() or self._lost()
                if over is not None:
                    return over
                reported_s, before, unready = now_s, unready, self._vehicle.driver.unready or ""
                if unready != before:
                    self._report("vehicle", f"not ready yet: {unready}" if unready else "the vehicle is ready")
                self._look_at_utc()
                self._agents.tell(self._state(unready))
            admitted = self._handed_in()
            if admitted is not None:
                return admitted
            events = self._vehicle.poll(self._clock.now().monotonic_us, self._clock.us_in(_POLL_S))

    def _look_at_utc(self) -> None:
        """Take the vehicle's time of day, if it is needed: whoever hands in a bundle dates it by that time."""
        driver, now = self._vehicle.driver, self._clock.now()
        if driver.flavour is not None and self._utc.look(driver.source, driver.flavour.name, now.monotonic_us):
            driver.asks_utc = False

    def _handed_in(self) -> Admitted | Refusal | None:
        found = self._agents.events(self._clock.now())
        self._agents.pass_on(self._vehicle.pass_on)
        for text in self._agents.notes():
            self._console.say(f"note: {text}")
        for number, event in enumerate(found):
            if isinstance(event, Presented):
                admitted = self._take(event)
                if isinstance(admitted, Admitted):
                    self._agents.fly(admitted.loaded, found[number + 1 :])
                if admitted is not None:
                    return admitted
        return None

    def _take(self, event: Presented) -> Admitted | Refusal | None:
        kind = _kind_of(event.document)
        if kind is names.RECALL:
            receipt = decode(self._base.boundary.present(event.document, self._clock.now(), 0))
            assert isinstance(receipt, Receipt)
            self._agents.answer(event.sender, receipt.slug, receipt.text)
            if receipt.accepted:
                return _ended("recalled", "recalled while waiting: nothing was flown", ExitCode.ABORTED)
            self._refusal(receipt.slug, receipt.text)
            return None
        over = None if kind is not None else self._superseded()
        if over is not None:
            return over
        outcome = Refusal("not-flying", _NOTHING_FLIES) if kind is not None else self._admit(event.document)
        if isinstance(outcome, Refusal):
            self._agents.answer(event.sender, outcome.slug, outcome.text)
            self._refusal(outcome.slug, outcome.text)
            return None
        self._agents.answer(event.sender, "accepted", _ADMITTED)
        mission = outcome.bundle.mission.name
        self._report("admitted", f"`{mission}` was handed in and admitted", mission=mission)
        return Admitted(event.document, outcome)

    def _refusal(self, slug: str, text: str) -> None:
        """Show a refusal, at most once in `REFUSAL_S`."""
        self._refused += 1
        now_s = time.monotonic()
        if now_s - self._refused_s >= REFUSAL_S:
            self._refused_s = now_s
            self._report("not-admitted", f"refused the document: {text} ({slug})", slug=slug, refused=self._refused)

    def _state(self, unready: str) -> bytes:
        """The JSON line for the sockets: why the vehicle is not ready, and every signal with its age."""
        seen, now = self._vehicle.driver.seen, self._clock.now()
        state, current = self._monitor.state(now.monotonic_us), self._monitor.current(now.monotonic_us)
        signals = [
            {
                "name": signal.name,
                "value": value_in_words(signal, state),
                "age_us": max(state.ages[slot] for slot in signal.slots),
                "stale": not current.issuperset(signal.slots),
            }
            for signal in self._base.bundle.policy.signals
        ]
        report = {
            "type": "vehicle",
            "at_us": now.monotonic_us,
            "utc_us": now.utc_us,
            "utc_error_us": now.utc_error_us,
            "ready": not unready,
            "unready": unready or None,
            "armed": bool(seen.armed),
            "airborne": bool(seen.airborne),
            "signals": signals,
        }
        return _encode(report) + b"\n"

    def _report(self, event: str, text: str, **more: object) -> None:
        """Report an event: as a line of text, or as a JSON object."""
        if self._console.as_json:
            self._console.emit({"event": event, "text": text} | more)
        else:
            self._console.say(text)


def _ended(slug: str, text: str, code: ExitCode) -> Refusal:
    return Refusal(slug, text, "", code)


def _kind_of(data: bytes) -> names.Artefact | None:
    """The kind of document in `data`; None if it is not a document."""
    try:
        return kind_of(data)
    except Untrusted:
        return None


# ---------------------------------------------------------------- the stage


def await_mission(context: FlightContext, begun: Begun, previous: LogBefore | None) -> Begun | Refusal:
    """Connect and wait for the bundle that flies. If the previous flight broke off in the air, return its bundle
    without a wait. Raises OSError.
    """
    transport = open_link(context)
    if isinstance(transport, Refusal):
        return transport
    context.resources.callback(transport.close)
    if isinstance(transport, UdpTransport) and context.request.link is None:
        simulator = start_simulator(context, begun.loaded, transport.port)
        if isinstance(simulator, Refusal):
            return simulator
    agents = open_agents(context, begun.loaded, waits=True)
    assert agents is not None  # the command line asks for one
    signing = sign_link(context, begun.loaded, begun.apart)
    if isinstance(signing, Refusal):
        return signing
    try:
        waited = _wait(context, begun._replace(transport=transport, agents=agents), agents, signing, previous)
    finally:
        signing.close()
    if isinstance(waited, Refusal):
        return waited
    if waited.trusted is not begun.trusted and not isinstance(waited.loaded.executor, IsolatedExecutor):
        own_key = own_key_of(context, waited.trusted.root, waited.loaded) if context.listening is None else KEYLESS
        return waited._replace(own_key=own_key)
    return waited


def _wait(
    context: FlightContext, begun: Begun, agents: Agents, signing: LinkSigning, previous: LogBefore | None
) -> Begun | Refusal:
    request, base, trusted, apart = context.request, begun.loaded, begun.trusted, begun.apart
    driver = make_driver(context, base, signing, fence=False, waits=True)
    if isinstance(driver, Refusal):
        return driver
    assert begun.transport is not None
    assert request.wait_s is not None
    vehicle = ConnectedVehicle(begun.transport, driver, context.clock, lambda at_us, frame: None)
    slow = too_slow(driver)
    if slow is not None:
        return slow
    hurried = previous is not None and previous.broken_off is not None
    events = await_heartbeat(context, vehicle, signing, hurried=hurried)
    if isinstance(events, Refusal):
        return events
    unfinished = None if previous is None else broken_off(context, previous, base, vehicle, events)
    if isinstance(unfinished, Refusal):
        return unfinished
    if unfinished is not None:
        return _bring_down(context, begun, unfinished, agents)
    refusal = trusted.distrust or begun.boundary_refusal()  # enough to bring a vehicle down, not for a new flight
    if refusal is not None:
        return refusal
    notes = list(signing.notes)
    if request.link is not None:
        record = record_of(base.vehicle, trusted.root, context.clock.now().utc_us, request.data)
        note, meanwhile = unqualified(record, vehicle, context.clock)
        events += meanwhile
        notes += [note] if note is not None else []

    def admit(data: bytes) -> Loaded | Refusal:
        return admit_bundle(context, data, base, trusted, begun.log_key.kid, signing, apart)

    def lost() -> Refusal | None:
        return None if apart is None else apart.lost()

    driver.asks_utc, driver.asks_back = context.utc.vehicle_may_tell, context.utc.question
    wait = MissionWait(
        base, admit, trusted.superseded, lost, vehicle, context.clock, context.utc, context.interrupts, agents,
        console=context.console, most_s=request.wait_s, notes=notes,
    )  # fmt: skip
    admitted = wait.follow(events)
    if isinstance(admitted, Refusal):
        return admitted
    return begun._replace(bundle=admitted.data, loaded=admitted.loaded)


def _bring_down(context: FlightContext, begun: Begun, unfinished: Verified, agents: Agents) -> Begun:
    """The bundle of a flight that broke off in the air, loaded by the boundary, or in this process if it refuses."""
    same_root = unfinished.trusted.root == begun.trusted.root and unfinished.trusted.distrust is None
    apart = begun.apart if same_root or context.listening is not None else None
    loaded = unfinished.loaded if apart is None else apart.load(unfinished.bundle, context.clock.now())
    if isinstance(loaded, Refusal):
        context.console.say(f"note: {loaded.text}; the vehicle is brought down anyway")
        loaded = unfinished.loaded
    if not isinstance(loaded.executor, IsolatedExecutor):
        begun.log_key.use(local_log_key(context))
    agents.fly(loaded)
    return begun._replace(bundle=unfinished.bundle, loaded=loaded, trusted=unfinished.trusted)


def broken_off(
    context: FlightContext, previous: LogBefore, base: Loaded, vehicle: ConnectedVehicle, events: list[Event]
) -> Verified | Refusal | None:
    """The verified bundle of the previous flight, if that flight did not end and the vehicle is still in the air. It
    is then brought down, as by `run` with the same bundle. None if the bundle expired more than `endurance_us` ago: no
    charge lasts that long, so another operator flies the vehicle.

    Raises OSError if the bundle cannot be read.
    """
    if previous.broken_off is None or not still_flies(vehicle, context.clock, events):
        return None
    data = read_regular(previous.broken_off / BUNDLE, MAX_BUNDLE)
    request = replace(context.request, wait_s=None)
    verified = verify(context._replace(request=request), data, base.in_force.flight)
    if isinstance(verified, Refusal):
        return verified
    loaded = verified.loaded
    landed = context.clock.now().utc_us > loaded.expires_us + loaded.bundle.policy.vehicle.endurance_us
    return None if landed or not_opened(request.kept_in, loaded) is None else verified


def admit_bundle(
    context: FlightContext, data: bytes, base: Loaded, trusted: Trusted, log_key: bytes, signing: LinkSigning,
    apart: BoundaryClient | None = None,
) -> Loaded | Refusal:  # fmt: skip
    """Load a bundle that was handed in. It must pass the checks of `run`, have the policy of `base`, and be accepted by
    the boundary. It flies under the flight id of `base`, which the sockets have announced.
    """
    loaded = load_bundle(context.request, data, trusted.root, context.clock.now(), base.in_force.flight)
    if isinstance(loaded, Refusal):
        return loaded
    if loaded.bundle.policy_digest != base.bundle.policy_digest:
        theirs, ours = loaded.bundle.policy, base.bundle.policy
        text = (
            f"the bundle is under {theirs.name}@{theirs.version}, but the vehicle waits under "
            f"{ours.name}@{ours.version}"
        )
        return Refusal("other-policy", text, "use the signed policy of the bundle that `run --wait` was started with")
    if (
        loaded.bundle.mission_digest == base.bundle.mission_digest
    ):  # agents know this bundle, and a person may have approved its steps
        text = (
            "this is the bundle that `run --wait` was started with: it names the policy, and its mission does not fly"
        )
        return Refusal("waited-with", text, "compile and sign another mission under its policy")
    refusal = (
        lapsed(data, trusted.signed, log_key, loaded, context.clock)
        or stranded_signal(context.request, loaded, signing)
        or expired(loaded, context.clock.now())
        or not_opened(context.request.kept_in, loaded)
    )
    return refusal or (loaded if apart is None else apart.admit(data, context.clock.now()))
