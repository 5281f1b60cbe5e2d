"""Everything before a flight: trust, the bundle, the link, the vehicle, and that the bundle has not flown before."""

import gc
import secrets
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import gettempdir
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Protocol

from rtshcua.adapters.boundary_process import UNBUILT, UNBUILT_HELP, ListeningBoundary
from rtshcua.adapters.clock import UTC_ERROR_US, LinkClock, PacedClock, SystemClock
from rtshcua.adapters.packs import BrokenPack, manoeuvres, packs_of
from rtshcua.adapters.simulator import Simulator, SimulatorError
from rtshcua.adapters.store.boundary import BoundaryStore
from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.adapters.store.last_log import SIMULATED
from rtshcua.adapters.store.owed import OwedParameters
from rtshcua.adapters.store.reading import open_regular, read_regular
from rtshcua.adapters.store.runs import BUNDLE, LOG, RunFolder
from rtshcua.adapters.store.signing import LinkKeyError
from rtshcua.adapters.store.writing import PRIVATE_FOLDER, make_folder
from rtshcua.adapters.utc import UtcWatch, vehicle_counts
from rtshcua.adapters.vehicle.address import Address, LinkCarrier
from rtshcua.adapters.vehicle.connected import ConnectedVehicle
from rtshcua.adapters.vehicle.driver import Driver
from rtshcua.adapters.vehicle.telemetry import UnknownSource
from rtshcua.adapters.vehicle.transport import Transport, UdpTransport, open_transport
from rtshcua.app.documents import no_bundle
from rtshcua.app.exit_codes import code_of, untrusted, words_of
from rtshcua.app.fly import simulated_flight
from rtshcua.app.fly.agents import Agents
from rtshcua.app.fly.attesting import UNNAMED, BoundarySession, Elsewhere, boundary_key, elsewhere
from rtshcua.app.fly.boundary import CODES, IN_USE, Apart, connected, started
from rtshcua.app.fly.connect import APART_UTC_NOTE, LISTENING_UTC_NOTE, UTC_NOTE, await_utc, meet, unopened
from rtshcua.app.fly.frame_buffer import Tape
from rtshcua.app.fly.interrupts import Interrupts
from rtshcua.app.fly.link_signing import Signing
from rtshcua.app.fly.log_signer import LogSigner
from rtshcua.app.fly.narrator import Answering
from rtshcua.app.fly.parameters import would_set
from rtshcua.app.fly.previous_log import Past
from rtshcua.app.fly.qualified import record_of, unqualified
from rtshcua.app.fly.refused import Refused as Refused
from rtshcua.app.fly.replay_check import (
    broke_off,
    expired,
    flown_before,
    give_back,
    mark_opened,
    not_opened,
    obeys,
    still_flies,
)
from rtshcua.app.fly.session import Flight
from rtshcua.app.fly.story import Note
from rtshcua.app.fly.trust import REVOKED, Trusted, trust
from rtshcua.app.fly.waiting import Admitted, Waiting
from rtshcua.app.fly.witnesses import Witnessing
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli import simulated
from rtshcua.front.cli.console import TerminalConsole
from rtshcua.front.cli.faults import say
from rtshcua.front.cli.interrupts import breakable
from rtshcua.front.cli.live.feed import Feed
from rtshcua.front.cli.showing.document import HANDED_IN, kind_of_document
from rtshcua.front.cli.unlock import unlock
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.calls import call
from rtshcua.onboard.enforcement.frames import Gate
from rtshcua.onboard.enforcement.isolated import IsolatedExecutor, IsolatedGate
from rtshcua.onboard.enforcement.load import SESSION_KEY_BYTES, EnforcementMode, Loaded, load
from rtshcua.onboard.enforcement.preparation import Owed, PreparationIssuer
from rtshcua.onboard.ports import Ending, Event
from rtshcua.onboard.rehearsal import stranded
from rtshcua.wire import cose
from rtshcua.wire.bundle import MAX_BUNDLE, claimed_vehicle, open_bundle
from rtshcua.wire.document import FLIGHT_BYTES
from rtshcua.wire.keys import SEED_BYTES, Duty, SigningKey, VerificationKey
from rtshcua.wire.trust import MAX_ROOT, TrustRoot, key_refusal, open_root
from rtshcua.wire.untrusted import Untrusted

if TYPE_CHECKING:
    from rtshcua.app.fly.incidents import Incidents

#: up to this many times as fast as life, a real vehicle's time limits leave the machine enough
_UNHURRIED = 5

#: the mode of what is decided in this process, of the mode that was asked for
_HERE = {EnforcementMode.PROCESS: EnforcementMode.SOFTWARE}
_LOOPBACK = "127.0.0.1"
_TOO_SLOW = "a faster link, or longer deadlines and times to stale in the policy; docs/flying/link.md counts octets"
_NOT_HERE = ("mode-refused", "wrong-vehicle")
#: where it stands which vehicle a bundle is for
_UNVERIFIABLE = ", which has the log's key: nobody can verify this log, its key is drawn for it alone"
IDENTITY_HELP = "`identity` of the policy's `vehicle` says which one it is for, `--vehicle` which one this is"


class Sortied(Protocol):
    """A flight of a qualification: a driver of its own, and what is done before the link is closed."""

    def driver(self, policy: Policy, frames: Gate, slack: int, **more: Any) -> Driver:
        """The driver that flies it."""
        ...

    def before(self, vehicle: ConnectedVehicle, clock: LinkClock) -> list[Event]:
        """The vehicle was met, and nothing sent; what happened meanwhile. Raises `Refused` for one not to be flown."""
        ...

    def after(
        self, vehicle: ConnectedVehicle, clock: LinkClock, interrupts: Interrupts, ending: Ending, final_hash: str
    ) -> None:
        """The flight ended so, and its log ends in the line of this hash."""
        ...


