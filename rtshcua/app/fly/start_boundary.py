"""The stage that starts the boundary: in this process, in one of its own, or one that listens and has the keys."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from errno import ENOSPC
from functools import partial
from pathlib import Path
from typing import Final, NamedTuple, TypeAlias

from msgspec.structs import replace

from rtshcua.adapters.boundary.home import BoundaryError, BoundaryHome
from rtshcua.adapters.boundary.process import BoundaryProcess, ListeningBoundary
from rtshcua.adapters.boundary.trustzone_m import SecureWorld
from rtshcua.adapters.clock import UTC_ERROR_US
from rtshcua.adapters.store.signing import LinkKeyError
from rtshcua.adapters.store.vehicle_records import BoundaryStore, DamagedState
from rtshcua.adapters.vehicle.transport import Transport
from rtshcua.app.exit_codes import code_of, untrusted, words_of
from rtshcua.app.fly.agents import Agents
from rtshcua.app.fly.flight_request import FlightContext, FlightRequest
from rtshcua.app.fly.previous_log import LogBefore
from rtshcua.app.fly.vehicle_trust import Trusted
from rtshcua.app.fly.verify_bundle import LogSigner, Verified, load_bundle, local_log_key, may_have_flown
from rtshcua.decision.checks.home_fit import exceeded
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.home_limits import TRUSTZONE_M
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement.executor import Commands
from rtshcua.onboard.enforcement.isolated import Caller, IsolatedExecutor, IsolatedGate, OwnTime
from rtshcua.onboard.enforcement.load import SESSION_KEY_BYTES, EnforcementMode, Loaded, load
from rtshcua.onboard.enforcement.preparation import SETTABLE, Owed
from rtshcua.onboard.ports import BoundaryKey
from rtshcua.wire import cose
from rtshcua.wire.boundary_chain import START
from rtshcua.wire.bundle import open_bundle
from rtshcua.wire.document import FLIGHT_BYTES
from rtshcua.wire.keys import Duty, SigningKey, key_id
from rtshcua.wire.preparation import ParameterWrite, Preparation, encode
from rtshcua.wire.trust import MAX_ROOT, TrustRoot, key_refusal
from rtshcua.wire.untrusted import Untrusted

#: why nothing begins where another run has the boundary of the vehicle
IN_USE: Final = "boundary-in-use"
#: what is said of a flight that nothing inside signs
UNNAMED: Final = (
    "the trust root names no boundary key for it: what is decided is not signed inside (`rtshcua keys boundary`)"
)

#: how a run ends, by why its boundary does not begin or take the bundle; REFUSED where none is named
_CODES: Final = {
    "in-use": ExitCode.REFUSED,
    "damaged": ExitCode.INPUT,
    "not-kept": ExitCode.FULL,
    "untrusted": ExitCode.UNTRUSTED,
}
_KEY_HELP: Final = "`--boundary-key` gives one that it names; `rtshcua keys boundary` makes it"
#: why nothing is signed inside, where the boundary that listens does not decide
KEYLESS: Final = Refusal(
    "no-boundary-key", "what is decided is not signed inside: the boundary has the key", "", ExitCode.INPUT
)


# ---------------------------------------------------------------- the keys of a flight, and who has them


class HeldByBoundary:
    """In place of the boundary's key: the boundary's process has it, and nobody here."""


#: the key that the boundary signs with; None where the trust root asks for none
OwnKey: TypeAlias = SigningKey | HeldByBoundary | None


def boundary_key(
    root: TrustRoot, vehicle: str, now_us: int, unlock: Callable[[Duty, Path | None], SigningKey], path: Path | None
) -> SigningKey | Refusal | None:
    """The key that the boundary signs with, from a file or else the key store; None where the root asks for none."""
    good = _named(root, vehicle, now_us)
    if not good:
        return None
    try:
        key = unlock(Duty.BOUNDARY, path)
    except Untrusted as error:
        return untrusted(error)
    except FileNotFoundError as error:
        text = f"the trust root asks for what the boundary signs, and its key is not here: `{error.filename}`"
        return Refusal("no-boundary-key", text, _KEY_HELP, ExitCode.INPUT)
    return _unnamed(key.kid, good, vehicle) or key


def held_by_boundary(
    root: TrustRoot, vehicle: str, now_us: int, public: bytes | None
) -> HeldByBoundary | Refusal | None:
    """What stands for the key of a boundary that listens, of which it said the public half, None where it has none;
    None where the root asks for none.
    """
    good = _named(root, vehicle, now_us)
    if not good:
        return None
    if public is None:
        text = "the trust root asks for what the boundary signs, and the boundary has no key"
        return Refusal(
            "no-boundary-key", text, "`boundary.seed` of its folder; `rtshcua keys provision`", ExitCode.INPUT
        )
    return _unnamed(key_id(Duty.BOUNDARY, public), good, vehicle) or HeldByBoundary()


def own_key_of(context: FlightContext, root: TrustRoot, loaded: Loaded) -> OwnKey | Refusal:
    """The key that the boundary of a flight signs with, or why there is none."""
    now_us, listening = context.clock.now().utc_us, context.listening
    if isinstance(listening, Refusal):
        return KEYLESS
    if listening is not None:
        return held_by_boundary(root, loaded.vehicle, now_us, listening.own_public)
    return boundary_key(root, loaded.vehicle, now_us, context.console.unlock, context.request.boundary_key)


def _named(root: TrustRoot, vehicle: str, now_us: int) -> set[bytes]:
    """The boundary keys that the root trusts for a vehicle now."""
    named = root.keys_for(Duty.BOUNDARY)
    return {kid for kid, key in named.items() if key_refusal(key, vehicle=vehicle, now_us=now_us) is None}


def _unnamed(kid: bytes, good: set[bytes], vehicle: str) -> Refusal | None:
    if kid in good:
        return None
    text = f"the trust root names no boundary key {kid.hex()} for `{vehicle}`: nobody could verify the log"
    return Refusal("unknown-key", text, _KEY_HELP, ExitCode.UNTRUSTED)


class StartedBoundary:
    """One flight's session of a boundary, with or without a key. `note` is what there is to tell of it. `aloft`: the
    vehicle comes down whatever the state folder says.
    """

    def __init__(self, store: BoundaryStore, key: BoundaryKey | None, note: str, *, aloft: bool) -> None:
        self.key = key
        self.note = note
        self._store = store
        self._aloft = aloft
        self._session = 0 if key is None else key.session

    @classmethod
    def open(cls, store: BoundaryStore, key: OwnKey, *, aloft: bool) -> "StartedBoundary | Refusal":
        """The session after the last one, where nobody knows of one for a vehicle that is `aloft`. Raises OSError."""
        if key is None:
            return cls(store, None, "", aloft=aloft)
        number, digest, note = 0, START, ""
        try:
            kept = store.kept()
            number, digest = kept.session + 1, kept.digest
        except (DamagedState, OSError) as error:
            if not aloft and isinstance(error, OSError):
                raise
            if not aloft:
                help = "without that file the boundary begins to count anew, and no log shows that it did not before"
                return Refusal("damaged", str(error), help, ExitCode.INPUT)
            note = f"{error}; it is brought down all the same"
        held = key if isinstance(key, SigningKey) else None
        return cls(store, BoundaryKey(held, number, digest), note, aloft=aloft)

    def begun(self, digest: bytes, session: int | None) -> None:
        """The session began, under this number: a boundary of its own process counts itself. Raises OSError where none
        began, or that cannot be kept; not for a vehicle that is `aloft`.
        """
        if self.key is not None and session is None and not self._aloft:
            raise OSError(ENOSPC, "the boundary's process cannot keep that its session begins")
        if self.key is not None and session is not None and session != self._session:
            self.note = (
                f"the state folder counts {max(0, self._session - 1)} sessions of the boundary, its own process "
                f"{session - 1}: the folder was put back to what it was, or lost"
            )
            self._session = session
        try:
            self._keep(digest)
        except OSError:
            if not self._aloft:
                raise

    def ended(self, digest: bytes) -> None:
        """It ended in order. Where that cannot be kept, the next one takes it for broken off."""
        with suppress(OSError):
            self._keep(digest)

    def _keep(self, digest: bytes) -> None:
        if self.key is not None and self.key.session:  # what is damaged stays so, for a person to see
            self._store.keep(self._session, digest)


# ---------------------------------------------------------------- a boundary of its own process


def connect_boundary(path: Path, *, paced: bool) -> ListeningBoundary | Refusal:
    """A boundary that listens, until `close`. `paced`: the run's time is not the machine's."""
    try:
        found = ListeningBoundary(path)
    except BoundaryError as error:
        return _not_begun(error)
    if paced and found.own_clock:
        found.close()
        text = f"the boundary at `{path}` decides by its own clock, and `--speed` is another"
        return Refusal("boundary-not-begun", text, "without `--speed`", ExitCode.REFUSED)
    return found


def start_home(
    request: FlightRequest, vehicle: str, signed_root: bytes, own_key: SigningKey | None, log_key: SigningKey,
    owed: Mapping[str, Owed],
) -> BoundaryHome | Refusal:  # fmt: skip
    """A boundary that is started for one run, until `close`. Raises OSError."""
    pinned = cose.unverified(signed_root, limit=MAX_ROOT).kid
    process = request.mode is EnforcementMode.PROCESS
    make = partial(BoundaryProcess, user=request.boundary_user) if process else SecureWorld
    try:
        return make(
            signed_root, pinned, vehicle, request.kept_in, link_key=request.signing_key, paced=request.speed != 1,
            own_seed=None if own_key is None else own_key.private.private_bytes_raw(),
            log_seed=log_key.private.private_bytes_raw(),
            settings=_listed({name: Owed(0, value) for name, value in request.settings.items()}), owed=_listed(owed),
            utc_error_us=UTC_ERROR_US if request.link is None else request.utc_error_us,
        )  # fmt: skip
    except BoundaryError as error:
        return _not_begun(error)
    except LinkKeyError as error:
        return of_link_key(error)


def of_link_key(error: LinkKeyError) -> Refusal:
    """That a link's key cannot be used."""
    return Refusal(f"link-key-{error.slug}", str(error), error.help or "", code_of(error.slug))


