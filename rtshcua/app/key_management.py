"""The service `keys`: create, replace and revoke signing keys, trust roots, boundary folders and link keys."""

import hashlib
import os
import re
import secrets
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final, NamedTuple, TypeVar

from rtshcua.adapters.boundary.home import first_kept
from rtshcua.adapters.clock import SystemClock
from rtshcua.adapters.link_setup import LinkSetup, SetUp, carry_out
from rtshcua.adapters.store.folders import data_folder, state_folder
from rtshcua.adapters.store.keystore import PROPOSERS, KeyStore
from rtshcua.adapters.store.laying import appearing
from rtshcua.adapters.store.signing import LinkKeyError, fingerprint, read_link_key, write_link_key
from rtshcua.adapters.store.vehicle_records import RootStore
from rtshcua.adapters.store.writing import PRIVATE_FILE, PRIVATE_FOLDER, make_folder, write_new
from rtshcua.adapters.vehicle.address import Address
from rtshcua.adapters.vehicle.transport import open_transport
from rtshcua.app.exit_codes import code_of, untrusted
from rtshcua.app.fly.connect import unopened
from rtshcua.app.fly.start_boundary import boundary_key as attested_key
from rtshcua.app.fly.vehicle_trust import HELPS, Trusted, trust
from rtshcua.diagnostics.excerpt import visible
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.mavlink.signing import KEY_OCTETS
from rtshcua.wire.keys import ANY, SEED_BYTES, Duty, SigningKey, VerificationKey
from rtshcua.wire.trust import HUMAN, PERSON, TrustRoot, key_refusal, open_root
from rtshcua.wire.untrusted import Untrusted

#: minimum length of a passphrase, characters
SHORTEST: Final = 12
DAY_US: Final = 86_400_000_000

#: the source folders of a project (`rtshcua init`)
_FOLDERS: Final = (Path(), Path("policies"), Path("missions"))
#: with more sources than this, roles are not checked: it is not a project, or checking takes too long
_MOST: Final = 40
_KEY_ID: Final = re.compile(r"[0-9a-f]{8,32}")
_LINK_ID: Final = re.compile(r"[0-9a-f]{16}")
#: valid names of a socket and its unit: they need no escaping and fit into a socket address
_SERVED: Final = re.compile(r"[A-Za-z0-9_][A-Za-z0-9._-]{0,79}")
_ROLE: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_.]{0,99}")
_NO_PASSPHRASE: Final = Refusal(
    "usage", f"encrypted keys require a passphrase of at least {SHORTEST} characters, typed the same twice"
)
_LIST: Final = "run `rtshcua keys list` for the keys"

T = TypeVar("T")


class Secrets(NamedTuple):
    """How to unlock a key from a file or the key store, and the passphrase for new keys; None if it is too short."""

    unlock: Callable[[Duty, Path | None], SigningKey]
    new_passphrase: Callable[[], bytes | None]


class NewStore(NamedTuple):
    """The keys of a new key store: unencrypted for development, or encrypted for named policies; empty: any policy."""

    development: bool
    days: int
    witnesses: int
    witness_threshold: int
    roles: Sequence[str]
    policies: Sequence[str]
    owner: str


class ProvisionRequest(NamedTuple):
    """A request for a boundary's folder: the vehicle, the place, the keys, and whether it replaces an earlier one."""

    folder: Path
    vehicle: str
    signing_key: Path | None
    log_key: Path | None
    boundary_key: Path | None
    again: bool


class ProvisionedFolder(NamedTuple):
    """The folder of a boundary: the version of its trust root, and the ids of its keys."""

    place: Path
    trust_root: int
    log_key: str
    boundary_key: str | None
    link_key: str | None


def key_store() -> KeyStore:
    """Return the key store of the current user."""
    return KeyStore(data_folder())


def refused(error: Untrusted) -> Refusal:
    """Return the refusal for an error of the key store or a key."""
    found = untrusted(error)
    return found._replace(code=ExitCode.INPUT) if error.slug == "no-keys" else found


def trust_root(store: KeyStore) -> TrustRoot | Refusal:
    """Return the key store's trust root, even if it has expired, because it is only displayed."""
    return _opened(lambda: _root(store))


