"""The stage that connects: open and sign the link, await the first heartbeat, and take the time of day."""

import time
from collections.abc import Sequence
from errno import ENOENT
from pathlib import Path
from typing import Any, Final, NamedTuple

from rtshcua.adapters.boundary.process import UNBUILT, UNBUILT_HELP
from rtshcua.adapters.clock import LinkClock
from rtshcua.adapters.doctor.identity import IdentityQuestions, standing
from rtshcua.adapters.packs import BrokenPack, manoeuvres, packs_of
from rtshcua.adapters.simulator import Simulator, SimulatorError
from rtshcua.adapters.store.folders import data_folder
from rtshcua.adapters.store.signing import LinkKeyError
from rtshcua.adapters.store.vehicle_records import OwedParameters, kept_qualification
from rtshcua.adapters.utc import UtcWatch, certain_from_us
from rtshcua.adapters.vehicle import messages
from rtshcua.adapters.vehicle.address import Address, LinkCarrier
from rtshcua.adapters.vehicle.connected import ConnectedVehicle
from rtshcua.adapters.vehicle.driver import Driver
from rtshcua.adapters.vehicle.messages import Message
from rtshcua.adapters.vehicle.telemetry import UnknownSource
from rtshcua.adapters.vehicle.transport import Transport, UdpTransport, open_transport
from rtshcua.app.fly.agents import Agents
from rtshcua.app.fly.flight_request import FlightContext, FlightRequest
from rtshcua.app.fly.link_signing import LinkSigning
from rtshcua.app.fly.previous_log import LogBefore
from rtshcua.app.fly.start_boundary import Begun, BoundaryClient, of_link_key
from rtshcua.app.fly.verify_bundle import may_have_flown
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.policy import Policy
from rtshcua.onboard.calls import call
from rtshcua.onboard.enforcement.isolated import IsolatedGate
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.ports import Event
from rtshcua.onboard.rehearsal import stranded
from rtshcua.simulation.simulated_mark import hundredths, marked_speed
from rtshcua.wire.qualification import Qualification, open_qualification
from rtshcua.wire.trust import TrustRoot
from rtshcua.wire.untrusted import Untrusted

#: the longest wait for the first heartbeat, in seconds
HEARTBEAT_S = 10.0
#: the wait for a second vehicle's heartbeat, sent once a second; later ones only make this vehicle not ready
ANOTHER_S = 1.5
#: the longest wait for the report that the vehicle is simulated, in seconds
SPEED_S = 10.0

#: the help for a link that cannot be opened, by its carrier
PORT_HELP: Final = {
    LinkCarrier.UDP_IN: "another program may listen there; a vehicle can be told to send to another port",
    LinkCarrier.UDP_OUT: "check that this machine reaches that address",
    LinkCarrier.TCP: "check that this machine reaches that address",
    LinkCarrier.TCP_IN: "another program may listen there; a vehicle can be told to connect to another port",
    LinkCarrier.SERIAL: "end the program that has it open (ModemManager, a ground station, a shell on the console); "
    "the group `dialout` may open serial devices; `ls /dev/serial/by-id` shows which there are",
    LinkCarrier.INHERITED: "the program that starts this one passes one end of a `socketpair` of datagrams",
}

_NO_DEVICE: Final = "check that the device is plugged in; `ls /dev/serial/by-id` lists the devices"


def unopened(link: Address, error: OSError) -> Refusal:
    """The refusal for a link that cannot be opened."""
    verb = "listen at" if link.way in (LinkCarrier.UDP_IN, LinkCarrier.TCP_IN) else "open"
    missing = link.way is LinkCarrier.SERIAL and error.errno == ENOENT
    help = _NO_DEVICE if missing else PORT_HELP[link.way]
    return Refusal("port", f"cannot {verb} `{link}`: {(error.strerror or str(error)).lower()}", help)


