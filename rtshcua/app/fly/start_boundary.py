"""The stage that starts the boundary: in this process, in its own process, or as a listening boundary."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from errno import ENOSPC
from functools import partial
from pathlib import Path
from typing import Final, NamedTuple, TypeAlias

from msgspec.structs import replace

from rtshcua.adapters.boundary.home import BoundaryError, BoundaryHome
from rtshcua.adapters.boundary.optee import TrustedApplication
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

#: the interval of reports while a machine boots, in s
_BOOTS_S: Final = 3
#: the slug if another run uses the boundary of the vehicle
IN_USE: Final = "boundary-in-use"
#: the note of a flight whose boundary does not sign
UNNAMED: Final = (
    "the trust root names no boundary key for this vehicle: the boundary does not sign its decisions (`rtshcua "
    "keys boundary`)"
)

#: the exit code by the slug of the boundary's refusal; REFUSED for any other slug
_CODES: Final = {
    "in-use": ExitCode.REFUSED,
    "damaged": ExitCode.INPUT,
    "not-kept": ExitCode.FULL,
    "untrusted": ExitCode.UNTRUSTED,
}
_KEY_HELP: Final = "select a key that the root names with `--boundary-key`; `rtshcua keys boundary` makes one"
#: the refusal if the listening boundary has the key but does not decide
KEYLESS: Final = Refusal(
    "no-boundary-key",
    "the boundary does not sign its decisions: the listening boundary has the key",
    "",
    ExitCode.INPUT,
)


# ---------------------------------------------------------------- the keys of a flight, and who has them


class HeldByBoundary:
    """A placeholder for the boundary's key: only the boundary's process has the key."""


#: the key with which the boundary signs; None if the trust root requires none
OwnKey: TypeAlias = SigningKey | HeldByBoundary | None


def boundary_key(
    root: TrustRoot, vehicle: str, now_us: int, unlock: Callable[[Duty, Path | None], SigningKey], path: Path | None
) -> SigningKey | Refusal | None:
    """The boundary's signing key, from a file or else the key store; None if the root requires none."""
    valid = _valid_ids(root, vehicle, now_us)
    if not valid:
        return None
    try:
        key = unlock(Duty.BOUNDARY, path)
    except Untrusted as error:
        return untrusted(error)
    except FileNotFoundError as error:
        text = f"the trust root requires the boundary's signature, but its key is missing: `{error.filename}`"
        return Refusal("no-boundary-key", text, _KEY_HELP, ExitCode.INPUT)
    return _not_valid(key.kid, valid, vehicle) or key


def held_by_boundary(
    root: TrustRoot, vehicle: str, now_us: int, public: bytes | None
) -> HeldByBoundary | Refusal | None:
    """The placeholder for the key of a listening boundary. `public` is the public half that the boundary reported, or
    None if it has no key. Return None if the root requires no key.
    """
    valid = _valid_ids(root, vehicle, now_us)
    if not valid:
        return None
    if public is None:
        text = "the trust root requires the boundary's signature, but the boundary has no key"
        return Refusal(
            "no-boundary-key", text, "put `boundary.seed` into its folder with `rtshcua keys provision`", ExitCode.INPUT
        )
    return _not_valid(key_id(Duty.BOUNDARY, public), valid, vehicle) or HeldByBoundary()


def own_key_of(context: FlightContext, root: TrustRoot, loaded: Loaded) -> OwnKey | Refusal:
    """The signing key of the flight's boundary, its placeholder, or the refusal if it is missing."""
    now_us, listening = context.clock.now().utc_us, context.listening
    if isinstance(listening, Refusal):
        return KEYLESS
    if listening is not None:
        return held_by_boundary(root, loaded.vehicle, now_us, listening.own_public)
    return boundary_key(root, loaded.vehicle, now_us, context.console.unlock, context.request.boundary_key)


def _valid_ids(root: TrustRoot, vehicle: str, now_us: int) -> set[bytes]:
    """The ids of the boundary keys that are valid for a vehicle now."""
    named = root.keys_for(Duty.BOUNDARY)
    return {kid for kid, key in named.items() if key_refusal(key, vehicle=vehicle, now_us=now_us) is None}


