"""The subject of a document signed for a flight: the verified bundle that flies, and the flight's id."""

import re
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from rtshcua.adapters.agent_socket import FlightReply, flight_at, hand_in
from rtshcua.adapters.store.folders import data_folder
from rtshcua.adapters.store.keystore import KeyStore, read_root
from rtshcua.adapters.store.reading import read_regular
from rtshcua.adapters.store.vehicle_records import opened_root
from rtshcua.adapters.store.writing import PRIVATE_FILE, write_out
from rtshcua.app.documents import read_bundle
from rtshcua.app.fly.vehicle_trust import LAPSED, REVOKED
from rtshcua.decision.prepare import PreparedInvocation, prepare, prepare_mission
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.situation import Now
from rtshcua.wire import cose, names
from rtshcua.wire.bundle import Bundle, BundleError, open_bundle
from rtshcua.wire.document import MAX_DOCUMENT, MAX_LIFE_US, kind_of
from rtshcua.wire.replacement import fit_replacement, open_replacement
from rtshcua.wire.trust import MAX_ROOT, TrustRoot, open_root
from rtshcua.wire.untrusted import Untrusted

#: the longest validity of a document, in seconds
MOST_S = MAX_LIFE_US // 1_000_000
#: help for a missing flight
WHOSE = "add `--flight ID` (32 hexadecimal digits, or a socket of the flight)"

_FLIGHT = re.compile(r"[0-9a-f]{32}")


def bundle_in_flight(
    bundle: Path, replacements: Sequence[Path], root: Path | None, now_us: int, *, stops: bool = False
) -> Bundle:
    """Verify the bundle that flies, with the replacements that came into force since.

    A document that only `stops` a flight can be signed also if a key of the bundle was revoked or has expired since the
    flight began, because it flies on under the earlier root. Raises `Untrusted` and OSError.
    """
    trusted = trusted_root(root, now_us)
    data = read_bundle(bundle)
    try:
        found = open_bundle(data, root=trusted, vehicle=None, now_us=now_us)
    except Untrusted as error:
        if not stops or error.slug not in (REVOKED, *LAPSED):
            raise
        found = _of_before(data, trusted if root is not None else None, error)
    documents = [read_regular(path, MAX_DOCUMENT) for path in replacements]
    return with_replacements(found, documents, trusted, now_us, stops=stops)


def with_replacements(
    found: Bundle, documents: Sequence[bytes], trusted: TrustRoot, now_us: int, *, stops: bool = False
) -> Bundle:
    """The verified bundle after replacements that came into force, in order, which are verified here. Unless a document
    only `stops` the flight, each mission is one that the vehicle accepts. Raises `Untrusted`.
    """
    vehicle, now = found.policy.vehicle.identity, Now(0, now_us, 0)
    missions = [found.mission]
    for document in documents:
        newer = open_replacement(document, root=trusted, vehicle=vehicle, flight=None, bundle=found, now=now)
        found = fit_replacement(newer, found, released=0)
        missions.append(newer.mission)
    if not stops:
        prepare_missions(found.policy, missions)
    return found


def prepare_missions(policy: Policy, missions: Sequence[Mission]) -> list[tuple[PreparedInvocation, ...]]:
    """Prepare the steps of missions for decisions. Raises `BundleError` for a mission that the vehicle would refuse:
    its texts may describe something that does not fly, so nothing is signed for it.
    """
    ready, found = prepare(policy), []
    for mission in missions:
        steps = ready if isinstance(ready, Refusal) else prepare_mission(mission, ready)
        if isinstance(steps, Refusal):
            raise BundleError("malformed", f"this would be refused on board: {steps.text}")
        found.append(steps)
    return found


def _of_before(data: bytes, named: TrustRoot | None, refused: Untrusted) -> Bundle:
    """The bundle under the named root, or an earlier root of the key store, regardless of expiry. Raises `refused` if
    none of them trusts it.
    """
    roots = [named] if named is not None else [opened_root(each) for each in reversed(KeyStore(data_folder()).chain())]
    for root in roots:
        with suppress(Untrusted):
            return open_bundle(data, root=root, vehicle=None, now_us=0)
    raise refused


def flight_id(flight: str | None, to: Path | None) -> bytes | None:
    """The id of the flight: parsed from 32 hexadecimal digits, or read from the flight's agent socket. None without
    either. Raises OSError for a socket that reports none.

    A flight that reports the id of another one gains nothing, because signed documents also name the mission.
    """
    if flight is not None and _FLIGHT.fullmatch(flight):
        return bytes.fromhex(flight)
    place = to if flight is None else Path(flight)
    return None if place is None else flight_at(place)


def trusted_root(path: Path | None, now_us: int) -> TrustRoot:
    """The key store's root, or the named one, which the user trusts by naming it."""
    signed = KeyStore(data_folder()).root() if path is None else read_root(path)
    return open_root(signed, pinned=cose.unverified(signed, limit=MAX_ROOT).kid, now_us=now_us)


def send_document(document: bytes, to: Path | None, output: Path | None) -> FlightReply | None:
    """Write a document, and send it to a flight; return its answer, or None if it was not sent. Raises OSError."""
    if output is not None:
        write_out(output, document, mode=PRIVATE_FILE)
    return None if to is None else hand_in(to, document)


def replacement_in(path: Path) -> bytes | Refusal:
    """A signed replacement, not verified. Raises OSError."""
    document = read_regular(path, MAX_DOCUMENT)
    try:
        kind = kind_of(document)
    except Untrusted as error:
        return Refusal("input", f"`{path}` is not a replacement: {error}")
    return (
        document if kind is names.REPLACEMENT else Refusal("input", f"`{path}` is not a replacement but `{kind.name}`")
    )