#: the longest wait for the vehicle's time if the operator stated the error of this machine's clock, in seconds
UTC_S = 3.0
#: the longest wait before a flight once the vehicle is ready otherwise, in seconds
READY_UTC_S: Final = 10.0
#: the earliest begin of a mission while the time is unknown, in us: never
_UNDATED_US: Final = 2**62
UTC_NOTE: Final = (
    "the error of this machine's clock is unknown: steps are deferred until the vehicle reports the time "
    "(`--utc-error 500ms` states the error)"
)
#: the same for a boundary process and a link without a key
APART_UTC_NOTE: Final = (
    "this machine's clock is not synchronised, and the boundary takes the vehicle's time only over a link with a key: "
    "steps are deferred (`--signing-key`, or `--utc-error 500ms` states the error)"
)
#: the same for a listening boundary
LISTENING_UTC_NOTE: Final = (
    "the boundary does not know the time of day: this machine's clock is not synchronised, and the vehicle has not "
    "reported its time over a link with a key; steps are deferred (`--utc-error US` on the boundary's command line "
    "states the error)"
)

#: the refusal after Ctrl-C before the flight
INTERRUPTED: Final = Refusal("interrupted", "interrupted before anything flew", "", ExitCode.INTERRUPTED)

#: the longest wait for the version and parameters of a qualified vehicle, in seconds
_IDENTITY_S: Final = 4.0
_QUALIFY_HELP: Final = "`rtshcua qualify` flies a short test of it"
_LOOPBACK: Final = "127.0.0.1"
_POLL_S = 0.05
_HELP: Final = "check that it is on and sends to this address (PX4 or ArduPilot); `rtshcua sim` simulates one"
_KEY_HELP: Final = "check that the vehicle has the key of `--signing-key`, and that both clocks are right"
_SILENCE_HELP: Final = "check the address, the cable and the vehicle's port settings"
_SYSTEM_HELP: Final = "name another id with `--system`, or leave it out"


def unmet(where: str, seconds: float, system: int | None, rejected: str | None, silence: str | None) -> Refusal:
    """The refusal if no heartbeat came within so many seconds. `rejected` describes frames that were not accepted,
    `silence` another known cause.
    """
    of = where if system is None else f"system {system} of {where}"
    text = f"no heartbeat from {of} within {seconds:.0f} s"
    if rejected is not None:
        return Refusal("no-vehicle", f"{text}: {rejected}", _KEY_HELP)
    if silence is not None:
        return Refusal("no-vehicle", f"{text}: {silence}", _SILENCE_HELP)
    return Refusal("no-vehicle", text, _HELP if system is None else _SYSTEM_HELP)


class SpeedQuestion:
    """Asks a vehicle, until it answers, whether this program simulates it, and at what speed."""

    #: the interval between two requests, in seconds of the machine's time: the vehicle's speed is not known yet
    EACH_S: Final = 0.25

    def __init__(self) -> None:
        self._asked_s: float | None = None
        #: whether the vehicle answered
        self.answered = False
        #: its speed in hundredths; None if this program does not simulate it
        self.speed: int | None = None

    def due(self, system: int, now_us: int) -> Sequence[Message]:
        """The request, if it is due."""
        now_s = time.monotonic()
        if self.answered or (self._asked_s is not None and now_s - self._asked_s < self.EACH_S):
            return ()
        self._asked_s = now_s
        return (messages.request(system, "AUTOPILOT_VERSION"),)

    def take(self, name: str, message: Any) -> None:
        """Process a message of the autopilot."""
        if name == "AUTOPILOT_VERSION":
            self.answered, self.speed = True, marked_speed(message)