def _not_valid(kid: bytes, valid: set[bytes], vehicle: str) -> Refusal | None:
    if kid in valid:
        return None
    text = f"the trust root names no boundary key {kid.hex()} for `{vehicle}`: nobody could verify the log"
    return Refusal("unknown-key", text, _KEY_HELP, ExitCode.UNTRUSTED)


class StartedBoundary:
    """One session of a boundary, with or without a key. `note` is for the user. `aloft`: the vehicle is in the air and
    must come down, so errors of the state folder are tolerated.
    """

    def __init__(self, store: BoundaryStore, key: BoundaryKey | None, note: str, *, aloft: bool) -> None:
        self.key = key
        self.note = note
        self._store = store
        self._aloft = aloft
        self._session = 0 if key is None else key.session

    @classmethod
    def open(cls, store: BoundaryStore, key: OwnKey, *, aloft: bool) -> "StartedBoundary | Refusal":
        """Open the session after the last stored one. If it cannot be read and the vehicle is `aloft`, the session has
        no number. Raises OSError.
        """
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
                help = (
                    "restore that file; without it the boundary counts its sessions from 1 again, and no log "
                    "shows the earlier ones"
                )
                return Refusal("damaged", str(error), help, ExitCode.INPUT)
            note = f"{error}; the vehicle is brought down anyway"
        held = key if isinstance(key, SigningKey) else None
        return cls(store, BoundaryKey(held, number, digest), note, aloft=aloft)

    def begun(self, digest: bytes, session: int | None) -> None:
        """Store that the session began. `session` is the number counted by the boundary. Unless `aloft`, raises OSError
        if it did not begin or cannot be stored.
        """
        if self.key is not None and session is None and not self._aloft:
            raise OSError(ENOSPC, "the boundary's process cannot store the start of its session")
        if self.key is not None and session is not None and session != self._session:
            self.note = (
                f"the state folder counts {max(0, self._session - 1)} sessions of the boundary, and its process "
                f"{session - 1}: the folder was restored from an old copy, or lost"
            )
            self._session = session
        try:
            self._keep(digest)
        except OSError:
            if not self._aloft:
                raise

    def ended(self, digest: bytes) -> None:
        """Store the regular end of the session. If that fails, the next session treats this one as broken off."""
        with suppress(OSError):
            self._keep(digest)

    def _keep(self, digest: bytes) -> None:
        if self.key is not None and self.key.session:  # a damaged file is left for the operator to see
            self._store.keep(self._session, digest)


# ---------------------------------------------------------------- a boundary of its own process


def connect_boundary(path: Path, *, paced: bool) -> ListeningBoundary | Refusal:
    """Connect to a listening boundary. The caller closes it. `paced`: the run does not use the machine's time."""
    try:
        found = ListeningBoundary(path)
    except BoundaryError as error:
        return _not_begun(error)
    if paced and found.own_clock:
        found.close()
        text = f"the boundary at `{path}` uses its own clock, which `--speed` does not change"
        return Refusal("boundary-not-begun", text, "without `--speed`", ExitCode.REFUSED)
    return found