def _not_begun(error: BoundaryError) -> Refusal:
    return Refusal(f"boundary-{error.slug}", str(error), error.help, _CODES.get(error.slug, ExitCode.REFUSED))


def _listed(parameters: Mapping[str, Owed]) -> bytes | None:
    """Parameters as a boundary is given them when it begins; None where there are none that may be set."""
    writes = tuple(ParameterWrite(name, *each) for name, each in parameters.items() if name in SETTABLE)
    return encode(Preparation(0, False, 0, writes)) if writes else None


class BoundaryClient:
    """This end of a boundary of its own process, for one run under one trust root."""

    def __init__(
        self, home: BoundaryHome, mode: EnforcementMode, vehicle: str, root: TrustRoot, settings: Mapping[str, int]
    ) -> None:
        self.process, self._mode = home, mode
        self._vehicle, self._root, self._settings = vehicle, root, settings
        self._caller = Caller(home.call, signs=home.link_name is not None, part=home.part, most_ahead=home.most_ahead)

    def flight(self) -> bytes | Refusal:
        """The id of the flight that begins next."""
        answer = self._caller.flight()
        lost = self.lost()
        if lost is not None:
            return lost
        assert isinstance(answer, bytes)
        return answer

    def time(self, settle: bool) -> OwnTime | None:
        """What its own clock says; None of one that is gone. `settle`: no more is waited for."""
        answer = self._caller.time(settle=settle)
        return None if isinstance(answer, Refusal) else answer

    def sign_log(self, checkpoint: bytes) -> bytes | Refusal:
        """The signature of the log's key under the checkpoint that begins the log of the flight, once."""
        return self._caller.sign_log(checkpoint)

    def waiting(self, base: Loaded) -> Loaded:
        """What is waited with, in this process: what leaves meanwhile, leaves by the boundary."""
        commands = Commands(base.bundle.policy, base.bundle.mission)
        executor = IsolatedExecutor(self._caller, commands, IsolatedGate(self._caller, commands))
        return replace(base, executor=executor, mode=self._mode)

    def load(self, bundle: bytes, now: Now) -> Loaded | Refusal:
        """Have it open a bundle, in place of the one before."""
        unfit = self._unfit(bundle, now)
        if unfit:
            text = f"the bundle does not fit in the secure world: {', '.join(unfit)}"
            return Refusal("boundary-too-large", text, "`--mode process` has room for it", ExitCode.REFUSED)
        loaded = load(
            bundle, root=self._root, vehicle=self._vehicle, now=now, mode=self._mode,
            session_key=bytes(SESSION_KEY_BYTES), flight=bytes(FLIGHT_BYTES), peer_is_own_simulator=False,
            settings=self._settings, caller=self._caller,
        )  # fmt: skip
        if isinstance(loaded, Refusal):
            text = f"the boundary refuses the bundle: {loaded.text} ({loaded.slug})"
            return Refusal(f"boundary-{loaded.slug}", text, loaded.help, _CODES.get(loaded.slug, ExitCode.REFUSED))
        return loaded

    def _unfit(self, bundle: bytes, now: Now) -> tuple[str, ...]:
        """What of a bundle is too large for its home, in words; nothing of one that is not to be trusted."""
        if self._mode is not EnforcementMode.TRUSTZONE_M:
            return ()
        try:
            opened = open_bundle(bundle, root=self._root, vehicle=self._vehicle, now_us=now.utc_us)
        except Untrusted:
            return ()
        return exceeded(opened.policy, opened.mission, len(bundle), TRUSTZONE_M)

    def admit(self, bundle: bytes, now: Now) -> Loaded | Refusal:
        """Have it open a bundle that nothing flies of yet, in place of the one before."""
        loaded = self.load(bundle, now)
        if not isinstance(loaded, Refusal) and self._caller.reopened:
            text = f"the boundary opened this bundle before on `{self._vehicle}`: a bundle flies once"
            return Refusal("boundary-replayed", text, "compile the mission again, which issues it anew")
        return loaded

    def lost(self) -> Refusal | None:
        """That it is gone, so that nothing more leaves; None while it is there."""
        if not self._caller.lost:
            return None
        text = "the boundary is gone: nothing more is sent"
        return Refusal("boundary-lost", text, "", ExitCode.REFUSED)