@dataclass(frozen=True, slots=True)
class Launch:
    """What `run` was asked for. `link` None: the simulated vehicle is started with the options in `simulator`.

    `roots`: the trust root, and before it those that lead to it from the one that the vehicle accepted last; none for
    the key store's. `fence` False: the vehicle's own fence is left as it is. `system`: its MAVLink id, if it was named.
    `utc_error_us`: what the operator says that UTC is off by at most. `sortie`: it is one of a qualification.
    `settings`: parameters that are set before the flight, by name, and put back after it. `wait_s`: the bundle says the
    policy alone, and for so many seconds at most it waits for the one that flies. `boundary_user`: the user and group
    that a boundary of its own process runs as; `unbuilt`, that there is none only because its program is missing.
    `boundary_socket`: where a boundary listens that has the keys, of the log, of its own and of the link; `listening`
    is that boundary once it is connected, or why it is not. `transport`: `link`, where it is open already.
    """

    bundle: Path
    link: Address | None
    simulator: Sequence[str]
    mode: EnforcementMode
    speed: float
    vehicle: str | None
    roots: Sequence[Path]
    log_key: Path | None
    passphrase_file: Path | None
    data: Path
    state: Path
    runs: Path
    style: Literal["screen", "lines", "json"]
    fence: bool = True
    signing_key: Path | None = None
    unsigned_radio: bool = False
    agent_socket: Path | None = None
    operator_socket: Path | None = None
    agent_group: int | None = None
    dry_run: bool = False
    system: int | None = None
    witnesses: tuple[Address, ...] = ()
    incidents: "Incidents | None" = None
    utc_error_us: int | None = None
    sortie: Sortied | None = None
    settings: Mapping[str, int] = field(default_factory=dict)
    wait_s: float | None = None
    boundary_user: tuple[int, int] | None = None
    unbuilt: bool = False
    boundary_key: Path | None = None
    boundary_socket: Path | None = None
    listening: ListeningBoundary | Refused | None = None
    transport: Transport | None = None


def launch(order: Launch) -> ExitCode:
    """Fly, and show how it ended. Raises `Refused`, and OSError for files that cannot be read or written."""
    if order.boundary_socket is None:
        return _launch(order)
    try:
        listening = connected(order.boundary_socket, paced=order.speed != 1)
    except Refused as refused:  # what hangs in the air comes down without
        return _launch(replace(order, listening=refused))
    try:
        return _launch(replace(order, listening=listening))
    finally:
        listening.close()


def _launch(order: Launch) -> ExitCode:
    bundle = _read(order.bundle)
    clock: LinkClock = SystemClock() if order.speed == 1 else PacedClock(order.speed)
    utc = _utc(order, clock)
    trust, log_key, loaded = _signed_by(*_trusting(order, bundle, clock))
    witnesses = Witnessing(order.witnesses, trust.root.witnesses(loaded.vehicle, clock.now().utc_us))
    past = None
    if not order.dry_run:
        past = Past(_left_in(order), loaded.vehicle, log_key.key() if order.boundary_socket is None else None)
    with ExitStack() as view:  # it may still be shown when everything else is over
        view.enter_context(breakable())
        with ExitStack() as stack:
            interrupts, tape = stack.enter_context(Interrupts()), Tape()
            sets = None if order.dry_run else bool(order.settings)
            debts = OwedParameters(_left_in(order), loaded.vehicle, sets=sets)
            stack.callback(debts.close)
            slack = max(1, round(order.speed / _UNHURRIED))
            stack.enter_context(_with_the_one_before(past, loaded))
            _expect_fresh_at_first(order, loaded, clock, owes=bool(debts.left))
            begun = _begin(order, bundle, loaded, trust, log_key, past, debts.left, clock, interrupts, slack, stack)
            bundle, loaded, trust, (own_key, keyless), apart, absent, transport, agents = begun
            root, signed_root = trust.root, trust.signed
            _follow(utc, apart)
            signing = _sign(order, loaded, clock, apart)
            stack.callback(signing.close)
            _hear(order, loaded, signing)
            driver = _driver(order, loaded, slack, signing)
            driver.prepares = not order.dry_run and bool(order.settings or debts.left)
            driver.left = None if past is None else past.left(bundle, loaded)
            transport = transport or _open(order)
            vehicle = ConnectedVehicle(transport, driver, clock, tape.keep)
            stack.callback(vehicle.close)
            if driver.shortfall is not None:
                raise Refused(ExitCode.REFUSED, "link-too-slow", driver.shortfall, _TOO_SLOW)
            if isinstance(transport, UdpTransport) and order.link is None and order.wait_s is None:
                simulator = stack.enter_context(_simulate(order, loaded, transport.port))
                clock.tell(simulator.heard)
                if order.incidents is not None:
                    order.incidents.begin(loaded.policy, loaded.bundle.mission, simulator)
            agents = agents or _agents(order, loaded, stack)
            vehicle.driver.asks_utc, vehicle.driver.asks_back = utc.vehicle_may_tell, utc.question
            hurried = not order.dry_run and _broke_off(past) and _may_have_flown(order, loaded)
            driver.hurries = hurried
            events = meet(
                order.link, order.system, vehicle, clock, interrupts, signing, hurried=hurried, speed=order.speed
            )
            stated = order.utc_error_us is not None
            listens = order.boundary_socket is not None
            events += await_utc(
                utc, vehicle, clock, loaded.issued_us, patient=order.dry_run or stated, listens=listens, hurried=hurried
            )
            lapsed = _lapsed(bundle, signed_root, log_key.kid, loaded, clock)
            _expect_current(lapsed, resumed=not order.dry_run and order.sortie is None)
            if order.sortie is not None:
                events += order.sortie.before(vehicle, clock)
            elif order.link is not None:
                note, meanwhile = unqualified(
                    record_of(loaded.vehicle, root, clock.now().utc_us, order.data), vehicle, clock
                )
                events += meanwhile
                signing.notes += [note] if note is not None else []
            if order.dry_run:
                from rtshcua.front.cli.dry_run import (
                    dry_run,  # shows what would pass as `why` does, which is of the ground
                )

                return dry_run(
                    loaded, vehicle, clock, interrupts, events, as_json=order.style == "json",
                    notes=(*signing.notes, *would_set(order.settings), *_utc_notes(utc, apart, listens=False)),
                    refusal=_not_begun(order, loaded, clock), unheard=signing.unheard, sets=tuple(order.settings),
                )  # fmt: skip
            assert past is not None
            resumed, refusal = _opened(order, loaded, vehicle, clock, events, owes=bool(debts.left))
            _expect_obeyed(order, loaded, vehicle, clock, events, absent, resumed=resumed)
            _expect_current(lapsed, resumed=resumed)
            _expect_kept(signing, resumed=resumed)
            _expect_link_key(signing, root, resumed=resumed)
            _expect_all(absent, keyless, resumed=resumed)
            inside = BoundarySession(BoundaryStore(_left_in(order), loaded.vehicle), own_key, aloft=resumed)
            told = trust.settle(resumed=resumed)
            run, moved = _run_folder(order, loaded, bundle, clock, resumed=resumed)
            feed = view.enter_context(_console(order).view())
            flight = Flight(
                loaded, vehicle, clock, feed, interrupts, tape, bundle=bundle, root=signed_root, log_key=log_key,
                run=run, speed=order.speed, live=order.style == "screen", resumed=resumed, events=events,
                past=past, witnesses=witnesses, agents=agents, incidents=order.incidents, utc=utc, debts=debts,
                lapsed=lambda: None if resumed else _lapsed(bundle, signed_root, log_key.kid, loaded, clock),
                simulated=simulated_flight.told(order.speed, own=order.link is None), boundary=inside,
                answering=_answering(order, run), detail_of=_console(order).detail_of,
            )  # fmt: skip
            log_key.hand_over(_signs_no_more)  # nothing in flight needs it, so nothing in flight holds it
            if refusal is not None:
                flight.settle()
                raise refusal
            if not resumed:
                mark_opened(_left_in(order), loaded, clock, flight)
            unsure = _utc_notes(utc, apart, listens=order.boundary_socket is not None)
            unsigned = str(keyless) if keyless is not None else UNNAMED if own_key is None else ""
            alone = "" if absent is None else f"{_why(absent)}; it is brought down without a boundary of its own"
            alone += _UNVERIFIABLE if alone and order.boundary_socket is not None else ""
            hangs = "" if resumed else _hanging(past, loaded)
            told_before = filter(None, dict.fromkeys([alone, hangs, told, moved, past.note, unsigned, inside.note]))
            for note in (*signing.notes, *told_before, *unsure):
                feed.post(Note(note))
            _keep_what_is_loaded(hurried=resumed)
            code, summary = flight.fly()
            if order.sortie is not None:
                order.sortie.after(vehicle, clock, interrupts, Ending(summary.ending), flight.final_hash)
            if not resumed and (kept := give_back(_left_in(order), loaded, flight, clock.now())) is not None:
                feed.post(Note(kept))
            if order.incidents is not None:
                with open_regular(run.path / LOG) as log:
                    code = _hold(order.incidents, Ending(summary.ending), code, log, feed)
        if signing.trouble is not None:
            feed.post(Note(signing.trouble))
        feed.post(summary)
    return code if feed.shown or code is not ExitCode.OK else ExitCode.FULL


