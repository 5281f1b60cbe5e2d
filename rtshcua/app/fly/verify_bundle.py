"""The stage that verifies the bundle under a trust root and selects the key that signs the log."""

import secrets
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from rtshcua.adapters.boundary.process import ListeningBoundary
from rtshcua.adapters.clock import LinkClock
from rtshcua.adapters.store.reading import read_regular
from rtshcua.app.documents import no_bundle
from rtshcua.app.exit_codes import code_of, untrusted
from rtshcua.app.fly.flight_request import FlightContext, FlightRequest
from rtshcua.app.fly.replay_check import expired, flown_before
from rtshcua.app.fly.vehicle_trust import REVOKED, Trusted, trust
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement.load import SESSION_KEY_BYTES, EnforcementMode, Loaded, load
from rtshcua.wire import cose, names
from rtshcua.wire.bundle import MAX_BUNDLE, claimed_vehicle, open_bundle
from rtshcua.wire.document import FLIGHT_BYTES, kind_of
from rtshcua.wire.keys import SEED_BYTES, Duty, SigningKey, VerificationKey
from rtshcua.wire.trust import MAX_ROOT, TrustRoot, key_refusal, open_root
from rtshcua.wire.untrusted import Untrusted

#: the help for a bundle of another vehicle
IDENTITY_HELP = "the bundle is for the `identity` of its policy's `vehicle`; `--vehicle` names this vehicle"
#: the command that hands each kind of document to a flight
HANDED_IN = {
    names.APPROVAL: "`rtshcua approve --to` hands one to a flight",
    names.RECALL: "`rtshcua recall --to` hands one to a flight",
    names.REPLACEMENT: "`rtshcua replace` hands it to a flight under way",
    names.CANCELLATION: "`cancel` of `rtshcua mcp` hands one to a flight",
}

#: the mode of an executor in this process, by the requested mode
_HERE = {mode: EnforcementMode.SOFTWARE for mode in EnforcementMode if mode.apart}
_NOT_HERE = ("mode-refused", "wrong-vehicle")


class LogNotSigned(Exception):
    """The boundary does not sign the log; `refusal` says why."""

    def __init__(self, refusal: Refusal) -> None:
        super().__init__(refusal.text)
        self.refusal = refusal


class LogSigner:
    """Signs the log: with the key in this process, or after `hand_over` through the boundary, which then holds the only
    copy of the key. `kid` is the key's id, `public` its public half.
    """

    def __init__(self, key: SigningKey | VerificationKey) -> None:
        self._key: SigningKey | None = None
        self._elsewhere: Callable[[bytes], bytes | Refusal] | None = None
        self.use(key)

    def use(self, key: SigningKey | VerificationKey) -> None:
        """Sign in this process with `key`. With a verification key there is nothing to sign with yet."""
        self.kid, self.public = key.kid, key.public
        self._key, self._elsewhere = (key if isinstance(key, SigningKey) else None), None

    def hand_over(self, elsewhere: Callable[[bytes], bytes | Refusal]) -> None:
        """Sign by calling `elsewhere` from now on, and drop the key."""
        self._key, self._elsewhere = None, elsewhere

    def key(self) -> SigningKey:
        """The key. Raises LookupError if this process does not hold it."""
        if self._key is None:
            raise LookupError("this process does not hold the log's key")
        return self._key

    def sign(self, checkpoint: bytes) -> bytes:
        """The signature of a checkpoint. Raises LogNotSigned if the boundary refuses to sign."""
        if self._elsewhere is None:
            return self.key().sign(checkpoint, duty=Duty.LOG)
        signed = self._elsewhere(checkpoint)
        if isinstance(signed, Refusal):
            text = f"the boundary's process does not sign the log: {signed.text} ({signed.slug})"
            raise LogNotSigned(Refusal(f"boundary-{signed.slug}", text, "", ExitCode.REFUSED))
        return signed


class Verified(NamedTuple):
    """A verified bundle: its octets, its loaded form, its trust root, and the signer of the log."""

    bundle: bytes
    loaded: Loaded
    trusted: Trusted
    log_key: LogSigner


