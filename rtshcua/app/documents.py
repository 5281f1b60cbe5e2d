"""Recognise files by their content, and read bundles and recorded documents without verification."""

from base64 import b64decode
from pathlib import Path
from typing import Final, NamedTuple

from msgspec.structs import replace

from rtshcua.adapters.store.reading import open_regular, read_regular
from rtshcua.decision.prepare import PreparedInvocation, PreparedPolicy, prepare, prepare_mission
from rtshcua.diagnostics.kinds import BUNDLE, DOCUMENT, EMPTY, LOG, LOOKED_AT, FileKind, recognised
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.wire import cose, names
from rtshcua.wire.bundle import MAX_BUNDLE, envelopes, parse, parse_unverified, policy_digest
from rtshcua.wire.digest import BUNDLE as BUNDLE_DIGEST
from rtshcua.wire.digest import digest
from rtshcua.wire.replacement import ReplacementDocument
from rtshcua.wire.untrusted import Untrusted


class Claimed(NamedTuple):
    """The contents of an unverified bundle, and the ids of the keys that it names; for display only."""

    policy: Policy
    mission: Mission
    digest: bytes
    policy_digest: bytes
    policy_kid: bytes
    mission_kid: bytes


class PreparedBundle(NamedTuple):
    """An unverified bundle, and its policy and mission as they are prepared on board."""

    said: Claimed
    policy: PreparedPolicy
    invocations: tuple[PreparedInvocation, ...]


def claimed(data: bytes, *, trusted: bool = False) -> Claimed:
    """Parse a bundle without verifying it; a very large one only if it is `trusted`. Raises `Untrusted`."""
    return claimed_and_prepared(data, trusted=trusted).said


def claimed_and_prepared(data: bytes, *, trusted: bool = False) -> PreparedBundle:
    """As `claimed`, with what is prepared of it."""
    first, second = (cose.unverified(envelope) for envelope in envelopes(data))
    read = parse if trusted else parse_unverified
    policy, mission = read(names.POLICY, first.payload, Policy), read(names.MISSION, second.payload, Mission)
    prepared = prepare(policy)
    if isinstance(prepared, Refusal):
        raise _inconsistent(prepared)
    invocations = prepare_mission(mission, prepared)
    if isinstance(invocations, Refusal):
        raise _inconsistent(invocations)
    of_policy = policy_digest(first.payload)
    said = Claimed(policy, mission, digest(BUNDLE_DIGEST, data), of_policy, first.kid, second.kid)
    return PreparedBundle(said, prepared, invocations)


def _inconsistent(refusal: Refusal) -> Untrusted:
    return Untrusted("malformed", f"the bundle is inconsistent: {refusal.text}")


def recorded_replacement(detail: str) -> ReplacementDocument:
    """Parse the replacement in a record without verifying it. Raises `Untrusted`."""
    try:
        data = b64decode(detail, validate=True)
    except ValueError:
        raise Untrusted("malformed", "a recorded document is not base64") from None
    document = parse_unverified(names.REPLACEMENT, cose.unverified(data).payload, ReplacementDocument)
    return replace(document, kept=max(document.kept, 0))


def replaced(detail: str, mission: Mission) -> Mission:
    """The mission after a recorded replacement, which is not verified. Raises `Untrusted`."""
    return over(recorded_replacement(detail), mission)


def over(document: ReplacementDocument, mission: Mission) -> Mission:
    """The mission after a replacement: the kept steps, then the new ones."""
    steps = (*mission.invocations[: document.kept], *document.mission.invocations[document.kept :])
    return replace(document.mission, invocations=steps)


_BUNDLES: Final = "accepted: a bundle, as `rtshcua compile` makes it"


class Mistaken(Untrusted):
    """A file of the wrong kind; `help` says how to use such a file."""

    def __init__(self, text: str, help: str) -> None:
        super().__init__("wrong-kind", text)
        self.help = help


def kind_of(path: Path) -> FileKind | None:
    """The kind of a file; None if it is unknown, or the file cannot be read."""
    try:
        with open_regular(path) as file:
            data = file.read(LOOKED_AT)
            return recognised(data, path.name) if data else EMPTY
    except OSError:
        return None


def no_log(path: Path, name: Path, help: str) -> tuple[str, str]:
    """The text and the help for a file that is not a log. `name` is its name on the command line."""
    kind = kind_of(path)
    if kind is None or kind is LOG:
        return f"`{name}` is not a log of this program", help
    return f"`{name}` is {kind.name}, not a log", f"{kind.help}; {help}" if kind.help else help


def no_bundle(path: Path) -> Mistaken | None:
    """The error if a file is clearly not a bundle; None if it may be one."""
    kind = kind_of(path)
    if kind is None or kind in (BUNDLE, DOCUMENT):
        return None
    return Mistaken(f"`{path}` is {kind.name}, not a bundle", kind.help or _BUNDLES)


def read_bundle(path: Path) -> bytes:
    """Read a bundle. Raises `Mistaken` for a file of another kind, and OSError."""
    data = read_regular(path, MAX_BUNDLE)
    mistaken = no_bundle(path)
    if mistaken is not None:
        raise mistaken
    return data