def unlike(question: SpeedQuestion, speed: float) -> Refusal | None:
    """The refusal if the vehicle does not run at `speed` times real time by its own report; None if it does. The speed
    is not measured, because on a busy machine a simulated vehicle waits for its run and is slower than it reports.
    """
    if question.speed is None:
        answer = "reports another one" if question.answered else f"did not report it within {SPEED_S:.0f} s"
        text = f"`--speed {speed:g}` requires a vehicle that this program simulates; this one {answer}"
        return Refusal(
            "not-simulated",
            text,
            "leave `--speed` out; `rtshcua sim --speed N` starts a simulated vehicle",
            ExitCode.REFUSED,
        )
    if question.speed != hundredths(speed):
        text = f"the simulated vehicle runs at {question.speed / 100:g} times real time, not at {speed:g}"
        return Refusal("other-speed", text, f"use `--speed {question.speed / 100:g}`", ExitCode.REFUSED)
    return None


def await_heartbeat(
    context: FlightContext, vehicle: ConnectedVehicle, signing: LinkSigning, *, hurried: bool
) -> list[Event] | Refusal:
    """Wait for the first heartbeat of an autopilot; return the events meanwhile. On a real link also wait for a second
    vehicle, and refuse if there is one. The vehicle is ready only afterwards. `hurried`: a flight may have broken off
    in the air; then there is no wait for a second vehicle, so that the first is brought down at once.
    """
    link, events = context.request.link, list[Event]()
    vehicle.driver.issued_from_us = _UNDATED_US
    until_s = time.monotonic() + HEARTBEAT_S
    while vehicle.driver.flavour is None:
        if context.interrupts.wish() is not None:
            return INTERRUPTED
        if time.monotonic() > until_s:
            where = "the simulated vehicle" if link is None else f"a vehicle at `{link}`"
            no_heartbeat = unmet(where, HEARTBEAT_S, context.request.system, signing.rejected, vehicle.silence)
            return no_heartbeat._replace(code=ExitCode.LINK)
        events += _poll(context, vehicle)
    if link is not None and context.request.speed != 1:
        refusal = _not_simulated(context, vehicle, events)
        if refusal is not None:
            return refusal
    until_s = time.monotonic() + (0 if link is None or hurried else ANOTHER_S)
    while time.monotonic() < until_s and vehicle.driver.link.crowd is None:
        events += _poll(context, vehicle)
    if vehicle.driver.link.crowd is not None:
        text = vehicle.driver.link.crowd
        return Refusal("two-vehicles", text, "one vehicle to a port is safest", ExitCode.REFUSED)
    vehicle.driver.issued_from_us = 0
    return events


def _not_simulated(context: FlightContext, vehicle: ConnectedVehicle, events: list[Event]) -> Refusal | None:
    """The refusal if the vehicle does not report that it is simulated at the requested speed: its times could not be
    checked, and would be wrong in the log. Appends the received events to `events`.
    """
    question = SpeedQuestion()
    vehicle.driver.asks_first = question
    until_s = time.monotonic() + SPEED_S
    while not question.answered and time.monotonic() < until_s:
        if context.interrupts.wish() is not None:
            return INTERRUPTED
        events += _poll(context, vehicle)
    vehicle.driver.asks_first = None
    return unlike(question, context.request.speed)


def _poll(context: FlightContext, vehicle: ConnectedVehicle) -> Sequence[Event]:
    return vehicle.poll(context.clock.now().monotonic_us, context.clock.us_in(_POLL_S))


def await_utc(
    utc: UtcWatch, vehicle: ConnectedVehicle, clock: LinkClock, issued_us: int, *, patient: bool,
    listens: bool = False, hurried: bool = False,
) -> list[Event]:  # fmt: skip
    """Take the vehicle's time of day if the kernel's clock is not synchronised; return the events meanwhile. The
    vehicle is ready only afterwards, and once the mission was certainly issued, at `issued_us` (UTC).

    `patient`: wait `UTC_S`, then use the operator's statement; else the vehicle is not ready before it reports its
    time. `listens`: wait as long for a listening boundary, whose operator may have stated the error there; without
    either the vehicle is not ready. `hurried`: a flight may have broken off, and an armed vehicle is brought down
    first.
    """
    events: list[Event] = []
    vehicle.driver.issued_from_us = _UNDATED_US
    until_s = time.monotonic() + (UTC_S if patient or listens else 0)
    while utc.waits and utc.vehicle_counts:
        flavour = vehicle.driver.flavour
        taken = flavour is not None and utc.look(vehicle.driver.source, flavour.name, clock.now().monotonic_us)
        if taken or time.monotonic() >= until_s or (hurried and vehicle.driver.seen.armed):
            break
        events += vehicle.poll(clock.now().monotonic_us, clock.us_in(_POLL_S))
    utc.settle()
    vehicle.driver.asks_utc = utc.vehicle_may_tell
    vehicle.driver.utc_patience_us = 0 if patient or (listens and not utc.waits) else clock.us_in(READY_UTC_S)
    vehicle.driver.issued_from_us = certain_from_us(issued_us, clock.now())
    return events


