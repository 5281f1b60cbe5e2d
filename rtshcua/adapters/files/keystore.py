"""The user's signing keys and trust root: `<data folder>/keys/`, one file a key and `root.trust`.

A key file is readable by its owner alone and encrypted, unless its key is for development. The folder appears whole,
with every key and the root that names them, or not at all.
"""

from collections import Counter
from collections.abc import Callable
from pathlib import Path

from msgspec import UNSET

from rtshcua.adapters.store.laying import appearing
from rtshcua.adapters.store.reading import exposed, open_regular, read_regular
from rtshcua.adapters.store.writing import PRIVATE_FILE, PRIVATE_FOLDER, make_folder, write_new
from rtshcua.wire import cose
from rtshcua.wire.key_file import MAX_KEY_FILE, dump_signing_key, load_signing_key
from rtshcua.wire.keys import ANY, Duty, SigningKey
from rtshcua.wire.trust import MAX_ROOT, Thresholds, TrustRoot
from rtshcua.wire.untrusted import Untrusted

ROOT = "root.trust"

_SOURCES = ("agent", "operator")
_SPEAKERS = (Duty.MISSION, Duty.APPROVAL)


class KeyStoreError(Untrusted):
    """A key store that does not serve: `no-keys`, `exists`, `exposed`, `too-large`."""


class KeyStore:
    """The keys in one folder."""

    def __init__(self, data: Path) -> None:
        self.folder = data / "keys"

    def exists(self) -> bool:
        """Whether keys were made here."""
        return self.folder.is_dir()

    def key_path(self, duty: Duty, number: int = 1) -> Path:
        """Where the key of a duty is; there may be several of witnesses."""
        return self.folder / (f"{duty}.key" if number == 1 else f"{duty}-{number}.key")

    def paths(self, root: TrustRoot) -> dict[bytes, Path]:
        """Where the key of each `kid` in the root is, if it is here: they are numbered as the root names them."""
        counts: Counter[Duty] = Counter()
        found = {}
        for key in root.keys:
            counts[key.duty] += 1
            found[key.kid] = self.key_path(key.duty, counts[key.duty])
        return found

    @property
    def root_path(self) -> Path:
        """Where the signed trust root is."""
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
    ) -> TrustRoot:
        """Makes a key for each duty, from 32 secret bytes of `seed` each, and the root that names them.

        The root trusts the mission and approval keys for every role, through agent and operator, on every vehicle. So
        many `witnesses` have a key each; what `witness_threshold` of them cosigned counts as anchored.
        Raises `KeyStoreError` (`exists`), and `KeyFileError` for keys that are neither encrypted nor for development.
        """
        if self.exists():
            raise KeyStoreError("exists", f"there are keys already in `{self.folder}`")
        counts = {duty: witnesses if duty is Duty.WITNESS else 1 for duty in Duty}
        keys = {
            self.key_path(duty, number).name: SigningKey.from_seed(seed(), duty=duty, development=development)
            for duty, count in counts.items()
            for number in range(1, count + 1)
        }
        root = TrustRoot(
            version=1,
            development=development,
            issued_at_us=now_us,
            expires_at_us=expires_us,
            keys=tuple(
                key.verification(
                    roles=(ANY,) if key.duty in _SPEAKERS else (),
                    sources=_SOURCES if key.duty in _SPEAKERS else (),
                    vehicles=() if key.duty is Duty.ROOT else (ANY,),
                )
                for key in keys.values()
            ),
            thresholds=Thresholds(witness=UNSET if witness_threshold == 1 else witness_threshold),
        )
        make_folder(self.folder.parent, mode=PRIVATE_FOLDER)
        with appearing(self.folder) as folder:
            for name, key in keys.items():
                write_new(folder / name, dump_signing_key(key, passphrase=passphrase), mode=PRIVATE_FILE)
            write_new(folder / ROOT, root.sign(keys[self.key_path(Duty.ROOT).name]), mode=PRIVATE_FILE)
        return root

    def signing_key(self, duty: Duty, *, passphrase: bytes | None = None) -> SigningKey:
        """The key of a duty. Raises `KeyStoreError`, `KeyFileError` (`passphrase-needed`, ...) and `WrongDuty`."""
        self._expect()
        return read_key(self.key_path(duty), duty, passphrase=passphrase)

    def root(self) -> bytes:
        """The signed trust root. Raises `KeyStoreError` (`no-keys`)."""
        self._expect()
        return read_root(self.root_path)

    def pin(self) -> bytes:
        """The `kid` of the root key that signed the root: what `open_root` pins. Raises `KeyStoreError` (`no-keys`)."""
        return cose.unverified(self.root(), limit=MAX_ROOT).kid

    def _expect(self) -> None:
        if not self.exists():
            raise KeyStoreError("no-keys", f"there are no keys in `{self.folder}`")


def read_key(path: Path, duty: Duty, *, passphrase: bytes | None) -> SigningKey:
    """The signing key in a file. Raises `KeyStoreError` (`exposed`), `KeyFileError`, `WrongDuty` and OSError."""
    with open_regular(path) as file:
        if mode := exposed(file):
            raise KeyStoreError("exposed", f"others may read the key `{path}`: its mode is {mode}")
        data = file.read(MAX_KEY_FILE + 1)
    return load_signing_key(data, duty=duty, passphrase=passphrase)


def read_root(path: Path) -> bytes:
    """The signed trust root in a file, not verified. Raises `KeyStoreError` (`too-large`) and OSError."""
    data = read_regular(path, MAX_ROOT)
    if len(data) > MAX_ROOT:
        raise KeyStoreError("too-large", f"`{path}` is larger than a trust root may be")
    return data
