"""Sign a recall, or send one signed earlier. No typer here: a recall must start fast."""

import time
from pathlib import Path
from typing import Final, NamedTuple

from rtshcua.adapters.store.folders import data_folder
from rtshcua.adapters.store.reading import read_regular
from rtshcua.app.exit_codes import untrusted
from rtshcua.app.flight_documents import bundle_in_flight, flight_id
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.documents import WHERE, WHOSE, deliver
from rtshcua.front.cli.faults import fail, refuse
from rtshcua.wire import names
from rtshcua.wire.bundle import Bundle
from rtshcua.wire.document import MAX_DOCUMENT, kind_of
from rtshcua.wire.keys import SigningKey
from rtshcua.wire.recall import RecallDocument, sign_recall
from rtshcua.wire.untrusted import Untrusted

#: default validity of a recall, s
GOOD_S: Final = 300
#: help if another mission flies: one that an agent submitted has its own bundle
HELP: Final = {"other-mission": "`--policy` recalls every mission under the policy of this bundle"}
_SENT_HELP: Final = HELP | {"expired": "sign a new one: `rtshcua recall BUNDLE --to SOCKET`"}


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


def recall(
    bundle: Path | None, *, policy: bool = False, seconds: int = GOOD_S, to: Path | None = None,
    output: Path | None = None, send: Path | None = None, root: Path | None = None, flight: str | None = None,
    person: str | None = None, approval_key: Path | None = None, passphrase_file: Path | None = None,
    as_json: bool = False,
) -> ExitCode:  # fmt: skip
    """Run `rtshcua recall`. Raises OSError."""
    if send is not None:
        return _send(send, to, alone=bundle is None and output is None, as_json=as_json)
    if bundle is None:
        return fail(
            ExitCode.USAGE, "BUNDLE is missing", "name the flying bundle, or send a signed recall with `--send FILE`"
        )
    if to is None and output is None:
        return fail(ExitCode.USAGE, "no destination for the recall", WHERE)
    now_us = time.time_ns() // 1000
    from rtshcua.adapters.store.keystore import KeyStore  # slow to import, and not needed for `--send`
    from rtshcua.front.cli.unlock import unlock_person

    try:
        flying = bundle_in_flight(bundle, [], root, now_us, stops=True)
        named = b"" if policy else flight_id(flight, to)
        if named is None:
            return fail(ExitCode.USAGE, "the flight of the recall is unknown", f"{WHOSE}, or `--policy`")
        recalled = Recalled(flying, named)
        key = unlock_person(KeyStore(data_folder()), person, None, path=approval_key, passphrase_file=passphrase_file)
        document = recalled.sign(key, now_us, seconds)
    except Untrusted as error:
        return refuse(untrusted(error))
    return deliver(document, f"recalled {recalled.name}", to=to, output=output, as_json=as_json, help=HELP)


def _send(path: Path, to: Path | None, *, alone: bool, as_json: bool) -> ExitCode:
    """Send a recall signed earlier. Only its kind is checked here; the flight verifies it."""
    if not alone or to is None:
        text = "`--send` requires `--to SOCKET`, and conflicts with BUNDLE and `--output`"
        return fail(ExitCode.USAGE, text, "`rtshcua recall --send FILE --to SOCKET`")
    document = read_regular(path, MAX_DOCUMENT)
    try:
        kind = kind_of(document)
    except Untrusted as error:
        return refuse(untrusted(error))
    if kind is not names.RECALL:
        text = f"`{path}` is not a recall"
        return fail(ExitCode.INPUT, text, "sign one with `rtshcua recall BUNDLE --flight ID -o FILE`")
    return deliver(document, f"sent `{path}`", to=to, output=None, as_json=as_json, help=_SENT_HELP)