def _keep_what_is_loaded(*, hurried: bool) -> None:
    """What was loaded stays; the collector need not look at it while flying. `hurried`: what is garbage may stay too,
    for to collect it takes 30 ms.
    """
    if not hurried:
        gc.collect()
    gc.freeze()


class _Begun(NamedTuple):
    """What flies: its bundle, in force; under what it is trusted; the key that the boundary signs with, or why there is
    none; the boundary, where it runs apart, or why it is `absent`. A run that waited has its link and its sockets
    already.
    """

    bundle: bytes
    loaded: Loaded
    trust: Trusted
    key: tuple[SigningKey | Elsewhere | None, Refused | None]
    apart: Apart | None
    absent: Refused | OSError | None
    transport: Transport | None = None
    agents: Agents | None = None


def _console(order: Launch) -> TerminalConsole:
    return TerminalConsole(order.style, order.data, order.passphrase_file)


def _left_in(order: Launch) -> Path:
    """Where it is kept what flew, and what the flight before left, of this vehicle or of the simulated one that a run
    starts: neither uses up a bundle of the other.
    """
    return order.state / SIMULATED if order.link is None else order.state


def _hanging(past: Past | None, loaded: Loaded) -> str:
    """What brings down what the flight before may have left in the air; nothing where it ended."""
    if past is None or past.broken_off is None:
        return ""
    if past.gone:
        return past.note
    way = f"`rtshcua run {past.broken_off / BUNDLE}` brings down what hangs in the air"
    return f"the flight of `{loaded.vehicle}` before broke off: {way}"


@contextmanager
def _with_the_one_before(past: Past | None, loaded: Loaded) -> Iterator[None]:
    """Whoever learns that nothing begins learns what may be in the air meanwhile."""
    try:
        yield
    except Refused as refused:
        refused.help = "; ".join(filter(None, (refused.help, _hanging(past, loaded)))) or None
        raise


