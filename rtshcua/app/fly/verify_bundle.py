"""The stage that verifies: the bundle in force under a trust root, and the key that signs the log of its flight."""

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

#: where it stands which vehicle a bundle is for
IDENTITY_HELP = "`identity` of the policy's `vehicle` says which one it is for, `--vehicle` which one this is"
#: how each kind of document is handed to a flight
HANDED_IN = {
    names.APPROVAL: "`rtshcua approve --to` hands one to a flight",
    names.RECALL: "`rtshcua recall --to` hands one to a flight",
    names.REPLACEMENT: "`rtshcua replace` hands it to a flight under way",
    names.CANCELLATION: "`cancel` of `rtshcua mcp` hands one to a flight",
}

#: the mode of what is decided in this process, of the mode that was asked for
_HERE = {mode: EnforcementMode.SOFTWARE for mode in EnforcementMode if mode.apart}
_NOT_HERE = ("mode-refused", "wrong-vehicle")


class LogNotSigned(Exception):
    """The boundary does not sign the log; `refusal` says why."""

    def __init__(self, refusal: Refusal) -> None:
        super().__init__(refusal.text)
        self.refusal = refusal


class LogSigner:
    """The log's key, until it is handed over: this process signs, or a boundary, which then has the key alone. `kid`
    names it, and `public` is its public half; there may be no more of it here.
    """

    def __init__(self, key: SigningKey | VerificationKey) -> None:
        self._key: SigningKey | None = None
        self._elsewhere: Callable[[bytes], bytes | Refusal] | None = None
        self.use(key)

    def use(self, key: SigningKey | VerificationKey) -> None:
        """This process signs, with this key, if it has it."""
        self.kid, self.public = key.kid, key.public
        self._key, self._elsewhere = (key if isinstance(key, SigningKey) else None), None

    def hand_over(self, elsewhere: Callable[[bytes], bytes | Refusal]) -> None:
        """Who has the key too signs from now on; it is let go here."""
        self._key, self._elsewhere = None, elsewhere

    def key(self) -> SigningKey:
        """The key. Raises LookupError once it was handed over, and where it never was here."""
        if self._key is None:
            raise LookupError("the log's key is not here")
        return self._key

    def sign(self, checkpoint: bytes) -> bytes:
        """The signature under a checkpoint. Raises LogNotSigned where the boundary does not sign it."""
        if self._elsewhere is None:
            return self.key().sign(checkpoint, duty=Duty.LOG)
        signed = self._elsewhere(checkpoint)
        if isinstance(signed, Refusal):
            text = f"the boundary's process does not sign the log: {signed.text} ({signed.slug})"
            raise LogNotSigned(Refusal(f"boundary-{signed.slug}", text, "", ExitCode.REFUSED))
        return signed


class Verified(NamedTuple):
    """A bundle, as it was given and in force; under what it is trusted; and who signs the log."""

    bundle: bytes
    loaded: Loaded
    trusted: Trusted
    log_key: LogSigner


def verify(context: FlightContext, bundle: bytes, flight: bytes | None = None) -> Verified | Refusal:
    """The bundle under the trust root that counts, as a flight of this id, or else of a new one. Raises OSError.

    Where the root does not follow from the one that was accepted last, or has expired, or a key of the bundle or the
    log has, or is revoked, a run of this bundle may still have broken off in the air: then it is brought down under the
    root that was given.
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
    """A bundle's octets. Raises OSError."""
    data = read_regular(path, MAX_BUNDLE)
    refusal = other_kind(path)
    if refusal is not None:
        return refusal
    if len(data) > MAX_BUNDLE:
        return Refusal("too-large", f"`{path}` is larger than a bundle may be", "", ExitCode.INPUT)
    try:
        kind = kind_of(data)
    except Untrusted:
        return data
    return Refusal("wrong-kind", f"`{path}` is no bundle, but `{kind.name}`", HANDED_IN[kind], ExitCode.INPUT)


def other_kind(path: Path) -> Refusal | None:
    """Why a file is surely no bundle; None where it may be one."""
    if path.suffix == ".rts":  # what names it elsewhere is of the ground
        advice = f"`rtshcua compile {path} -o {path.stem}.bundle` makes one of it"
        return Refusal("wrong-kind", f"`{path}` is a source, and no bundle", advice, ExitCode.INPUT)
    mistaken = no_bundle(path)
    return None if mistaken is None else Refusal(mistaken.slug, str(mistaken), mistaken.help, ExitCode.INPUT)


def load_bundle(
    request: FlightRequest, bundle: bytes, root: TrustRoot, now: Now, flight: bytes | None = None
) -> Loaded | Refusal:
    """The bundle in force in this process, as a flight of this id, or else of a new one."""
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
    """The key by which this process signs the log; one that is drawn, and nobody knows, for what comes down without the
    boundary that has it.
    """
    if context.request.boundary_socket is not None:
        return SigningKey.from_seed(secrets.token_bytes(SEED_BYTES), duty=Duty.LOG, development=True)
    return context.console.unlock(Duty.LOG, context.request.log_key)


def lapsed(bundle: bytes, signed_root: bytes, log_key: bytes, loaded: Loaded, clock: LinkClock) -> Refusal | None:
    """Why what was verified by this machine's time of day, or before a wait, does not hold by the vehicle's now; None
    where it does. `log_key` names the one that signs the log.
    """
    now_us = clock.now().utc_us
    try:
        root = open_root(signed_root, pinned=cose.unverified(signed_root, limit=MAX_ROOT).kid, now_us=now_us)
        open_bundle(bundle, root=root, vehicle=loaded.vehicle, now_us=now_us)
    except Untrusted as error:
        return untrusted(error)
    return _unverifiable(root, log_key, loaded.vehicle, now_us)


def may_have_flown(request: FlightRequest, loaded: Loaded) -> bool:
    """Whether a run of this bundle may be in the air; with one that waits, of whatever bundle was handed in."""
    if request.wait_s is not None:
        return True
    try:
        return flown_before(request.kept_in, loaded) is not None
    except OSError:
        return True


def not_begun(request: FlightRequest, loaded: Loaded, clock: LinkClock) -> str | None:
    """Why a flight of the bundle would not begin, in words."""
    late = expired(loaded, clock.now())
    return flown_before(request.kept_in, loaded) or (None if late is None else f"{late.text}; {late.help}")


def _identity(request: FlightRequest, bundle: bytes) -> str | None:
    """Who the vehicle is, also by a bundle that nobody verified yet; None where it does not say."""
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
    """The bundle under a root; under one that is not to be trusted any more, whatever has expired since."""
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
        return Refusal(REVOKED, text, "`--log-key` gives the one that took its place", ExitCode.UNTRUSTED)
    if key.kid not in root.keys_for(Duty.LOG):
        text = f"the trust root names no log key {key.kid.hex()}: nobody could verify the log"
        return Refusal("unknown-key", text, "choose a key that the root names with `--log-key`", ExitCode.UNTRUSTED)
    return None


def _unverifiable(root: TrustRoot, log_key: bytes, vehicle: str, now_us: int) -> Refusal | None:
    """Why nobody could verify a log that the key of this name signs now; None where they could."""
    named = root.keys_for(Duty.LOG).get(log_key)  # none: `local_log_key`
    refusal = None if named is None else key_refusal(named, vehicle=vehicle, now_us=now_us)
    if refusal is None:
        return None
    text = f"the log key {log_key.hex()} may not speak for `{vehicle}` now: nobody could verify the log"
    return Refusal(refusal, text, "`--log-key` gives one that may; `rtshcua keys replace` makes it", code_of(refusal))
