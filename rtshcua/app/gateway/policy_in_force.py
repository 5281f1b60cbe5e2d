"""The policy of a gateway: compiled from its sources, and signed with the bundle that a flight waits with."""

import secrets
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Final, NamedTuple

from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.adapters.store.writing import PRIVATE_FILE, PRIVATE_FOLDER, make_folder, write_new
from rtshcua.app.documents import read_bundle
from rtshcua.app.gateway.proposals import PolicySigner, arranged
from rtshcua.app.propose import Missions, NoPolicy
from rtshcua.app.signing_keys import another_key, check_trusted
from rtshcua.decision.prepare import PreparedPolicy, prepare
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.gateway.interface import ProposedStep
from rtshcua.ground.pipeline.sign import sign
from rtshcua.model.flat.contract import Contract, MotionKind
from rtshcua.model.flat.mission import Mission
from rtshcua.model.quantity import Dimension, display
from rtshcua.wire import cose
from rtshcua.wire.bundle import MAX_BUNDLE, envelopes, policy_digest, policy_payload
from rtshcua.wire.keys import SEED_BYTES, Duty, SigningKey
from rtshcua.wire.untrusted import Untrusted

#: days until development keys expire
_DAYS: Final = 90
_DAY_US: Final = 86_400_000_000
#: altitudes at which a take-off is tried for the bundle that a flight waits with, in mm
_ALTITUDES: Final = (5_000, 10_000, 3_000, 20_000, 30_000, 50_000, 100_000)
NOTE: Final = "DEVELOPMENT-KEYS.txt"
_NOTE: Final = """\
These keys were made by `rtshcua gateway` without a passphrase, for trying it out.
Whoever can read this folder can sign policies and missions that are flown with it.
For a vehicle of yours, make your own: `rtshcua keys init --encrypted` (docs/flying/keys.md).
"""

#: returns the key of a duty, and of a source for missions; raises `Untrusted` and OSError
Unlock = Callable[[Duty, str], SigningKey]


class PolicyInForce(NamedTuple):
    """A compiled policy, prepared as on board, the agent's key with the signed policy, and the path of the bundle that
    a flight waits with.
    """

    missions: Missions
    prepared: PreparedPolicy
    signer: PolicySigner
    base: Path


def development_keys(data: Path, policies: Sequence[str]) -> KeyStore:
    """Return the key store of development keys in a private folder; they are made if there are none. Raises `Untrusted`
    and OSError.
    """
    store = KeyStore(data)
    if not store.exists():
        now_us = time.time_ns() // 1_000
        make_folder(data, mode=PRIVATE_FOLDER)
        store.create(
            lambda: secrets.token_bytes(SEED_BYTES), development=True, passphrase=None, now_us=now_us,
            expires_us=now_us + _DAYS * _DAY_US, policies=policies,
        )  # fmt: skip
        note = data / NOTE
        if not note.exists():
            write_new(note, _NOTE.encode(), mode=PRIVATE_FILE)
    return store


def policy_in_force(
    sources: Sequence[Path], bundle: Path | None, folder: Path, roles: Iterable[str], store: KeyStore, unlock: Unlock
) -> PolicyInForce | Refusal:
    """Compile the policy in `sources`, and sign a bundle under it into `folder`; with `bundle`, use that one. `roles`
    are those of the clients.
    """
    try:
        missions = Missions(sources)
        prepared = prepare(missions.policy)
        if isinstance(prepared, Refusal):
            return prepared
        unknown = next((role for role in roles if role not in missions.policy.roles), None)
        if unknown is not None:
            names = ", ".join(f"`{each}`" for each in missions.policy.roles)
            return Refusal("usage", f"`{missions.policy.name}` names no role `{unknown}`", f"its roles are {names}")
        key = unlock(Duty.MISSION, "agent")
        own = policy_digest(policy_payload(missions.policy))
        if bundle is not None:
            envelope, _ = envelopes(read_bundle(bundle))
            if policy_digest(cose.unverified(envelope, limit=MAX_BUNDLE).payload) != own:
                text = f"`{bundle}` is signed under another policy than the sources declare"
                return Refusal("other-policy", text, "compile it again from these sources", ExitCode.INPUT)
            return PolicyInForce(missions, prepared, PolicySigner(key, envelope, own), bundle)
        mission = _first_mission(missions, sorted(set(roles)))
        if isinstance(mission, Refusal):
            return mission
        try:
            check_trusted(store, key, missions.policy, mission)
        except Untrusted as error:
            return another_key(error, missions.policy, mission)
        data = sign(missions.policy, mission, policy_key=unlock(Duty.POLICY, ""), mission_key=key)
        base = folder / f"{missions.policy.name}-{missions.policy.version}.bundle"
        base.unlink(missing_ok=True)
        write_new(base, data)
        return PolicyInForce(missions, prepared, PolicySigner(key, envelopes(data)[0], own), base)
    except NoPolicy as error:
        help = "`rtshcua check` lists all errors of the sources"
        return Refusal("no-policy", str(error), help, ExitCode.DIAGNOSTICS)
    except Untrusted as error:
        first = "`rtshcua keys init` makes keys" if error.slug == "no-keys" else "`rtshcua keys list` shows the keys"
        return Refusal(error.slug, str(error), getattr(error, "help", "") or first)


def _first_mission(missions: Missions, roles: Sequence[str]) -> Mission | Refusal:
    """A mission that the policy permits an agent: it only carries the policy, and is never flown."""
    contracts = {each.name: each for each in missions.policy.contracts}
    climbs = [each for each in missions.policy.contracts if each.motion.kind == MotionKind.CLIMB]
    for role in roles or ("operator",):
        for contract in climbs:
            for altitude in _altitudes(contract):
                arguments = {_altitude(contract): display(altitude, Dimension.ALTITUDE)}
                step = ProposedStep(contract.name, arguments, ())
                found = missions.check(
                    {
                        "format": "rtshcua/mission-spec", "version": 1, "name": "waits",
                        "policy": {"name": missions.policy.name, "version": missions.policy.version},
                        "vehicle": missions.lowered.vehicle.name.text,
                        "intent": "carries the policy to the vehicle; it is not flown",
                        "proposed_by": {"source": "agent", "name": "gateway", "role": role},
                        "phases": arranged([step], contracts, None),
                    },
                    time.time_ns() // 1_000,
                )  # fmt: skip
                if found.mission is not None:
                    return found.mission
    text = f"`{missions.policy.name}` permits no take-off that an agent asks for as {', '.join(roles)}"
    help = "permit a skill that climbs: `permit takeoff by role operator through agent`"
    return Refusal("no-takeoff", text, help, ExitCode.REFUSED)


def _altitude(contract: Contract) -> str:
    return next(each.name for each in contract.parameters if each.cell == contract.motion.altitude)


def _altitudes(contract: Contract) -> list[int]:
    """Altitudes to try, in the range of the skill's parameter."""
    own = next(each for each in contract.parameters if each.cell == contract.motion.altitude)
    tried = [own.low, *_ALTITUDES, own.high]
    return list(dict.fromkeys(each for each in tried if own.low <= each <= own.high))