def _root(store: KeyStore) -> TrustRoot:
    return open_root(store.root(), pinned=store.pin(), now_us=0)


def root_key(store: KeyStore) -> tuple[TrustRoot, VerificationKey] | Refusal:
    """Return the trust root and its signing key, which auditors pin."""

    def work() -> tuple[TrustRoot, VerificationKey]:
        root, kid = _root(store), store.pin()
        return root, next(key for key in root.keys if key.kid == kid)

    return _opened(work)


def root_files(store: KeyStore) -> list[Path]:
    """Return the files of all trust roots, oldest first, because a vehicle may have missed some."""
    version = _root(store).version
    before = range(version - len(store.chain()) + 1, version)
    return [*map(store.earlier_path, before), store.root_path]


def _opened(work: Callable[[], T | Refusal]) -> T | Refusal:
    """Return the result of `work`, or a refusal if the key store cannot be used."""
    try:
        return work()
    except Untrusted as error:
        return refused(error)


def _now_us() -> int:
    return time.time_ns() // 1000


def create(store: KeyStore, new: NewStore, secret: Secrets) -> Refusal | None:
    """Create a key for each duty, and the trust root that names them. Raises OSError."""
    if store.exists():
        text = f"keys already exist in `{store.folder}`"
        return Refusal("exists", text, _LIST, ExitCode.INPUT)
    if new.witness_threshold > max(1, new.witnesses):
        text = f"`--witness-threshold {new.witness_threshold}` exceeds `--witnesses {new.witnesses}`"
        return Refusal("usage", text)
    misnamed = _misnamed(new.roles, new.policies) or _no_person(new.owner)
    if misnamed is not None:
        return misnamed
    if not new.development and not new.policies:
        help = "otherwise the holder of a mission key could choose a more permissive policy"
        return Refusal("usage", "`--encrypted` requires `--policy NAME`", help)
    now_us = _now_us()

    def work() -> Refusal | None:
        passphrase = None if new.development else secret.new_passphrase()
        if passphrase is None and not new.development:
            return _NO_PASSPHRASE
        store.create(
            lambda: secrets.token_bytes(SEED_BYTES), development=new.development, passphrase=passphrase,
            now_us=now_us, expires_us=now_us + new.days * DAY_US, witnesses=new.witnesses,
            witness_threshold=new.witness_threshold, roles=new.roles, policies=new.policies or (ANY,),
            approver=new.owner,
        )  # fmt: skip
        return None

    return _opened(work)


def approver_key(name: str, role: str, vehicles: Sequence[str]) -> Callable[[SigningKey], VerificationKey] | Refusal:
    """Return how the trust root names the approval key of a person in a role."""
    misnamed = _no_person(name) or (None if _ROLE.fullmatch(role) else _no_name(role, "role"))
    named = (role,)
    return misnamed or (
        lambda key: key.verification(roles=named, sources=(HUMAN,), vehicles=tuple(vehicles), person=name)
    )


def mission_key(
    source: str, roles: Sequence[str], policies: Sequence[str], vehicles: Sequence[str]
) -> Callable[[SigningKey], VerificationKey] | Refusal:
    """Return how the trust root names a mission key for one source."""
    if source not in PROPOSERS:
        return Refusal("usage", f"unknown source `{source}`", f"accepted: {' or '.join(PROPOSERS)}")
    return _misnamed(roles, policies) or (
        lambda key: key.verification(
            roles=tuple(roles), sources=(source,), vehicles=tuple(vehicles), policies=tuple(policies)
        )
    )


def add_key(
    store: KeyStore, duty: Duty, named: Callable[[SigningKey], VerificationKey], secret: Secrets
) -> Refusal | None:
    """Create a key, and the next version of the trust root, which names it. Raises OSError."""

    def work() -> Refusal | None:
        own = None if _root(store).development else secret.new_passphrase()
        if own is None and not _root(store).development:
            return _NO_PASSPHRASE
        signer = secret.unlock(Duty.ROOT, None)
        seed = secrets.token_bytes(SEED_BYTES)
        store.add(seed, named, duty=duty, passphrase=own, signer=signer, now_us=_now_us())
        return None

    return _opened(work)


