"""The service `recall`: a signed document that ends a flight. Imports little, to start fast."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from rtshcua.adapters.store.folders import data_folder
from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.adapters.store.reading import read_regular
from rtshcua.app.exit_codes import untrusted
from rtshcua.app.flight_documents import WHOSE, bundle_in_flight, flight_id
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.wire import names
from rtshcua.wire.bundle import Bundle
from rtshcua.wire.document import MAX_DOCUMENT, kind_of
from rtshcua.wire.keys import SigningKey
from rtshcua.wire.recall import RecallDocument, sign_recall
from rtshcua.wire.untrusted import Untrusted


class Recalled(NamedTuple):
    """What a recall covers: the flying bundle, and the id of the flight, or empty for all flights under its policy."""

    flying: Bundle
    flight: bytes

    @property
    def name(self) -> str:
        """A description for messages."""
        flying = self.flying
        what = f"`{flying.mission.name}`" if self.flight else f"all under `{flying.policy.name}`"
        return f"{what} on `{flying.policy.vehicle.identity}`"

    def sign(self, key: SigningKey, now_us: int, seconds: int) -> bytes:
        """Return the signed recall, valid for `seconds` from now. Raises `Untrusted`."""
        flying = self.flying
        digests = (flying.mission_digest, b"") if self.flight else (b"", flying.policy_digest)
        vehicle = flying.policy.vehicle.identity
        said = RecallDocument(vehicle, self.flight, *digests, now_us, now_us + seconds * 1_000_000)
        return sign_recall(said, key)

    def signed(self, unlock: Callable[[KeyStore], SigningKey], seconds: int) -> bytes | Refusal:
        """Return the signed recall, valid for `seconds` from now. Raises OSError."""
        now_us = time.time_ns() // 1000
        try:
            return self.sign(unlock(KeyStore(data_folder())), now_us, seconds)
        except Untrusted as error:
            return untrusted(error)


def recall_of(
    bundle: Path, root: Path | None, flight: str | None, to: Path | None, *, whole_policy: bool
) -> Recalled | Refusal:
    """The recall of the flight of a bundle, or of all flights under its policy. Raises OSError."""
    try:
        flying = bundle_in_flight(bundle, [], root, time.time_ns() // 1000, stops=True)
        named = b"" if whole_policy else flight_id(flight, to)
    except Untrusted as error:
        return untrusted(error)
    if named is None:
        return Refusal("usage", "the flight of the recall is unknown", f"{WHOSE}, or `--policy`")
    return Recalled(flying, named)


def recall_in(path: Path) -> bytes | Refusal:
    """A recall that was signed earlier, not verified. Raises OSError."""
    document = read_regular(path, MAX_DOCUMENT)
    try:
        kind = kind_of(document)
    except Untrusted as error:
        return untrusted(error)
    if kind is not names.RECALL:
        return Refusal(
            "input", f"`{path}` is not a recall", "sign one with `rtshcua recall BUNDLE --flight ID -o FILE`"
        )
    return document