def _begin(
    order: Launch, bundle: bytes, loaded: Loaded, trust: Trusted, log_key: LogSigner, past: Past | None,
    owed: Mapping[str, Owed], clock: LinkClock, interrupts: Interrupts, slack: int, stack: ExitStack,
) -> _Begun:  # fmt: skip
    """The boundary begins, until the stack is closed, and takes the bundle, or one that is waited for. Where it does
    not, and a vehicle may hang in the air, it is the one in this process; also where the boundary of a run that is gone
    still holds the vehicle. Raises `Refused` and OSError.
    """
    apart: Apart | None = None
    absent: Refused | OSError | None = None
    own_key, keyless = _boundary_key(order, trust.root, loaded, clock)
    _expect_all(keyless, resumed=not order.dry_run)
    key: tuple[SigningKey | Elsewhere | None, Refused | None] = (own_key, keyless)
    try:
        apart = _apart(order, loaded, trust, own_key, log_key, owed, stack)
        if order.wait_s is None:
            loaded = _taken_over(apart, loaded, bundle, clock)
        elif apart is not None:  # it draws the id of the flight that the sockets tell of
            loaded = apart.waiting(_load(order, bundle, trust.root, clock.now(), apart.flight()))
    except (Refused, OSError) as error:
        if not _may_hang(order, loaded, past) or (_is_in_use(error) and not _broke_off(past)):
            raise
        apart, absent = None, error
        if order.boundary_socket is not None:
            log_key.use(_log_key_here(order))
            key = None, _keyless()
    if apart is not None:
        log_key.hand_over(apart.sign_log)
        key = (None if own_key is None else Elsewhere(), keyless)
        del own_key  # the boundary has it: it is not held here
    if order.wait_s is None:
        begun = _Begun(bundle, loaded, trust, key, apart, absent)
    else:
        transport, agents = _stand_by(order, loaded, stack)
        (bundle, loaded), waited = _wait(
            order, loaded, trust, log_key, past, clock, interrupts, slack, transport, agents, apart, absent
        )
        if waited is not trust and not isinstance(loaded.executor, IsolatedExecutor):
            key = _boundary_key(order, waited.root, loaded, clock) if order.listening is None else (None, _keyless())
        begun = _Begun(bundle, loaded, waited, key, apart, absent, transport, agents)
    if isinstance(begun.loaded.preparation, PreparationIssuer):  # the one elsewhere was told when it began
        begun.loaded.preparation.owes(owed)
    return begun


def _may_hang(order: Launch, loaded: Loaded, past: Past | None) -> bool:
    """Whether a flight of this vehicle may have broken off in the air, which a restart brings down."""
    return _broke_off(past) if order.wait_s is not None else _may_have_flown(order, loaded)


def _broke_off(past: Past | None) -> bool:
    """Whether the run before ended without the end of its log: one that goes on holds that, and did not."""
    return past is not None and past.broken_off is not None


def _is_in_use(error: Refused | OSError) -> bool:
    return isinstance(error, Refused) and error.slug == IN_USE


def _apart(
    order: Launch, loaded: Loaded, trust: Trusted, own_key: SigningKey | Elsewhere | None, log_key: LogSigner,
    owed: Mapping[str, Owed], stack: ExitStack,
) -> Apart | None:  # fmt: skip
    """A boundary that runs apart, where that is asked for, until the stack is closed. What may have expired is brought
    down by the one in this process, which does not ask, but where one listens: that has a trust root of its own. Raises
    `Refused` and OSError.
    """
    if isinstance(order.listening, Refused):
        raise order.listening
    if order.listening is not None:
        return Apart(order.listening, loaded.vehicle, trust.root, order.settings)
    if order.mode is not EnforcementMode.PROCESS or order.dry_run or trust.distrust is not None:
        return None
    assert not isinstance(own_key, Elsewhere)
    try:
        process = started(
            loaded.vehicle, trust.signed, _left_in(order), link_key=order.signing_key, own_key=own_key,
            log_key=log_key.key(),
            user=order.boundary_user, paced=order.speed != 1, settings=order.settings, owed=owed,
            utc_error_us=UTC_ERROR_US if order.link is None else order.utc_error_us,
        )  # fmt: skip
    except LinkKeyError as error:
        raise _of_link_key(error) from None
    stack.callback(process.close)
    return Apart(process, loaded.vehicle, trust.root, order.settings)


def _taken_over(apart: Apart | None, loaded: Loaded, bundle: bytes, clock: LinkClock) -> Loaded:
    """The bundle in force where decisions are made. Raises `Refused`."""
    taken = loaded if apart is None else apart.load(bundle, clock.now())
    if isinstance(taken, Refusal):
        code = CODES.get(taken.slug.removeprefix("boundary-"), ExitCode.REFUSED)
        raise Refused(code, taken.slug, taken.text, taken.help)
    return taken


def _boundary_key(
    order: Launch, root: TrustRoot, loaded: Loaded, clock: LinkClock
) -> tuple[SigningKey | Elsewhere | None, Refused | None]:
    """The key that the boundary signs with, or why there is none."""
    now_us = clock.now().utc_us
    if isinstance(order.listening, Refused):
        return None, _keyless()
    try:
        if order.listening is not None:
            return elsewhere(root, loaded.vehicle, now_us, order.listening.own_public), None
        return boundary_key(root, loaded.vehicle, now_us, _console(order).unlock, order.boundary_key), None
    except Refused as refused:
        return None, refused


def _keyless() -> Refused:
    """Why nothing is signed inside, where the boundary that listens does not decide."""
    return Refused(ExitCode.INPUT, "no-boundary-key", "what is decided is not signed inside: the boundary has the key")


def _why(absent: Refused | OSError) -> str:
    return words_of(absent) if isinstance(absent, OSError) else str(absent)


def _expect_obeyed(
    order: Launch, loaded: Loaded, vehicle: ConnectedVehicle, clock: LinkClock, events: list[Event],
    absent: Refused | OSError | None, *, resumed: bool,
) -> None:  # fmt: skip
    """A vehicle in the air that obeys nothing unsigned is not waited for where a boundary listens that has the key, and
    does not serve: waiting would not begin it.
    """
    listens = order.boundary_socket
    if not resumed or listens is None or isinstance(loaded.executor, IsolatedExecutor):
        return
    if obeys(vehicle, clock, events):
        return
    why = "it does not serve this run" if absent is None else _why(absent)
    text = f"`{loaded.vehicle}` is in the air and answers nothing that is not signed; the boundary at `{listens}` has "
    help = "begin this run again once the boundary serves, as systemd does; until then the pilot brings it down, or its"
    raise Refused(ExitCode.REFUSED, "not-obeyed", f"{text}the key: {why}", f"{help} own failsafe for a lost link")


def _expect_all(*missing: Refused | OSError | None, resumed: bool) -> None:
    """What is in the air comes down without."""
    for refused in missing:
        if refused is not None and not resumed:
            raise refused