# ---------------------------------------------------------------- the qualification of what is connected


def record_of(vehicle: str, root: TrustRoot, now_us: int, data: Path | None = None) -> Qualification | str | None:
    """The qualification record of a vehicle; None if it has none, a text if the record is not trusted."""
    try:
        signed = kept_qualification(data_folder() if data is None else data, vehicle)
        return None if signed is None else open_qualification(signed, root=root, vehicle=vehicle, now_us=now_us)
    except Untrusted as error:
        return str(error)
    except OSError as error:
        return (error.strerror or str(error)).lower()


def unqualified(
    record: Qualification | str | None, vehicle: ConnectedVehicle, clock: LinkClock
) -> tuple[str | None, list[Event]]:
    """A note if the vehicle in its present state is not qualified, else None; and the events meanwhile. The vehicle is
    asked for its identity only if there is a valid record, and only on the ground.
    """
    driver, events = vehicle.driver, list[Event]()
    flavour = driver.flavour
    if flavour is None or not isinstance(record, Qualification) or not record.qualifies:
        return f"{standing(record, None, {}).text} ({_QUALIFY_HELP})", events
    questions = IdentityQuestions(flavour, names=[name for name, _ in record.parameters])
    driver.asks = questions
    until_s = time.monotonic() + _IDENTITY_S
    while not questions.told and time.monotonic() < until_s and not (driver.seen.airborne or driver.seen.armed):
        events += vehicle.poll(clock.now().monotonic_us, clock.us_in(_POLL_S))
    driver.asks = None
    if driver.seen.airborne or driver.seen.armed:
        return None, events
    stands = standing(record, questions.firmware, questions.parameters)
    return (None if stands.qualified else f"{stands.text} ({_QUALIFY_HELP})"), events


# ---------------------------------------------------------------- the stage


class Connected(NamedTuple):
    """A connected vehicle, the signing of its link, the events since its first heartbeat, and the agents' sockets."""

    vehicle: ConnectedVehicle
    signing: LinkSigning
    events: list[Event]
    agents: Agents | None


def connect(
    context: FlightContext, begun: Begun, previous: LogBefore | None, debts: OwedParameters
) -> Connected | Refusal:
    """Open the link for the flight, and wait for the vehicle and the time of day. Raises OSError."""
    request, loaded, driven = context.request, begun.loaded, context.request.dry_run
    signing = sign_link(context, loaded, begun.apart)
    if isinstance(signing, Refusal):
        return signing
    context.resources.callback(signing.close)
    refusal = stranded_signal(request, loaded, signing)
    if refusal is not None:
        return refusal
    driver = make_driver(context, loaded, signing, fence=request.fence)
    if isinstance(driver, Refusal):
        return driver
    driver.prepares = not driven and bool(request.settings or debts.left)
    driver.left = None if previous is None else previous.left(begun.bundle, loaded)
    transport = begun.transport or open_link(context)
    if isinstance(transport, Refusal):
        return transport
    vehicle = ConnectedVehicle(transport, driver, context.clock, context.frames.keep)
    context.resources.callback(vehicle.close)
    refusal = too_slow(driver) or _simulate(context, loaded, transport)
    if refusal is not None:
        return refusal
    agents = begun.agents or open_agents(context, loaded)
    driver.asks_utc, driver.asks_back = context.utc.vehicle_may_tell, context.utc.question
    hangs = not driven and previous is not None and previous.broken_off is not None
    driver.hurries = hurried = hangs and may_have_flown(request, loaded)
    events = await_heartbeat(context, vehicle, signing, hurried=hurried)
    if isinstance(events, Refusal):
        return events
    patient, listens = driven or request.utc_error_us is not None, request.boundary_socket is not None
    events += await_utc(
        context.utc, vehicle, context.clock, loaded.issued_us, patient=patient, listens=listens, hurried=hurried
    )
    return Connected(vehicle, signing, events, agents)