def revoke(store: KeyStore, keys: Sequence[str], links: Sequence[str], secret: Secrets) -> Refusal | None:
    """Create the next version of the trust root, which revokes keys permanently. Raises OSError."""

    def change(root: TrustRoot, signer: SigningKey) -> Refusal | None:
        names = []
        for text in keys:
            found = _named(store, root, text)
            if isinstance(found, Refusal):
                return found
            if found.duty is Duty.ROOT:
                return Refusal("usage", "a root key cannot be revoked alone", "use `rtshcua keys rotate-root`")
            names.append(found.kid)
        for text in links:
            name = _link_named(text)
            if name is None:
                return Refusal("usage", f"`{text}` is not a link key", "accepted: 16 hexadecimal digits, or its file")
            if name in root.revocations:
                return _revoked_already(text)
            names.append(name)
        if not names:
            return Refusal("usage", "KEY is missing", _LIST)
        store.revoke(names, signer=signer, now_us=_now_us())
        return None

    return _changed(store, change, secret)


def replace_key(store: KeyStore, text: str, secret: Secrets) -> Refusal | None:
    """Revoke a key, and create a new one with the same duty, roles and limits. Raises OSError."""

    def change(root: TrustRoot, signer: SigningKey) -> Refusal | None:
        found = _named(store, root, text)
        if isinstance(found, Refusal):
            return found
        if found.duty is Duty.ROOT:
            return Refusal("usage", "a root key cannot be replaced this way", "use `rtshcua keys rotate-root`")
        own = None if root.development else secret.new_passphrase()
        if own is None and not root.development:
            return _NO_PASSPHRASE
        store.renew(found.kid, secrets.token_bytes(SEED_BYTES), passphrase=own, signer=signer, now_us=_now_us())
        return None

    return _changed(store, change, secret)


def rotate_root(store: KeyStore, days: int | None, secret: Secrets) -> Refusal | None:
    """Change the root key, in two versions of the trust root. Raises OSError."""

    def change(root: TrustRoot, signer: SigningKey) -> Refusal | None:
        own = None if root.development else secret.new_passphrase()
        if own is None and not root.development:
            return _NO_PASSPHRASE
        now_us, seed = _now_us(), secrets.token_bytes(SEED_BYTES)
        expires_us = None if days is None else now_us + days * DAY_US
        store.rotate(seed, passphrase=own, signer=signer, now_us=now_us, expires_us=expires_us)
        return None

    return _changed(store, change, secret)


def _changed(
    store: KeyStore, change: Callable[[TrustRoot, SigningKey], Refusal | None], secret: Secrets
) -> Refusal | None:
    """Create the next trust root of the key store by `change`."""
    return _opened(lambda: change(_root(store), secret.unlock(Duty.ROOT, None)))


def accept(roots: list[Path], vehicle: str, state: Path | None) -> Trusted | Refusal:
    """On the vehicle: accept a newer trust root, and keep it in the state folder. Raises OSError."""
    state = state or state_folder()
    try:
        taken = trust(roots, data_folder(), state, vehicle, _now_us())
    except Untrusted as error:
        return Refusal(f"root-{error.slug}", str(error), HELPS.get(error.slug, ""), code_of(error.slug))
    if taken.distrust is not None:
        return taken.distrust._replace(slug=f"root-{taken.distrust.slug.removeprefix('root-')}")
    RootStore(state, vehicle).keep(taken.signed)
    return taken


def provision(store: KeyStore, request: ProvisionRequest, secret: Secrets) -> ProvisionedFolder | Refusal:
    """Create the folder of a listening boundary: its decrypted keys and the trust root. Raises OSError."""
    place = request.folder / request.vehicle
    if _SERVED.fullmatch(request.vehicle) is None:
        text = f"`{visible(request.vehicle)}` is not a valid name for a boundary's socket"
        help = "accepted: 1 to 80 letters, digits, `_`, `.` and `-`, not beginning with `.` or `-`"
        return Refusal("usage", text, help)
    if os.path.lexists(place):
        help = "it may hold the state of a vehicle in use: move it away, or back it up"
        return Refusal("refused", f"the folder `{place}` already exists", help, ExitCode.REFUSED)
    try:
        return _opened(lambda: _provisioned(store, request, place, secret))
    except LinkKeyError as error:
        return _link_key_refused(error)