def _run_folder(
    order: Launch, loaded: Loaded, bundle: bytes, clock: LinkClock, *, resumed: bool
) -> tuple[RunFolder, str]:
    """Where the evidence of this run lies, and what there is to tell of it. What comes down keeps it in a temporary
    folder where it cannot lie among the others. Raises OSError.
    """
    handed_in = order.wait_s is not None  # under no name of a file
    name, utc_us = loaded.bundle.mission.name if handed_in else order.bundle.stem, clock.now().utc_us
    try:
        return RunFolder(order.runs, name=name, bundle=bundle, utc_us=utc_us), ""
    except OSError as error:
        if not resumed:
            raise
        fresh = Path(gettempdir(), f"rtshcua-runs-{secrets.token_hex(8)}")
        make_folder(fresh, mode=PRIVATE_FOLDER)
        other = RunFolder(fresh, name=name, bundle=bundle, utc_us=utc_us)
        return other, f"`{order.runs}` takes no run ({error.strerror or error}): the log is in `{other.path}`"


def _opened(
    order: Launch, loaded: Loaded, vehicle: ConnectedVehicle, clock: LinkClock, events: list[Event], *, owes: bool
) -> tuple[bool, Refused | None]:
    """Whether an earlier run of the bundle broke off in the air; and why it does not open, where something is owed to
    the vehicle: then nothing flies, but that is put back first. Raises `Refused` where nothing is.
    """
    try:
        resumed = broke_off(_left_in(order), loaded, vehicle, clock, events)
        if not resumed:
            _expect_fresh(loaded, clock)
        return resumed, None
    except Refused as refused:
        if not owes:
            raise
        return False, refused


def _answering(order: Launch, run: RunFolder) -> Answering | None:
    """How a person answers a step of this flight; None where it has no socket."""
    socket = order.operator_socket or order.agent_socket
    if socket is None:
        return None
    handed_in = order.wait_s is not None  # a file of the run, not of whoever handed it in
    return Answering(str(run.path / BUNDLE if handed_in else order.bundle), str(socket), ahead=order.speed != 1)


def _agents(order: Launch, loaded: Loaded, stack: ExitStack, *, waits: bool = False) -> Agents | None:
    """Who may follow the flight and hand in, until the stack is closed. Raises OSError."""
    if order.agent_socket is None and order.operator_socket is None:
        return None
    return stack.enter_context(
        Agents(order.agent_socket, loaded, operators=order.operator_socket, group=order.agent_group, waits=waits)
    )


def _stand_by(order: Launch, loaded: Loaded, stack: ExitStack) -> tuple[Transport, Agents]:
    """The way to a vehicle, and the sockets, of a run that waits, until the stack is closed: its flight has both.
    Raises `Refused` and OSError.
    """
    transport = _open(order)
    stack.callback(transport.close)
    if isinstance(transport, UdpTransport) and order.link is None:
        stack.enter_context(_simulate(order, loaded, transport.port))
    agents = _agents(order, loaded, stack, waits=True)
    assert agents is not None  # the command line asks for one
    return transport, agents


def _wait(
    order: Launch, base: Loaded, trusted: Trusted, log_key: LogSigner, past: Past | None, clock: LinkClock,
    interrupts: Interrupts, slack: int, transport: Transport, agents: Agents, apart: Apart | None,
    absent: Refused | OSError | None,
) -> tuple[Admitted, Trusted]:  # fmt: skip
    """Wait, connected, for the bundle that flies, and under what it is trusted; the one of a flight that broke off in
    the air is not waited for. Raises `Refused`.
    """
    assert order.wait_s is not None
    with ExitStack() as stack:
        signing = _sign(order, base, clock, apart)
        stack.callback(signing.close)
        driver = _driver(replace(order, fence=False), base, slack, signing)
        vehicle = ConnectedVehicle(transport, driver, clock, lambda at_us, frame: None)
        if driver.shortfall is not None:
            raise Refused(ExitCode.REFUSED, "link-too-slow", driver.shortfall, _TOO_SLOW)
        hurried = _broke_off(past)
        events = meet(order.link, order.system, vehicle, clock, interrupts, signing, hurried=hurried, speed=order.speed)
        broken_off = None if past is None else _broken_off(order, past, base, vehicle, clock, events)
        if broken_off is not None:
            (data, loaded), under = broken_off
            same = apart if under.root == trusted.root and under.distrust is None else None  # it has the one root,
            if order.listening is not None:
                same = apart  # or its own
            try:
                admitted = Admitted(data, _taken_over(same, loaded, data, clock))
            except Refused as refused:
                say(f"note: {refused}; it is brought down all the same")
                admitted = Admitted(data, loaded)
            if not isinstance(admitted.loaded.executor, IsolatedExecutor):
                log_key.use(_log_key_here(order))
            agents.fly(admitted.loaded)
            return admitted, under
        if trusted.distrust is not None:  # what it is not enough for is to fly anything new
            raise trusted.distrust
        _expect_all(absent, resumed=False)
        notes = list(signing.notes)
        if order.link is not None:
            note, meanwhile = unqualified(
                record_of(base.vehicle, trusted.root, clock.now().utc_us, order.data), vehicle, clock
            )
            events += meanwhile
            notes += [note] if note is not None else []

        def admit(data: bytes) -> Loaded | Refusal:
            trusted.expect_latest()  # a key of it may be revoked: whoever waits for long enough flies under no old root
            return _admit(order, data, base, trusted, log_key.kid, signing, clock, apart)

        def expect() -> None:
            trusted.expect_latest()
            if apart is not None:
                apart.expect()

        waiting = Waiting(
            base, admit, expect, vehicle, clock, interrupts, agents,
            console=_console(order), most_s=order.wait_s, notes=notes,
        )  # fmt: skip
        return waiting.follow(events), trusted