def sign_link(context: FlightContext, loaded: Loaded, apart: BoundaryClient | None = None) -> LinkSigning | Refusal:
    """Set up the signing of the link. A boundary process that decides signs itself, and its key is not read here.
    Raises OSError.
    """
    request, gate = context.request, loaded.executor.frames
    process = apart.process if apart is not None and isinstance(gate, IsolatedGate) else None
    try:
        signing = LinkSigning(
            request.signing_key if process is None else None, loaded.bundle.policy, gate, request.state, context.clock,
            unsigned_radio=request.unsigned_radio, even_damaged=not request.dry_run,
        )  # fmt: skip
        if process is not None and isinstance(gate, IsolatedGate):
            if request.boundary_socket is not None:
                where = request.boundary_socket
                signing.notes.append(f"the boundary at `{where}` decides, with its own keys and trust root")
            if process.missing:
                signing.notes.append(f"the boundary runs without {'; without '.join(process.missing)}")
            if process.link_name is not None:
                policy, radio = loaded.bundle.policy, request.unsigned_radio
                signing.elsewhere(process.link_name, gate, policy, unsigned_radio=radio)
    except LinkKeyError as error:
        return of_link_key(error)
    if request.unbuilt:
        signing.notes.append(f"{UNBUILT}: {UNBUILT_HELP}")
    if signing.name is None and request.link is not None and not request.link.is_loopback:
        signing.notes.append(
            f"`{request.link}` has no key: anyone who reaches it can impersonate the vehicle (`--signing-key`)"
        )
    return signing


def stranded_signal(request: FlightRequest, loaded: Loaded, signing: LinkSigning) -> Refusal | None:
    """The refusal if a step needs a signal that cannot arrive, so that the mission would break off in the air. A
    rehearsal reports it for each step.
    """
    steps = stranded(loaded.bundle.policy, loaded.bundle.mission, signing.unheard)
    if not steps or request.dry_run:
        return None
    first = call(loaded.bundle.policy, steps[0])
    return Refusal(
        "signal-unsigned",
        f"`{first}` needs a signal of RADIO_STATUS, which radios do not sign: the step would wait in vain",
        "`--unsigned-radio` accepts it unsigned; the worst value of the last seconds counts", ExitCode.REFUSED,
    )  # fmt: skip


def make_driver(
    context: FlightContext, loaded: Loaded, signing: LinkSigning, *, fence: bool, waits: bool = False
) -> Driver | Refusal:
    """The driver of a vehicle under the policy of a bundle. `fence`: upload the airspace as the vehicle's fence.
    `waits`: before a bundle is handed in, when the parameters of its flight are not set yet.
    """
    request, policy = context.request, loaded.bundle.policy
    try:
        own = manoeuvres(packs_of(policy.sources))
    except BrokenPack as error:
        return Refusal("broken-pack", error.text, "", ExitCode.REFUSED)
    try:
        make = Driver if request.sortie is None else request.sortie.driver
        return make(
            policy,
            loaded.executor.frames,
            context.slack,
            fence=fence and not request.dry_run,
            manoeuvres=own,
            verifier=signing.verifier,
            system=request.system,
            steps=loaded.bundle.mission.invocations,
            meant=request.settings if request.dry_run or waits else None,
        )
    except UnknownSource as error:
        return Refusal("unknown-source", str(error), "", ExitCode.REFUSED)