def _provisioned(
    store: KeyStore, request: ProvisionRequest, place: Path, secret: Secrets
) -> ProvisionedFolder | Refusal:
    vehicle, now_us = request.vehicle, _now_us()
    root = open_root(store.root(), pinned=store.pin(), now_us=now_us)
    log = secret.unlock(Duty.LOG, request.log_key)
    named = root.keys_for(Duty.LOG).get(log.kid)
    slug = "unknown-key" if named is None else key_refusal(named, vehicle=vehicle, now_us=now_us)
    if slug is not None:
        text = f"the trust root does not accept log key {log.kid.hex()} for `{vehicle}` now"
        return Refusal(slug, text, "choose a key that the root names with `--log-key`", ExitCode.UNTRUSTED)
    own = attested_key(root, vehicle, now_us, secret.unlock, request.boundary_key)
    if isinstance(own, Refusal):
        return own
    before = store.provisioned(vehicle)
    if before is not None and (not request.again or own is None or own.kid == before):
        return _provisioned_before(vehicle, own, again=request.again)
    link = None if request.signing_key is None else read_link_key(request.signing_key)
    seeds = {"log.seed": log.private.private_bytes_raw(), "root.pin": store.pin()}
    seeds |= {} if own is None else {"boundary.seed": own.private.private_bytes_raw()}
    seeds |= {} if link is None else {"link.key": link}
    make_folder(request.folder, mode=PRIVATE_FOLDER)
    store.provision(vehicle, b"" if own is None else own.kid)
    with _marked_only_if_made(store, vehicle, before), appearing(place) as fresh:
        for name, octets in seeds.items():
            write_new(fresh / name, octets.hex().encode() + b"\n", mode=PRIVATE_FILE)
        write_new(fresh / "root.trust", store.root(), mode=PRIVATE_FILE)
        kept = first_kept(now_us) if own is None else first_kept(now_us, own.public)
        write_new(fresh / "kept", kept, mode=PRIVATE_FILE)
    names = (log.kid.hex(), None if own is None else own.kid.hex(), None if link is None else fingerprint(link))
    return ProvisionedFolder(place, root.version, *names)


@contextmanager
def _marked_only_if_made(store: KeyStore, vehicle: str, before: bytes | None) -> Iterator[None]:
    """Restore the record of provisioning to `before` if the folder cannot be created."""
    try:
        yield
    except OSError:
        with suppress(OSError):
            store.provision_again(vehicle, before)
        raise


def _provisioned_before(vehicle: str, own: SigningKey | None, *, again: bool) -> Refusal:
    """Return the refusal of a second folder for a vehicle."""
    if not again or own is None:
        text = f"a folder for `{vehicle}` was provisioned before; a second one would not know which bundles it opened"
        help = "if the first one is lost, make a new boundary key with `rtshcua keys replace`, and use `--again`"
        return Refusal("provisioned-before", text, help, ExitCode.REFUSED)
    text = f"boundary key {own.kid.hex()} is also in the earlier folder of `{vehicle}`: logs could not tell them apart"
    help = f"replace and revoke it with `rtshcua keys replace {own.kid.hex()[:8]}`"
    return Refusal("same-instance", text, help, ExitCode.REFUSED)


def make_link_key(file: Path, passphrase: bytes | None) -> str | Refusal:
    """Create a link key, derived from a passphrase or random, and return its fingerprint. Raises OSError."""
    key = secrets.token_bytes(KEY_OCTETS)
    if passphrase is not None:
        if len(passphrase.decode(errors="replace")) < SHORTEST:
            return Refusal("usage", f"a link key requires a passphrase of at least {SHORTEST} characters")
        key = hashlib.sha256(passphrase).digest()
    try:
        write_link_key(file, key)
    except FileExistsError:
        text = f"`{file}` already exists"
        return Refusal("refused", text, "a key that may be in use is not overwritten", ExitCode.REFUSED)
    return fingerprint(key)