def _broken_off(
    order: Launch, past: Past, base: Loaded, vehicle: ConnectedVehicle, clock: LinkClock, events: list[Event]
) -> tuple[Admitted, Trusted] | None:
    """The bundle of the flight before this run, and under what it is trusted, if that did not end, and the vehicle is
    in the air still: a restart brings it down, as `run` does that is given the same bundle again. No charge lasts
    longer than `endurance_us` after the last moment at which it could take off: what flies then is somebody else's.

    Raises `Refused`, and OSError for a bundle that cannot be read.
    """
    if past.broken_off is None or not still_flies(vehicle, clock, events):
        return None
    data = read_regular(past.broken_off / BUNDLE, MAX_BUNDLE)
    trusted, _, loaded = _trusting(replace(order, wait_s=None), data, clock, base.in_force.flight)
    landed = clock.now().utc_us > loaded.expires_us + loaded.bundle.policy.vehicle.endurance_us
    return None if landed or not_opened(_left_in(order), loaded) is None else (Admitted(data, loaded), trusted)


def _admit(
    order: Launch, data: bytes, base: Loaded, trusted: Trusted, log_key: bytes, signing: Signing, clock: LinkClock,
    apart: Apart | None = None,
) -> Loaded | Refusal:  # fmt: skip
    """What `run` asks of a bundle before it connects, of one that was handed in; and that its policy is the one that is
    waited under; and that the boundary takes it. It flies as the flight that the sockets tell of.
    """
    try:
        loaded = _load(order, data, trusted.root, clock.now(), base.in_force.flight)
        if loaded.bundle.policy_digest != base.bundle.policy_digest:
            theirs, ours = loaded.bundle.policy, base.bundle.policy
            text = (
                f"it is under {theirs.name}@{theirs.version}, and this vehicle waits under {ours.name}@{ours.version}"
            )
            return Refusal("other-policy", text, "the policy's envelope is that of the bundle that is waited with")
        if loaded.bundle.mission_digest == base.bundle.mission_digest:  # an agent has it; a person may have signed
            text = "it is the bundle that is waited with: that says the policy, and its own mission does not fly"
            return Refusal("waited-with", text, "sign a mission of your own under its policy")
        _expect_current(_lapsed(data, trusted.signed, log_key, loaded, clock), resumed=False)
        _hear(order, loaded, signing)
        _expect_fresh(loaded, clock)
    except Refused as refused:
        return Refusal(refused.slug, str(refused), refused.help or "")
    refusal = not_opened(_left_in(order), loaded)
    return refusal or (loaded if apart is None else apart.admit(data, clock.now()))


def _hold(incidents: "Incidents", ending: Ending, code: ExitCode, lines: Iterable[bytes], feed: Feed) -> ExitCode:
    """Tell what came of the scenario; the exit code that follows."""
    for text in incidents.happened:
        feed.post(Note(f"the scenario: {text}"))
    met = incidents.met(ending, list(lines))
    for each in met:
        feed.post(Note(f"{'met' if each.met else 'NOT MET'}: {each.expectation.text}: {each.found}"))
    left = len(incidents.scenario.expectations) - len(met)
    if left:
        feed.post(
            Note(f"{left} more of what is expected is for `rtshcua test`, which knows where the vehicle really was")
        )
    return code if all(each.met for each in met) else ExitCode.TESTS


def expect_no_source(path: Path) -> None:
    """Raises `Refused` for a source in the place of a bundle."""
    if path.suffix == ".rts":  # what names it elsewhere is of the ground
        advice = f"`rtshcua compile {path} -o {path.stem}.bundle` makes one of it"
        raise Refused(ExitCode.INPUT, "wrong-kind", f"`{path}` is a source, and no bundle", advice)
    mistaken = no_bundle(path)
    if mistaken is not None:
        raise Refused(ExitCode.INPUT, mistaken.slug, str(mistaken), mistaken.help)


def _read(path: Path) -> bytes:
    data = read_regular(path, MAX_BUNDLE)
    expect_no_source(path)
    if len(data) > MAX_BUNDLE:
        raise Refused(ExitCode.INPUT, "too-large", f"`{path}` is larger than a bundle may be")
    kind = kind_of_document(data)
    if kind is not None:
        raise Refused(ExitCode.INPUT, "wrong-kind", f"`{path}` is no bundle, but `{kind.name}`", HANDED_IN[kind])
    return data


def _trusting(
    order: Launch, bundle: bytes, clock: LinkClock, flight: bytes | None = None
) -> tuple[Trusted, SigningKey | VerificationKey, Loaded]:
    """The trust root that counts, the key that will sign the log, and the bundle under that root, as a flight of this
    id, or else of a new one. Raises `Refused`.

    Where the root does not follow from the one that was accepted last, or has expired, or a key of the bundle or the
    log has, or is revoked, a run of this bundle may still have broken off in the air: then it is brought down under the
    root that was given.
    """
    now_us = clock.now().utc_us
    try:
        trusted = trust(order.roots, order.data, order.state, _vehicle(order, bundle), now_us)
        key = _log_key(order)
        loaded = _loading(order, bundle, trusted, key, clock, flight)
    except Untrusted as error:
        raise Refused(code_of(error.slug), *untrusted(error)) from None
    except Refused as refused:
        for each in trusted.before(refused):
            with suppress(Refused):
                trusted, loaded = each, _loading(order, bundle, each, key, clock, flight)
                break
        else:
            trusted.expect()
            raise
    if trusted.distrust is not None and (order.dry_run or not _may_have_flown(order, loaded)):
        raise trusted.distrust
    return trusted, key, loaded


def _log_key(order: Launch) -> SigningKey | VerificationKey:
    """The key that signs the log; the public half of it where a boundary that listens has it."""
    if isinstance(order.listening, ListeningBoundary):
        assert order.listening.log_public is not None
        return VerificationKey(Duty.LOG, order.listening.log_public)
    return _log_key_here(order)


def _log_key_here(order: Launch) -> SigningKey:
    """The key by which this process signs the log; one that is drawn, and nobody knows, for what comes down without the
    boundary that has it.
    """
    if order.boundary_socket is not None:
        return SigningKey.from_seed(secrets.token_bytes(SEED_BYTES), duty=Duty.LOG, development=True)
    return unlock(KeyStore(order.data), Duty.LOG, path=order.log_key, passphrase_file=order.passphrase_file)


