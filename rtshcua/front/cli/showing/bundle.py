"""A bundle: who signed it, and all that it says."""

from base64 import b64decode
from typing import NamedTuple

from msgspec.structs import replace

from rtshcua.adapters.store.folders import data_folder
from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.decision.prepare import prepare, prepare_mission
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.showing.mission import show_mission
from rtshcua.front.cli.showing.named import named
from rtshcua.front.cli.showing.page import Page
from rtshcua.front.cli.showing.policy import show_policy
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.wire import cose, names
from rtshcua.wire.bundle import envelopes, open_bundle, parse, parse_unverified, policy_digest
from rtshcua.wire.digest import BUNDLE, digest
from rtshcua.wire.replacement import ReplacementDocument
from rtshcua.wire.trust import open_root
from rtshcua.wire.untrusted import Untrusted


class Claimed(NamedTuple):
    """What a bundle says, and which keys it says signed it: read for showing, and not to be trusted."""

    policy: Policy
    mission: Mission
    digest: bytes
    policy_digest: bytes
    policy_kid: bytes
    mission_kid: bytes


def claimed(data: bytes, *, trusted: bool = False) -> Claimed:
    """Takes a bundle apart without trusting it, and a very large one only if it is `trusted`. Raises `Untrusted`."""
    first, second = (cose.unverified(envelope) for envelope in envelopes(data))
    read = parse if trusted else parse_unverified
    policy, mission = read(names.POLICY, first.payload, Policy), read(names.MISSION, second.payload, Mission)
    prepared = prepare(policy)
    checked = prepared if isinstance(prepared, Refusal) else prepare_mission(mission, prepared)
    if isinstance(checked, Refusal):
        raise Untrusted("malformed", f"the bundle makes no sense: {checked.text}")
    return Claimed(policy, mission, digest(BUNDLE, data), policy_digest(first.payload), first.kid, second.kid)


def recorded_replacement(detail: str) -> ReplacementDocument:
    """A replacement that a record holds, which is not verified here. Raises `Untrusted`."""
    try:
        document = b64decode(detail, validate=True)
    except ValueError:
        raise Untrusted("malformed", "a recorded document is not base64") from None
    said = parse_unverified(names.REPLACEMENT, cose.unverified(document).payload, ReplacementDocument)
    return replace(said, kept=max(said.kept, 0))


def replaced(detail: str, mission: Mission) -> Mission:
    """The mission after a recorded replacement, which is not verified here. Raises `Untrusted`."""
    return over(recorded_replacement(detail), mission)


def over(said: ReplacementDocument, mission: Mission) -> Mission:
    """The mission after a replacement: the steps that stay, then the new ones."""
    steps = (*mission.invocations[: said.kept], *said.mission.invocations[said.kept :])
    return replace(said.mission, invocations=steps)


def show_bundle(page: Page, data: bytes, now_us: int) -> dict[str, object]:
    """Adds a bundle to the page, and gives it for a program. Raises `Untrusted`."""
    trusted, verdict = _verdict(data, now_us)
    what = claimed(data, trusted=trusted)
    page.head(f"Bundle of {len(data)} bytes")
    page.row("digest", what.digest.hex())
    page.row("policy", f"digest {what.policy_digest.hex()}, key {what.policy_kid.hex()}")
    page.row("mission", f"key {what.mission_kid.hex()}")
    page.row("signatures", verdict)
    show_mission(page, what.mission, what.policy)
    show_policy(page, what.policy)
    return {
        "kind": "bundle",
        "digest": what.digest.hex(),
        "policy_digest": what.policy_digest.hex(),
        "policy_key": what.policy_kid.hex(),
        "mission_key": what.mission_kid.hex(),
        "trusted": trusted,
        "verdict": verdict,
        "mission": named(what.mission),
        "policy": named(what.policy),
    }


def _verdict(data: bytes, now_us: int) -> tuple[bool, str]:
    """Whether the key store's root trusts the bundle now, and in words."""
    store = KeyStore(data_folder())
    try:
        root = open_root(store.root(), pinned=store.pin(), now_us=now_us)
        open_bundle(data, root=root, vehicle=None, now_us=now_us)
    except Untrusted as error:
        return False, f"not trusted here: {error}"
    return True, f"verified under the {'development' if root.development else 'trust'} root of your key store"