def verify(context: FlightContext, bundle: bytes, flight: bytes | None = None) -> Verified | Refusal:
    """Verify and load the bundle under the vehicle's trust root, with the flight id `flight` or a new one. Raises
    OSError.

    If the root does not follow from the last accepted one, or the root or a key has expired or is revoked, a run of
    this bundle may still have broken off in the air. Then the bundle is loaded under the given root, to bring the
    vehicle down.
    """
    request = context.request
    try:
        now_us = context.clock.now().utc_us
        trusted = trust(request.roots, request.data, request.state, _identity(request, bundle), now_us)
        key = _log_key(context)
    except Untrusted as error:
        return untrusted(error)
    loaded = _under(context, bundle, trusted, key, flight)
    if isinstance(loaded, Refusal):
        others = ((each, _under(context, bundle, each, key, flight)) for each in trusted.before(loaded))
        for other, found in others:
            if not isinstance(found, Refusal):
                trusted, loaded = other, found
                break
        else:
            return trusted.distrust or loaded
    if trusted.distrust is not None and (request.dry_run or not may_have_flown(request, loaded)):
        return trusted.distrust
    return Verified(bundle, loaded, trusted, LogSigner(key))


def read_bundle(path: Path) -> bytes | Refusal:
    """Read a bundle, and refuse a file that is clearly something else. Raises OSError."""
    data = read_regular(path, MAX_BUNDLE)
    refusal = other_kind(path)
    if refusal is not None:
        return refusal
    if len(data) > MAX_BUNDLE:
        return Refusal(
            "too-large", f"`{path}` is larger than {MAX_BUNDLE} bytes, the limit for a bundle", "", ExitCode.INPUT
        )
    try:
        kind = kind_of(data)
    except Untrusted:
        return data
    return Refusal("wrong-kind", f"`{path}` is not a bundle: it is `{kind.name}`", HANDED_IN[kind], ExitCode.INPUT)


def other_kind(path: Path) -> Refusal | None:
    """The refusal if the file is clearly not a bundle; None if it may be one."""
    if path.suffix == ".rts":  # the general check is in `ground`, which the onboard side does not import
        advice = f"`rtshcua compile {path} -o {path.stem}.bundle` makes one of it"
        return Refusal("wrong-kind", f"`{path}` is a source, not a bundle", advice, ExitCode.INPUT)
    mistaken = no_bundle(path)
    return None if mistaken is None else Refusal(mistaken.slug, str(mistaken), mistaken.help, ExitCode.INPUT)


def load_bundle(
    request: FlightRequest, bundle: bytes, root: TrustRoot, now: Now, flight: bytes | None = None
) -> Loaded | Refusal:
    """Verify and load the bundle in this process, with the flight id `flight` or a new one."""
    identity = request.vehicle
    if identity is None:
        try:
            identity = open_bundle(bundle, root=root, vehicle=None, now_us=now.utc_us).policy.vehicle.identity
        except Untrusted as error:
            return untrusted(error)
    loaded = load(
        bundle, root=root, vehicle=identity, now=now, mode=_HERE.get(request.mode, request.mode),
        session_key=secrets.token_bytes(SESSION_KEY_BYTES), flight=flight or secrets.token_bytes(FLIGHT_BYTES),
        peer_is_own_simulator=request.link is None, settings=request.settings,
    )  # fmt: skip
    if isinstance(loaded, Refusal):
        code = ExitCode.REFUSED if loaded.slug in _NOT_HERE else code_of(loaded.slug)
        help = IDENTITY_HELP if loaded.slug == "wrong-vehicle" else ""
        return Refusal(loaded.slug, loaded.text, loaded.help or help, code)
    return loaded


def local_log_key(context: FlightContext) -> SigningKey:
    """The key with which this process signs the log. With a listening boundary, which has the real key, it is a random
    key for a vehicle that is brought down without that boundary.
    """
    if context.request.boundary_socket is not None:
        return SigningKey.from_seed(secrets.token_bytes(SEED_BYTES), duty=Duty.LOG, development=True)
    return context.console.unlock(Duty.LOG, context.request.log_key)