# ---------------------------------------------------------------- the stage


class Begun(NamedTuple):
    """What flies: its bundle, in force; under what it is trusted; who signs its log; the key that the boundary signs
    with, or why there is none; the boundary, where it runs apart, or why it is `absent`. A run that waited has its link
    and its sockets already.
    """

    bundle: bytes
    loaded: Loaded
    trusted: Trusted
    log_key: LogSigner
    own_key: OwnKey | Refusal
    apart: BoundaryClient | None
    absent: Refusal | OSError | None
    transport: Transport | None = None
    agents: Agents | None = None

    def boundary_refusal(self) -> Refusal | None:
        """Why the boundary is absent, with which nothing new flies. Raises OSError where that is why."""
        if isinstance(self.absent, OSError):
            raise self.absent
        return self.absent

    @property
    def why_absent(self) -> str:
        """Why the boundary is absent, in words; empty where it is not."""
        if self.absent is None:
            return ""
        return words_of(self.absent) if isinstance(self.absent, OSError) else self.absent.text


def start_boundary(
    context: FlightContext, verified: Verified, previous: LogBefore | None, owed: Mapping[str, Owed]
) -> Begun | Refusal:
    """The boundary begins, until the flight is over, and takes the bundle, unless another one is waited for. Where it
    does not, and a vehicle may hang in the air, it is the one in this process; also where the boundary of a run that is
    gone still holds the vehicle. Raises OSError.
    """
    request, (bundle, loaded, trusted, log_key) = context.request, verified
    own_key = own_key_of(context, trusted.root, loaded)
    if isinstance(own_key, Refusal) and request.dry_run:
        return own_key
    held: OwnKey = None if isinstance(own_key, Refusal) else own_key
    started: tuple[BoundaryClient | None, Loaded] | Refusal | OSError
    try:
        started = _start(context, verified, held, owed)
    except OSError as error:
        started = error
    if isinstance(started, Refusal | OSError):
        absent = started
        broke_off = previous is not None and previous.broken_off is not None
        hangs = broke_off if request.wait_s is not None else may_have_flown(request, loaded)
        in_use = isinstance(absent, Refusal) and absent.slug == IN_USE
        if not hangs or (in_use and not broke_off):
            if isinstance(absent, OSError):
                raise absent
            return absent
        if request.boundary_socket is not None:
            log_key.use(local_log_key(context))
            own_key = KEYLESS
        return Begun(bundle, loaded, trusted, log_key, own_key, None, absent)
    apart, loaded = started
    if apart is not None:
        log_key.hand_over(apart.sign_log)
        if isinstance(own_key, SigningKey):
            own_key = HeldByBoundary()  # it is not held here
    return Begun(bundle, loaded, trusted, log_key, own_key, apart, None)


