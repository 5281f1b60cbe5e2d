"""The user's signing keys and trust root: `<data folder>/keys/` with one file for each key, `root.trust`, and its
predecessors `root-1.trust` and so on, for whoever missed some. Revoked keys are kept as `revoked-<kid>.key`.

A mission key belongs to one source: `mission-agent.key` signs what agents propose, `mission-operator.key` what people
do. An approval key belongs to one person in one role, like `approval-ada-supervisor.key`. A key file is readable by its
owner alone and encrypted, unless its key is for development. The folder appears complete, with every key and the root
that names them, or not at all.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

from msgspec import UNSET
from msgspec.structs import replace

from rtshcua.adapters.store.laying import appearing
from rtshcua.adapters.store.reading import exposed, open_regular, read_if_there, read_regular
from rtshcua.adapters.store.writing import PRIVATE_FILE, PRIVATE_FOLDER, make_folder, write_new
from rtshcua.adapters.store.writing import replace as write_file
from rtshcua.diagnostics.kinds import KEY, recognised
from rtshcua.wire import cose
from rtshcua.wire.key_file import MAX_KEY_FILE, dump_signing_key, load_signing_key
from rtshcua.wire.keys import ANY, Duty, SigningKey, VerificationKey
from rtshcua.wire.trust import HUMAN, MAX_ROOT, Thresholds, TrustRoot, open_root
from rtshcua.wire.untrusted import Untrusted

ROOT = "root.trust"

#: the sources of missions, with one key each
PROPOSERS = ("agent", "operator")
#: the role of both sources by default
OPERATOR = "operator"
#: the name of the person with the first approval key, by default
OWNER = "owner"


class KeyStoreError(Untrusted):
    """A key store that cannot be used: `no-keys`, `exists`, `exposed`, `too-large`."""


class KeyStore:
    """The keys in one folder."""

    def __init__(self, data: Path) -> None:
        self.folder = data / "keys"

    def exists(self) -> bool:
        """Whether the folder holds keys."""
        return self.folder.is_dir()

    def key_path(self, duty: Duty, number: int = 1, *, whose: str = "") -> Path:
        """The file of the key of a duty; for a mission key `whose` is its source. A duty may have several keys."""
        stem = f"{duty}-{whose}" if whose else str(duty)
        return self.folder / (f"{stem}.key" if number == 1 else f"{stem}-{number}.key")

    def paths(self, root: TrustRoot) -> dict[bytes, Path]:
        """The file of each `kid` in the root that is here: files are numbered in the order of the root."""
        counts: Counter[tuple[Duty, str]] = Counter()
        found = {}
        for key in root.keys:
            name = (key.duty, whose(key))
            counts[name] += 1
            found[key.kid] = self.key_path(key.duty, counts[name], whose=name[1])
        return found

    def chain(self) -> list[bytes]:
        """The signed trust roots without a gap, from the oldest that is kept to the one in force. Raises
        `KeyStoreError` (`no-keys`).
        """
        found = [self.root()]
        version = _claimed(found[0]).version
        while (version := version - 1) > 0 and self.earlier_path(version).exists():
            found.insert(0, read_root(self.earlier_path(version)))
        return found

    def earlier_path(self, version: int) -> Path:
        """The file of the signed trust root of a version that was replaced."""
        return self.folder / f"root-{version}.trust"

    @property
    def root_path(self) -> Path:
        """The file of the signed trust root."""
        return self.folder / ROOT

    def create(
        self,
        seed: Callable[[], bytes],
        *,
        development: bool,
        passphrase: bytes | None,
        now_us: int,
        expires_us: int,
        witnesses: int = 1,
        witness_threshold: int = 1,
        roles: Sequence[str] = (OPERATOR,),
        policies: Sequence[str] = (ANY,),
        approver: str = OWNER,
    ) -> TrustRoot:
        """Make a key for each duty, from 32 secret bytes of `seed` each, and the root that names them.

        There is one mission key for agents and another for people; the root trusts them for `roles` and under
        `policies` (names, or any). The one approval key belongs to `approver` in the role `operator`: it can recall,
        and `add` makes more keys. `witnesses` is the number of witness keys; a checkpoint that `witness_threshold` of
        them cosigned is anchored. All keys apply to every vehicle. Raises `KeyStoreError` (`exists`), and
        `KeyFileError` for keys that are neither encrypted nor for development.
        """
        if self.exists():
            raise KeyStoreError("exists", f"`{self.folder}` already holds keys")
        keys: list[tuple[SigningKey, VerificationKey]] = []
        for duty in Duty:
            for source in PROPOSERS if duty is Duty.MISSION else range(witnesses) if duty is Duty.WITNESS else (0,):
                key = SigningKey.from_seed(seed(), duty=duty, development=development)
                vehicles = () if duty is Duty.ROOT else (ANY,)
                named = key.verification(vehicles=vehicles)
                if isinstance(source, str):
                    named = key.verification(
                        roles=tuple(roles), sources=(source,), vehicles=vehicles, policies=tuple(policies)
                    )
                elif duty is Duty.APPROVAL:
                    named = key.verification(roles=(OPERATOR,), sources=(HUMAN,), vehicles=vehicles, person=approver)
                keys.append((key, named))
        root = TrustRoot(
            version=1,
            development=development,
            issued_at_us=now_us,
            expires_at_us=expires_us,
            keys=tuple(named for _, named in keys),
            thresholds=Thresholds(witness=UNSET if witness_threshold == 1 else witness_threshold),
        )
        paths = self.paths(root)
        signed = root.sign(next(key for key, _ in keys if key.duty is Duty.ROOT))
        make_folder(self.folder.parent, mode=PRIVATE_FOLDER)
        with appearing(self.folder) as folder:
            for key, _ in keys:
                data = dump_signing_key(key, passphrase=passphrase)
                write_new(folder / paths[key.kid].name, data, mode=PRIVATE_FILE)
            write_new(folder / ROOT, signed, mode=PRIVATE_FILE)
        return root

    def add(
        self, seed: bytes, named: Callable[[SigningKey], VerificationKey], *, duty: Duty, passphrase: bytes | None,
        signer: SigningKey, now_us: int,
    ) -> TrustRoot:  # fmt: skip
        """Make another key, from 32 secret bytes, and the next version of the root, which names it as in `named` and is
        signed by the root key `signer`. Whoever pinned the root key trusts that root too. Raises `KeyStoreError`
        (`no-keys`, `exists`), `KeyFileError`, and `RootError` for an invalid root.
        """
        root = open_root(self.root(), pinned=self.pin(), now_us=now_us)
        key = SigningKey.from_seed(seed, duty=duty, development=root.development)
        newer = _next(root, now_us, keys=(*root.keys, named(key)))
        if any(whose(each) == whose(newer.keys[-1]) for each in root.keys if each.duty is duty is Duty.APPROVAL):
            raise KeyStoreError("exists", f"the key `{whose(newer.keys[-1])}` already exists")
        return self._put(root, newer, signer, key, passphrase)

    def revoke(self, names: Sequence[bytes], *, signer: SigningKey, now_us: int) -> TrustRoot:
        """Make the next version of the root, which revokes these keys for ever: the `kid` of keys in it, or the
        fingerprints of link keys. Raises as `add`; a root key is only changed by `rotate`.
        """
        root = open_root(self.root(), pinned=self.pin(), now_us=now_us)
        keys = tuple(key for key in root.keys if key.kid not in names)
        return self._put(root, _next(root, now_us, keys=keys, revoked=_revoked(root, names)), signer)

    def renew(self, kid: bytes, seed: bytes, *, passphrase: bytes | None, signer: SigningKey, now_us: int) -> TrustRoot:
        """Replace a key by a new one with the same duty and bounds, and make the next version of the root, which
        revokes the old one. Raises as `add`.
        """
        root = open_root(self.root(), pinned=self.pin(), now_us=now_us)
        old = next(key for key in root.keys if key.kid == kid)
        key = SigningKey.from_seed(seed, duty=old.duty, development=root.development)
        keys = tuple(replace(old, public=key.public) if each is old else each for each in root.keys)
        newer = _next(root, now_us, keys=keys, revoked=_revoked(root, (kid,)))
        return self._put(root, newer, signer, key, passphrase)

    def rotate(
        self, seed: bytes, *, passphrase: bytes | None, signer: SigningKey, now_us: int, expires_us: int | None = None
    ) -> TrustRoot:
        """Change the root key, in two versions of the root: the first names both keys and is signed by the old one; the
        second revokes the old one and is signed by the new one. An expired root can be changed like this. Raises as
        `add`.
        """
        root = open_root(self.root(), pinned=self.pin(), now_us=0)
        key = SigningKey.from_seed(seed, duty=Duty.ROOT, development=root.development)
        own = key.verification()
        expires_us = expires_us or root.expires_at_us
        both = _next(root, now_us, keys=(*root.keys, own), expires_at_us=expires_us)
        last = _next(
            both, now_us, revoked=_revoked(root, (signer.kid,)), expires_at_us=expires_us,
            keys=tuple(own if each.kid == signer.kid else each for each in root.keys),
        )  # fmt: skip
        self._put(root, both, signer, key, passphrase)
        return self._put(both, last, key)

    def _put(
        self, root: TrustRoot, newer: TrustRoot, signer: SigningKey, fresh: SigningKey | None = None,
        passphrase: bytes | None = None,
    ) -> TrustRoot:  # fmt: skip
        """Replace a root, which is kept, and write the file of a new key. Files of revoked keys are renamed, and those
        of others follow their numbers in the new root.
        """
        signed, before, after = newer.sign(signer), self.paths(root), self.paths(newer)
        made = None if fresh is None else dump_signing_key(fresh, passphrase=passphrase)
        write_file(self.earlier_path(root.version), self.root(), mode=PRIVATE_FILE)
        for kid, path in before.items():
            _move(path, after.get(kid, self.folder / f"revoked-{kid.hex()}.key"))
        if fresh is not None and made is not None:
            write_new(after[fresh.kid], made, mode=PRIVATE_FILE)
        write_file(self.root_path, signed, mode=PRIVATE_FILE)
        return newer

    def provisioned(self, vehicle: str) -> bytes | None:
        """The name of the boundary key that a vehicle's folder was provisioned with, empty for none or if unknown; None
        without such a folder. Raises OSError.
        """
        data = read_if_there(self._provisioned_path(vehicle), MAX_KEY_FILE)
        if data is None:
            return None
        try:
            return bytes.fromhex(data.decode())
        except ValueError:  # it was provisioned, even if the file is damaged
            return b""

    def provision(self, vehicle: str, boundary_key: bytes) -> None:
        """Record that a folder is provisioned for a vehicle, with the boundary key of this name. Raises OSError."""
        path = self._provisioned_path(vehicle)
        make_folder(path.parent, mode=PRIVATE_FOLDER)
        write_file(path, boundary_key.hex().encode() + b"\n", mode=PRIVATE_FILE)

    def provision_again(self, vehicle: str, boundary_key: bytes | None) -> None:
        """Restore the earlier record: none, for None. Raises OSError."""
        if boundary_key is None:
            self._provisioned_path(vehicle).unlink(missing_ok=True)
        else:
            self.provision(vehicle, boundary_key)

    def _provisioned_path(self, vehicle: str) -> Path:
        return self.folder.parent / "provisioned" / f"vehicle-{vehicle}"

    def signing_key(self, duty: Duty, *, passphrase: bytes | None = None, whose: str = "") -> SigningKey:
        """The key of a duty: a mission key of the source `whose`, an approval key of the person and role. Raises
        `KeyStoreError`, `KeyFileError` (`passphrase-needed`, ...) and `WrongDuty`.
        """
        self._expect()
        return read_key(self.key_path(duty, whose=whose), duty, passphrase=passphrase)

    def root(self) -> bytes:
        """The signed trust root. Raises `KeyStoreError` (`no-keys`)."""
        self._expect()
        return read_root(self.root_path)

    def pin(self) -> bytes:
        """The `kid` of the root key that signed the root: what `open_root` pins. Raises `KeyStoreError` (`no-keys`)."""
        return cose.unverified(self.root(), limit=MAX_ROOT).kid

    def _expect(self) -> None:
        if not self.exists():
            raise KeyStoreError("no-keys", f"`{self.folder}` holds no keys")


def _next(root: TrustRoot, now_us: int, **changes: object) -> TrustRoot:
    return replace(root, version=root.version + 1, issued_at_us=now_us, **changes)


def _revoked(root: TrustRoot, names: Sequence[bytes]) -> tuple[bytes, ...]:
    return tuple(sorted(root.revocations.union(names)))


def _move(path: Path, to: Path) -> None:
    """Rename a file, if it exists: keys may be kept elsewhere too."""
    data = None if path == to else read_if_there(path, MAX_KEY_FILE)
    if data is not None:
        write_new(to, data, mode=PRIVATE_FILE)
        path.unlink()


def _claimed(data: bytes) -> TrustRoot:
    """The unverified content of a root. Raises `Untrusted`."""
    return open_root(data, pinned=cose.unverified(data, limit=MAX_ROOT).kid, now_us=0)


def whose(key: VerificationKey) -> str:
    """The owner of a key among those of its duty, as in its file name: a source, or a person in a role."""
    if key.duty is Duty.APPROVAL:
        return f"{key.person}-{key.roles[0]}"
    return key.sources[0] if key.duty is Duty.MISSION and len(key.sources) == 1 else ""


def read_key(path: Path, duty: Duty, *, passphrase: bytes | None) -> SigningKey:
    """The signing key in a file. Raises `KeyStoreError` (`exposed`), `KeyFileError`, `WrongDuty` and OSError."""
    with open_regular(path) as file:
        data, why = file.read(MAX_KEY_FILE + 1), exposed(file)
    told = KeyStoreError("exposed", f"other users may read the key `{path}`: {why}")
    if why is not None and recognised(data) is KEY:
        raise told
    # a file without a key is reported as that, not by its mode
    key = load_signing_key(data, duty=duty, passphrase=passphrase)
    if why is not None:
        raise told
    return key


def read_root(path: Path) -> bytes:
    """The signed trust root in a file, not verified. Raises `KeyStoreError` (`too-large`) and OSError."""
    data = read_regular(path, MAX_ROOT)
    if len(data) > MAX_ROOT:
        raise KeyStoreError("too-large", f"`{path}` is too large for a trust root")
    return data