def set_up_link(file: Path, address: Address, system: int | None) -> SetUp | Refusal:
    """Install a link key on the vehicle at an address, and test whether it requires signed frames. Raises OSError."""
    try:
        key = read_link_key(file)
    except LinkKeyError as error:
        return _link_key_refused(error)
    try:
        transport = open_transport(address)
    except OSError as error:
        return unopened(address, error)._replace(code=ExitCode.LINK)
    clock = SystemClock()
    begun = clock.now()
    try:
        setup = LinkSetup(key, begun.utc_us, begun.monotonic_us, system, begins=transport.begins)
        seen = carry_out(setup, transport, lambda: clock.now().monotonic_us)
    finally:
        transport.close()
    if isinstance(seen, Refusal):
        silent = seen.slug in ("no-vehicle", "no-answer")
        return seen._replace(code=ExitCode.LINK if silent else ExitCode.REFUSED)
    return seen


def effect_of(seen: SetUp) -> Refusal | None:
    """Return a refusal if the installed link key does not protect the link; None if it does."""
    if seen.insists:
        return None
    if seen.signs and seen.answers_signed:
        help = "this is normal over USB: repeat the command on the link used in flight; it then sends no key"
        text = "the vehicle has the key, but accepts unsigned commands on this link"
        return Refusal("not-insisted", text, help, ExitCode.REFUSED)
    text, help = "the key has no effect on this link", "the vehicle refused it, or does not support signing"
    return Refusal("no-effect", text, help, ExitCode.REFUSED)


def _link_key_refused(error: LinkKeyError) -> Refusal:
    return Refusal(f"link-key-{error.slug}", str(error), error.help or "", code_of(error.slug))


def unknown_roles(roles: Iterable[str]) -> list[str]:
    """Return a warning for each role that no policy of the current project declares.

    It is not an error: the policy may be written later or lie elsewhere.
    """
    known = _known()
    names = ", ".join(f"`{name}`" for name in sorted(known))
    strange = sorted(set(roles) - known) if known else ()
    return [f"warning: no policy here declares the role `{role}`; declared roles: {names}" for role in strange]


def _known() -> set[str]:
    try:
        files = [path for folder in _FOLDERS for path in sorted(folder.glob("*.rts")) if path.is_file()]
    except OSError:
        return set()
    if not 0 < len(files) <= _MOST:
        return set()
    from rtshcua.app.programs import examine, programs

    return {
        role for each in programs(files) for lowered in examine(each.reading).policies for role in lowered.policy.roles
    }


def _named(store: KeyStore, root: TrustRoot, text: str) -> VerificationKey | Refusal:
    """Return the key that a text names; a refusal if it names none or several."""
    paths = store.paths(root)
    digits = text.lower() if _KEY_ID.fullmatch(text.lower()) else None
    found = [
        key
        for key in root.keys
        if text in (paths[key.kid].name, paths[key.kid].stem)
        or (digits is not None and key.kid.hex().startswith(digits))
    ]
    if len(found) == 1:
        return found[0]
    if digits is not None and any(name.hex().startswith(digits) for name in root.revocations):
        return _revoked_already(text)
    what = "names several keys" if found else "is not a key of the trust root"
    return Refusal("usage", f"`{text}` {what}", "run `rtshcua keys list`, and use an id or a file name")


def _revoked_already(text: str) -> Refusal:
    return Refusal("usage", f"`{text}` is already revoked", _LIST)


def _link_named(text: str) -> bytes | None:
    """Return the id of a link key, from 16 hexadecimal digits or from its file; None if invalid. Raises OSError."""
    if _LINK_ID.fullmatch(text.lower()):
        return bytes.fromhex(text)
    try:
        return bytes.fromhex(fingerprint(read_link_key(Path(text))))
    except LinkKeyError:
        return None


def _misnamed(roles: Sequence[str], policies: Sequence[str]) -> Refusal | None:
    """Return the refusal of the first invalid role or policy name; None if all are valid."""
    for what, names in (("role", roles), ("policy", policies)):
        for name in names:
            if name != ANY and not _ROLE.fullmatch(name):
                return _no_name(name, what)
    return None


def _no_name(name: str, what: str) -> Refusal:
    return Refusal("usage", f"`{visible(name)}` is not a valid {what} name", "accepted: a name as in a policy")


def _no_person(name: str) -> Refusal | None:
    if PERSON.fullmatch(name):
        return None
    text = f"`{visible(name)}` is not a valid name of a person"
    return Refusal("usage", text, "accepted: up to 64 lower-case letters, digits, `.`, `_` and `-`")