def _start(
    context: FlightContext, verified: Verified, own_key: OwnKey, owed: Mapping[str, Owed]
) -> tuple[BoundaryClient | None, Loaded] | Refusal:
    """A boundary that runs apart, where that is asked for, and the bundle in force where decisions are made. Raises
    OSError.
    """
    request, (bundle, loaded, trusted, _) = context.request, verified
    apart = _open(context, verified, own_key, owed)
    if isinstance(apart, Refusal):
        return apart
    taken: Loaded | Refusal = loaded
    if request.wait_s is None:
        taken = loaded if apart is None else apart.load(bundle, context.clock.now())
    elif apart is not None:  # it draws the id of the flight that the sockets tell of
        flight = apart.flight()
        if isinstance(flight, Refusal):
            return flight
        base = load_bundle(request, bundle, trusted.root, context.clock.now(), flight)
        taken = base if isinstance(base, Refusal) else apart.waiting(base)
    return taken if isinstance(taken, Refusal) else (apart, taken)


def _open(
    context: FlightContext, verified: Verified, own_key: OwnKey, owed: Mapping[str, Owed]
) -> BoundaryClient | Refusal | None:  # fmt: skip
    """A boundary that runs apart, where that is asked for, until the flight is over. What may have expired is brought
    down by the one in this process, which does not ask, but where one listens: that has a trust root of its own. Raises
    OSError.
    """
    request, process, (_, loaded, trusted, log_key) = context.request, context.listening, verified
    if isinstance(process, Refusal):
        return process
    if process is not None:
        return BoundaryClient(process, EnforcementMode.PROCESS, loaded.vehicle, trusted.root, request.settings)
    if not request.mode.apart or request.dry_run or trusted.distrust is not None:
        return None
    assert not isinstance(own_key, HeldByBoundary)
    started = start_home(request, loaded.vehicle, trusted.signed, own_key, log_key.key(), owed)
    if isinstance(started, Refusal):
        return started
    context.resources.callback(started.close)
    return BoundaryClient(started, request.mode, loaded.vehicle, trusted.root, request.settings)