def lapsed(bundle: bytes, signed_root: bytes, log_key: bytes, loaded: Loaded, clock: LinkClock) -> Refusal | None:
    """Verify root, bundle and log key again at the clock's present time, which may come from the vehicle. The refusal
    if one has expired; None if all are valid. `log_key` is the id of the log key.
    """
    now_us = clock.now().utc_us
    try:
        root = open_root(signed_root, pinned=cose.unverified(signed_root, limit=MAX_ROOT).kid, now_us=now_us)
        open_bundle(bundle, root=root, vehicle=loaded.vehicle, now_us=now_us)
    except Untrusted as error:
        return untrusted(error)
    return _unverifiable(root, log_key, loaded.vehicle, now_us)


def may_have_flown(request: FlightRequest, loaded: Loaded) -> bool:
    """Whether a run of this bundle may be in the air; with `--wait`, a run of any bundle."""
    if request.wait_s is not None:
        return True
    try:
        return flown_before(request.kept_in, loaded) is not None
    except OSError:
        return True


def not_begun(request: FlightRequest, loaded: Loaded, clock: LinkClock) -> str | None:
    """The reason why a flight of the bundle would not begin, as text; None if it would."""
    late = expired(loaded, clock.now())
    return flown_before(request.kept_in, loaded) or (None if late is None else f"{late.text}; {late.help}")


def _identity(request: FlightRequest, bundle: bytes) -> str | None:
    """The vehicle's identity: the requested one, or the claim of the unverified bundle; None if it has no claim."""
    try:
        return request.vehicle or claimed_vehicle(bundle)
    except Untrusted:
        return None


def _log_key(context: FlightContext) -> SigningKey | VerificationKey:
    if isinstance(context.listening, ListeningBoundary):
        assert context.listening.log_public is not None
        return VerificationKey(Duty.LOG, context.listening.log_public)
    return local_log_key(context)


def _under(
    context: FlightContext, bundle: bytes, trusted: Trusted, key: SigningKey | VerificationKey, flight: bytes | None
) -> Loaded | Refusal:
    """Load the bundle under a root. Under a distrusted root, expiry is ignored."""
    now = context.clock.now()
    if trusted.distrust is not None:
        now = Now(now.monotonic_us, 0, now.utc_error_us)
    refusal = None if isinstance(context.listening, Refusal) else _untrusted_log_key(key, trusted.root)
    if refusal is not None:
        return refusal
    loaded = load_bundle(context.request, bundle, trusted.root, now, flight)
    if isinstance(loaded, Refusal):
        return loaded
    return _unverifiable(trusted.root, key.kid, loaded.vehicle, now.utc_us) or loaded


def _untrusted_log_key(key: SigningKey | VerificationKey, root: TrustRoot) -> Refusal | None:
    if key.kid in root.revocations:
        text = f"the trust root revokes the log key {key.kid.hex()}"
        return Refusal(REVOKED, text, "select its replacement with `--log-key`", ExitCode.UNTRUSTED)
    if key.kid not in root.keys_for(Duty.LOG):
        text = f"the trust root names no log key {key.kid.hex()}: nobody could verify the log"
        return Refusal("unknown-key", text, "choose a key that the root names with `--log-key`", ExitCode.UNTRUSTED)
    return None


def _unverifiable(root: TrustRoot, log_key: bytes, vehicle: str, now_us: int) -> Refusal | None:
    """The refusal if the log key is not valid now, so that nobody could verify the log; None if it is valid."""
    named = root.keys_for(Duty.LOG).get(log_key)  # None for a random key of `local_log_key`
    refusal = None if named is None else key_refusal(named, vehicle=vehicle, now_us=now_us)
    if refusal is None:
        return None
    text = f"the log key {log_key.hex()} is not valid for `{vehicle}` now: nobody could verify the log"
    return Refusal(
        refusal, text, "select a valid key with `--log-key`; `rtshcua keys replace` makes one", code_of(refusal)
    )