def start_home(
    request: FlightRequest, vehicle: str, signed_root: bytes, own_key: SigningKey | None, log_key: SigningKey,
    owed: Mapping[str, Owed], progress: Callable[[int], None],
) -> BoundaryHome | Refusal:  # fmt: skip
    """Start a boundary for one run. The caller closes it. `progress` receives the seconds since a machine began to
    boot. Raises OSError.
    """
    pinned = cose.unverified(signed_root, limit=MAX_ROOT).kid
    homes: Mapping[EnforcementMode, Callable[..., BoundaryHome]] = {
        EnforcementMode.PROCESS: partial(BoundaryProcess, user=request.boundary_user),
        EnforcementMode.TRUSTZONE_M: SecureWorld,
        EnforcementMode.OPTEE: partial(TrustedApplication, progress=progress),
    }
    try:
        return homes[request.mode](
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


def _unfit_root(trusted: Trusted) -> str:
    """The limit of a home with little memory that a trust root exceeds; empty if it fits."""
    if len(trusted.root.keys) > TRUSTZONE_M["MAX_KEYS"]:
        return f"{len(trusted.root.keys)} keys (at most {TRUSTZONE_M['MAX_KEYS']})"
    if len(trusted.signed) > TRUSTZONE_M["MAX_ROOT"]:
        return f"{len(trusted.signed):,} octets (at most {TRUSTZONE_M['MAX_ROOT']:,})"
    return ""


def _boots(context: FlightContext, passed_s: int) -> None:
    """Tell a person how long the machine of the boundary boots."""
    if passed_s % _BOOTS_S == 0 and not context.console.as_json:
        context.console.say(f"OP-TEE boots in the emulator, which takes 5 to 15 s: {passed_s} s")


def of_link_key(error: LinkKeyError) -> Refusal:
    """The refusal for a link key that cannot be used."""
    return Refusal(f"link-key-{error.slug}", str(error), error.help or "", code_of(error.slug))


def _not_begun(error: BoundaryError) -> Refusal:
    return Refusal(f"boundary-{error.slug}", str(error), error.help, _CODES.get(error.slug, ExitCode.REFUSED))


def _listed(parameters: Mapping[str, Owed]) -> bytes | None:
    """Encode the settable parameters for the start of a boundary; None if there are none."""
    writes = tuple(ParameterWrite(name, *each) for name, each in parameters.items() if name in SETTABLE)
    return encode(Preparation(0, False, 0, writes)) if writes else None


class BoundaryClient:
    """The client of a boundary process, for one run under one trust root."""

    def __init__(
        self, home: BoundaryHome, mode: EnforcementMode, vehicle: str, root: TrustRoot, settings: Mapping[str, int]
    ) -> None:
        self.process, self._mode = home, mode
        self._vehicle, self._root, self._settings = vehicle, root, settings
        self._caller = Caller(home.call, signs=home.link_name is not None, part=home.part, most_ahead=home.most_ahead)

    def flight(self) -> bytes | Refusal:
        """The id that the boundary has drawn for the next flight."""
        answer = self._caller.flight()
        lost = self.lost()
        if lost is not None:
            return lost
        assert isinstance(answer, bytes)
        return answer

    def time(self, settle: bool) -> OwnTime | None:
        """The time of the boundary's clock; None if the process has ended. `settle`: await no better source."""
        answer = self._caller.time(settle=settle)
        return None if isinstance(answer, Refusal) else answer

    def sign_log(self, checkpoint: bytes) -> bytes | Refusal:
        """The signature of the checkpoint that begins the flight's log. The boundary signs it once."""
        return self._caller.sign_log(checkpoint)

    def waiting(self, base: Loaded) -> Loaded:
        """`base` with an executor that sends all frames through the boundary, for the wait."""
        commands = Commands(base.bundle.policy, base.bundle.mission)
        executor = IsolatedExecutor(self._caller, commands, IsolatedGate(self._caller, commands))
        return replace(base, executor=executor, mode=self._mode)

    def load(self, bundle: bytes, now: Now) -> Loaded | Refusal:
        """Let the boundary open a bundle in place of the previous one."""
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
        """Descriptions of what is too large in a bundle for its home; empty for an untrusted bundle."""
        if not self._mode.emulated:
            return ()
        try:
            opened = open_bundle(bundle, root=self._root, vehicle=self._vehicle, now_us=now.utc_us)
        except Untrusted:
            return ()
        return exceeded(opened.policy, opened.mission, len(bundle), TRUSTZONE_M)

    def admit(self, bundle: bytes, now: Now) -> Loaded | Refusal:
        """Let the boundary open a bundle that was not opened before, in place of the previous one."""
        loaded = self.load(bundle, now)
        if not isinstance(loaded, Refusal) and self._caller.reopened:
            text = f"the boundary opened this bundle before on `{self._vehicle}`: a bundle flies once"
            return Refusal("boundary-replayed", text, "compile the mission again to issue a new bundle")
        return loaded

    def lost(self) -> Refusal | None:
        """The refusal once the boundary's process has ended; None while it runs."""
        if not self._caller.lost:
            return None
        text = "the boundary has ended: nothing more is sent"
        return Refusal("boundary-lost", text, "", ExitCode.REFUSED)


# ---------------------------------------------------------------- the stage


class Begun(NamedTuple):
    """A flight whose boundary has begun: the bundle and its loaded form, its trust root, the signer of its log, and the
    boundary's key or why it is missing. `apart` is the client of a boundary process, `absent` why there is none. After
    `--wait` the transport and the sockets are already open.
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
        """Why the boundary is absent, which prevents a new flight. Raises the OSError if it is one."""
        if isinstance(self.absent, OSError):
            raise self.absent
        return self.absent

    @property
    def why_absent(self) -> str:
        """Why the boundary is absent, as text; empty if it is present."""
        if self.absent is None:
            return ""
        return words_of(self.absent) if isinstance(self.absent, OSError) else self.absent.text


def start_boundary(
    context: FlightContext, verified: Verified, previous: LogBefore | None, owed: Mapping[str, Owed]
) -> Begun | Refusal:
    """Start the boundary for the flight, and let it load the bundle, unless another one is awaited. If it does not
    start and the vehicle may be in the air, the boundary in this process is used instead, also if the boundary of a
    dead run still holds the vehicle. Raises OSError.
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
        may_fly = broke_off if request.wait_s is not None else may_have_flown(request, loaded)
        in_use = isinstance(absent, Refusal) and absent.slug == IN_USE
        if not may_fly or (in_use and not broke_off):
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
            own_key = HeldByBoundary()  # this process drops it
    return Begun(bundle, loaded, trusted, log_key, own_key, apart, None)


def _start(
    context: FlightContext, verified: Verified, own_key: OwnKey, owed: Mapping[str, Owed]
) -> tuple[BoundaryClient | None, Loaded] | Refusal:
    """The boundary process, if one was requested, and the bundle as loaded by the boundary that decides. Raises
    OSError.
    """
    request, (bundle, loaded, trusted, _) = context.request, verified
    apart = _open(context, verified, own_key, owed)
    if isinstance(apart, Refusal):
        return apart
    taken: Loaded | Refusal = loaded
    if request.wait_s is None:
        taken = loaded if apart is None else apart.load(bundle, context.clock.now())
    elif apart is not None:  # the boundary draws the flight id that the sockets announce
        flight = apart.flight()
        if isinstance(flight, Refusal):
            return flight
        base = load_bundle(request, bundle, trusted.root, context.clock.now(), flight)
        taken = base if isinstance(base, Refusal) else apart.waiting(base)
    return taken if isinstance(taken, Refusal) else (apart, taken)


def _open(
    context: FlightContext, verified: Verified, own_key: OwnKey, owed: Mapping[str, Owed]
) -> BoundaryClient | Refusal | None:  # fmt: skip
    """Start or connect to the boundary process, if one was requested. Under a distrusted root the boundary in this
    process brings the vehicle down; a listening boundary has its own trust root. Raises OSError.
    """
    request, process, (_, loaded, trusted, log_key) = context.request, context.listening, verified
    if isinstance(process, Refusal):
        return process
    if process is not None:
        return BoundaryClient(process, EnforcementMode.PROCESS, loaded.vehicle, trusted.root, request.settings)
    if not request.mode.apart or request.dry_run or trusted.distrust is not None:
        return None
    unfit = _unfit_root(trusted) if request.mode.emulated else ""
    if unfit:
        help = "a root with fewer keys, or `--mode process`"
        return Refusal(
            "boundary-too-large", f"the trust root does not fit in its home: {unfit}", help, ExitCode.REFUSED
        )
    assert not isinstance(own_key, HeldByBoundary)
    boots = partial(_boots, context)
    started = start_home(request, loaded.vehicle, trusted.signed, own_key, log_key.key(), owed, boots)
    if isinstance(started, Refusal):
        return started
    context.resources.callback(started.close)
    return BoundaryClient(started, request.mode, loaded.vehicle, trusted.root, request.settings)