def too_slow(driver: Driver) -> Refusal | None:
    """The refusal if the link's capacity is too small for the policy; None if it is sufficient."""
    if driver.shortfall is None:
        return None
    help = "use a faster link, or longer deadlines and `stale after` times in the policy; see docs/flying/link.md"
    return Refusal("link-too-slow", driver.shortfall, help, ExitCode.REFUSED)


def open_link(context: FlightContext) -> Transport | Refusal:
    """Open the transport to the vehicle; for the simulated vehicle, a port that the system chooses."""
    if context.transport is not None:
        return context.transport
    link = context.request.link or Address(LinkCarrier.UDP_IN, _LOOPBACK, 0)
    try:
        return open_transport(link)
    except OSError as error:
        return unopened(link, error)._replace(code=ExitCode.LINK)


def start_simulator(context: FlightContext, loaded: Loaded, port: int) -> Simulator | Refusal:
    """Start the simulated vehicle of a policy for the flight."""
    request = context.request
    options = [*options_of_policy(loaded.bundle.policy), *request.simulator]
    if request.signing_key is not None:
        options += ["--signing-key", str(request.signing_key)]
    try:
        simulator = Simulator(["--port", str(port), "--speed", f"{request.speed:g}", *options])
    except SimulatorError as error:
        return Refusal("simulator", str(error), "", ExitCode.LINK)
    return context.resources.enter_context(simulator)


def options_of_policy(policy: Policy) -> list[str]:
    """The simulator's options for the vehicle of a policy: home, endurance, return height, speed, sensors, and the
    camera and gimbal that its contracts command.
    """
    from rtshcua.virtual.fitting import fitting  # not imported for a real vehicle

    fits = fitting(policy)
    home = fits.home
    return [
        f"--return-at={fits.return_mm / 1_000:g}",
        f"--home={home.latitude / 1e7:.7f},{home.longitude / 1e7:.7f},{home.amsl_mm // 1_000}",
        f"--hover={fits.hover_us / 60_000_000:.3f}",
        f"--cruise={fits.cruise_mm_s / 1_000:.3f}",
        *(sorted(f"--extra={extra}" for extra in fits.extras) or ["--stock"]),
        *(["--camera"] if fits.camera else []),
        *(["--gimbal"] if fits.gimbal else []),
    ]


def open_agents(context: FlightContext, loaded: Loaded, *, waits: bool = False) -> Agents | None:
    """Open the sockets for agents and operators for the flight; None if there are none. Raises OSError."""
    request = context.request
    if request.agent_socket is None and request.operator_socket is None:
        return None
    return context.resources.enter_context(
        Agents(request.agent_socket, loaded, operators=request.operator_socket, group=request.agent_group, waits=waits)
    )


def utc_notes(context: FlightContext, apart: BoundaryClient | None, *, listens: bool) -> list[str]:
    """The note if the time of day is unknown."""
    if not context.utc.waits:
        return []
    if listens:
        return [LISTENING_UTC_NOTE]
    unkeyed = apart is not None and apart.process.link_name is None
    return [APART_UTC_NOTE if unkeyed or not context.utc.vehicle_counts else UTC_NOTE]


def _simulate(context: FlightContext, loaded: Loaded, transport: Transport) -> Refusal | None:
    """Start the simulated vehicle of a flight without a link, and its incidents. After `--wait` it already runs."""
    request = context.request
    if not isinstance(transport, UdpTransport) or request.link is not None or request.wait_s is not None:
        return None
    simulator = start_simulator(context, loaded, transport.port)
    if isinstance(simulator, Refusal):
        return simulator
    context.clock.tell(simulator.heard)
    if request.incidents is None:
        return None
    return request.incidents.begin(loaded.policy, loaded.bundle.mission, simulator)