def _signed_by(
    trusted: Trusted, key: SigningKey | VerificationKey, loaded: Loaded
) -> tuple[Trusted, LogSigner, Loaded]:
    """What `_trusting` found, its key in the hands of who signs the log, and of nobody else."""
    return trusted, LogSigner(key), loaded


def _signs_no_more(_checkpoint: bytes) -> Refusal:
    return Refusal("log-begun", "the log has begun")


def _loading(
    order: Launch, bundle: bytes, trusted: Trusted, key: SigningKey | VerificationKey, clock: LinkClock,
    flight: bytes | None,
) -> Loaded:  # fmt: skip
    """The bundle under a root; under one that is not to be trusted any more, whatever has expired since."""
    now = clock.now()
    if trusted.distrust is not None:
        now = Now(now.monotonic_us, 0, now.utc_error_us)
    if not isinstance(order.listening, Refused):
        _expect_log_key(key, trusted.root)
    loaded = _load(order, bundle, trusted.root, now, flight)
    _expect_current(_unverifiable(trusted.root, key.kid, loaded.vehicle, now.utc_us), resumed=False)
    return loaded


def _unverifiable(root: TrustRoot, log_key: bytes, vehicle: str, now_us: int) -> Refused | None:
    """Why nobody could verify a log that the key of this name signs now; None where they could."""
    named = root.keys_for(Duty.LOG).get(log_key)  # none: `_log_key_here`
    refusal = None if named is None else key_refusal(named, vehicle=vehicle, now_us=now_us)
    if refusal is None:
        return None
    text = f"the log key {log_key.hex()} may not speak for `{vehicle}` now: nobody could verify the log"
    return Refused(code_of(refusal), refusal, text, "`--log-key` gives one that may; `rtshcua keys replace` makes it")


def _may_have_flown(order: Launch, loaded: Loaded) -> bool:
    if order.wait_s is not None:
        return True  # another bundle than this one, which is known once the vehicle is met (`_broken_off`)
    try:
        return flown_before(_left_in(order), loaded) is not None
    except OSError:
        return True


def _vehicle(order: Launch, bundle: bytes) -> str | None:
    """Who the vehicle is, also by a bundle that nobody verified yet; None where it does not say."""
    try:
        return order.vehicle or claimed_vehicle(bundle)
    except Untrusted:
        return None


def _expect_log_key(key: SigningKey | VerificationKey, root: TrustRoot) -> None:
    if key.kid in root.revocations:
        text = f"the trust root revokes the log key {key.kid.hex()}"
        raise Refused(ExitCode.UNTRUSTED, REVOKED, text, "`--log-key` gives the one that took its place")
    if key.kid not in root.keys_for(Duty.LOG):
        text = f"the trust root names no log key {key.kid.hex()}: nobody could verify the log"
        raise Refused(ExitCode.UNTRUSTED, "unknown-key", text, "`--log-key` gives one that it names")


def _utc(order: Launch, clock: LinkClock) -> UtcWatch:
    """Who vouches for UTC; a simulation has that of the machine that it runs on. A rehearsal, which is decided here,
    takes what the boundary of a flight would take.
    """
    if order.link is not None and order.speed == 1:
        apart = order.dry_run and order.mode is EnforcementMode.PROCESS
        counts = vehicle_counts(apart=apart, keyed=order.signing_key is not None)
        return UtcWatch(clock, order.utc_error_us, vehicle=counts)
    return UtcWatch.simulated(clock)


def _follow(utc: UtcWatch, apart: Apart | None) -> None:
    """What a boundary that runs apart takes for the time of day counts here too."""
    if apart is not None:
        utc.follow(apart.time)


def _utc_notes(utc: UtcWatch, apart: Apart | None, *, listens: bool) -> list[str]:
    """That the time of day is not known, and what helps."""
    if not utc.waits:
        return []
    if listens:
        return [LISTENING_UTC_NOTE]
    unkeyed = apart is not None and apart.process.link_name is None
    return [APART_UTC_NOTE if unkeyed or not utc.vehicle_counts else UTC_NOTE]


def _lapsed(bundle: bytes, signed_root: bytes, log_key: bytes, loaded: Loaded, clock: LinkClock) -> Refused | None:
    """Why what was verified by this machine's time of day, or before a wait, does not hold by the vehicle's now; None
    where it does. `log_key` names the one that signs the log.
    """
    now_us = clock.now().utc_us
    try:
        root = open_root(signed_root, pinned=cose.unverified(signed_root, limit=MAX_ROOT).kid, now_us=now_us)
        open_bundle(bundle, root=root, vehicle=loaded.vehicle, now_us=now_us)
    except Untrusted as error:
        return Refused(code_of(error.slug), *untrusted(error))
    return _unverifiable(root, log_key, loaded.vehicle, now_us)


def _expect_current(lapsed: Refused | None, *, resumed: bool) -> None:
    if lapsed is not None and not resumed:
        raise lapsed


def _expect_fresh_at_first(order: Launch, loaded: Loaded, clock: LinkClock, *, owes: bool) -> None:
    """Where it is known already, a mission that is too old begins nothing; but what may hang in the air is looked for,
    and what is owed to the vehicle is put back. One that is waited with says the policy alone.
    """
    vain = order.wait_s is None and (order.link is None or not (owes or _may_have_flown(order, loaded)))
    if vain:
        _expect_fresh(loaded, clock)


def _not_begun(order: Launch, loaded: Loaded, clock: LinkClock) -> str | None:
    """Why a flight of the bundle would not begin, in words."""
    late = expired(loaded, clock.now())
    return flown_before(_left_in(order), loaded) or (None if late is None else f"{late.text}; {late.help}")


def _expect_fresh(loaded: Loaded, clock: LinkClock) -> None:
    refusal = expired(loaded, clock.now())
    if refusal is not None:
        raise Refused(ExitCode.REFUSED, *refusal)


def _load(order: Launch, bundle: bytes, root: TrustRoot, now: Now, flight: bytes | None = None) -> Loaded:
    """The bundle in force, as a flight of this id, or else of a new one. Raises `Refused`."""
    identity = order.vehicle
    if identity is None:
        try:
            identity = open_bundle(bundle, root=root, vehicle=None, now_us=now.utc_us).policy.vehicle.identity
        except Untrusted as error:
            raise Refused(code_of(error.slug), *untrusted(error)) from None
    loaded = load(
        bundle, root=root, vehicle=identity, now=now, mode=_HERE.get(order.mode, order.mode),
        session_key=secrets.token_bytes(SESSION_KEY_BYTES), flight=flight or secrets.token_bytes(FLIGHT_BYTES),
        peer_is_own_simulator=order.link is None, settings=order.settings,
    )  # fmt: skip
    if isinstance(loaded, Refusal):
        code = ExitCode.REFUSED if loaded.slug in _NOT_HERE else code_of(loaded.slug)
        help = IDENTITY_HELP if loaded.slug == "wrong-vehicle" else ""
        raise Refused(code, loaded.slug, loaded.text, loaded.help or help)
    return loaded


def _sign(order: Launch, loaded: Loaded, clock: LinkClock, apart: Apart | None = None) -> Signing:
    """What signs the link; where the boundary that decides runs apart, that one, and its key is not read here."""
    gate = loaded.executor.frames
    process = apart.process if apart is not None and isinstance(gate, IsolatedGate) else None
    try:
        signing = Signing(
            order.signing_key if process is None else None, loaded.bundle.policy, gate, order.state, clock,
            unsigned_radio=order.unsigned_radio, even_damaged=not order.dry_run,
        )  # fmt: skip
        if process is not None and isinstance(gate, IsolatedGate):
            if order.boundary_socket is not None:
                signing.notes.append(
                    f"the boundary at `{order.boundary_socket}` decides, by keys and a root of its own"
                )
            if process.missing:
                signing.notes.append(f"the boundary runs without {'; without '.join(process.missing)}")
            if process.link_name is not None:
                policy, radio = loaded.bundle.policy, order.unsigned_radio
                signing.elsewhere(process.link_name, gate, policy, unsigned_radio=radio)
    except LinkKeyError as error:
        raise _of_link_key(error) from None
    if order.unbuilt:
        signing.notes.append(f"{UNBUILT}: {UNBUILT_HELP}")
    if signing.name is None and order.link is not None and not order.link.is_loopback:
        signing.notes.append(
            f"`{order.link}` has no key: whoever reaches it can speak as the vehicle (`--signing-key`)"
        )
    return signing


def _of_link_key(error: LinkKeyError) -> Refused:
    return Refused(code_of(error.slug), f"link-key-{error.slug}", str(error), error.help)


def _expect_kept(signing: Signing, *, resumed: bool) -> None:
    """What keeps the link's timestamps from being known or kept keeps a vehicle on the ground, and none in the air."""
    match signing.damage:
        case None:
            return
        case error if resumed:
            reason = str(error) if isinstance(error, LinkKeyError) else words_of(error)
            signing.notes.append(f"{reason}; it is brought down all the same. The link needs a new key then")
        case LinkKeyError() as error:
            raise _of_link_key(error)
        case error:
            raise error


def _expect_link_key(signing: Signing, root: TrustRoot, *, resumed: bool) -> None:
    if signing.name is None or signing.name not in root.revocations:
        return
    text = f"the trust root revokes the link's key {signing.name.hex()}"
    if not resumed:
        raise Refused(ExitCode.UNTRUSTED, "link-key-revoked", text, "a new key on both ends; `rtshcua keys link`")
    signing.notes.append(f"{text}; it is brought down all the same")


def _hear(order: Launch, loaded: Loaded, signing: Signing) -> None:
    """A mission that would break off in the air for a signal that cannot come does not begin; a rehearsal tells."""
    steps = stranded(loaded.bundle.policy, loaded.bundle.mission, signing.unheard)
    if steps and not order.dry_run:
        first = call(loaded.bundle.policy, steps[0])
        raise Refused(
            ExitCode.REFUSED, "signal-unsigned",
            f"`{first}` needs a signal of RADIO_STATUS, which radios do not sign: it would wait for it in vain",
            "`--unsigned-radio` takes it unsigned, and the worst of the last seconds counts",
        )  # fmt: skip


def _driver(order: Launch, loaded: Loaded, slack: int, signing: Signing) -> Driver:
    policy = loaded.bundle.policy
    try:
        own = manoeuvres(packs_of(policy.sources))
    except BrokenPack as error:
        raise Refused(ExitCode.REFUSED, "broken-pack", error.text) from None
    try:
        make = Driver if order.sortie is None else order.sortie.driver
        return make(
            policy,
            loaded.executor.frames,
            slack,
            fence=order.fence and not order.dry_run,
            manoeuvres=own,
            verifier=signing.verifier,
            system=order.system,
            steps=loaded.bundle.mission.invocations,
            meant=order.settings if order.dry_run else None,
        )
    except UnknownSource as error:
        raise Refused(ExitCode.REFUSED, "unknown-source", str(error)) from None


def _open(order: Launch) -> Transport:
    """The way to the vehicle; to our own simulated one, a port that the system chooses. Raises `Refused`."""
    if order.transport is not None:
        return order.transport
    link = order.link
    if link is None:
        link = Address(LinkCarrier.UDP_IN, _LOOPBACK, 0)
    try:
        return open_transport(link)
    except OSError as error:
        raise Refused(ExitCode.LINK, *unopened(link, error)) from None


def _simulate(order: Launch, loaded: Loaded, port: int) -> Simulator:
    words = [*simulated.of_policy(loaded.bundle.policy), *order.simulator]
    if order.signing_key is not None:
        words += ["--signing-key", str(order.signing_key)]
    try:
        return Simulator(["--port", str(port), "--speed", f"{order.speed:g}", *words])
    except SimulatorError as error:
        raise Refused(ExitCode.LINK, "simulator", str(error)) from None
