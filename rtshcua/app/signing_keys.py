"""Select the keys of the key store that may sign a mission, a bundle or an approval, without decrypting them."""

from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from rtshcua.adapters.store.keystore import KeyStore, KeyStoreError
from rtshcua.app.exit_codes import untrusted
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.contract import SourceKind
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.wire.bundle import BundleError, check_proposer
from rtshcua.wire.keys import Duty, SigningKey, VerificationKey
from rtshcua.wire.trust import TrustRoot, key_refusal, open_root
from rtshcua.wire.untrusted import Untrusted


def fitting_key(store: KeyStore, policy: Policy, mission: Mission) -> Path | None:
    """The file of the first key that may sign a mission under a policy; None if there is none."""
    if not store.exists():
        return None
    root = open_root(store.root(), pinned=store.pin(), now_us=0)
    paths = store.paths(root)
    for kid, key in root.keys_for(Duty.MISSION).items():
        if kid in paths and paths[kid].is_file():
            with suppress(BundleError):
                check_proposer(key, policy, mission.invocations, now_us=0)
                return paths[kid]
    return None


def person_key(store: KeyStore, person: str | None, role: str | None) -> VerificationKey:
    """The approval key of a person in a role, without decrypting it, so that it can be shown before the prompt. Raises
    `Untrusted` (`no-approver`, `several-approvers`, ...) and OSError.
    """
    root = open_root(store.root(), pinned=store.pin(), now_us=0)
    keys = [
        key
        for key in root.keys_for(Duty.APPROVAL).values()
        if person in (None, key.person) and role in (None, *key.roles)
    ]
    who = f"{person or 'anybody'} as {role or 'anything'}"
    if not keys:
        raise KeyStoreError("no-approver", _no_approver(root, person, role, who))
    if len({key.person for key in keys}) > 1:
        names = ", ".join(f"`{each}`" for each in sorted({key.person for key in keys}))
        raise KeyStoreError("several-approvers", f"there are approval keys of {names}: select one with `--as NAME`")
    return keys[0]


def _no_approver(root: TrustRoot, person: str | None, role: str | None, who: str) -> str:
    """The text if there is no such approval key, or the person's key is for other roles."""
    own = {one for key in root.keys_for(Duty.APPROVAL).values() if person == key.person for one in key.roles}
    if person is None or not own:
        return f"there is no approval key of {who}: `rtshcua keys approver` makes one"
    may = ", ".join(f"`{one}`" for one in sorted(own))
    return f"the key of {person} may sign as {may}, but not as {role}: `rtshcua keys approver` makes another key"


def check_trusted(store: KeyStore, key: SigningKey, policy: Policy, mission: Mission) -> None:
    """Check that the trust root, if it names the key, allows it to sign this mission, as a run does. Raises
    `BundleError`.
    """
    if not store.exists():
        return
    root = open_root(store.root(), pinned=store.pin(), now_us=0)
    named = root.keys_for(Duty.MISSION).get(key.kid)
    if named is not None:
        check_proposer(named, policy, mission.invocations, now_us=0)


def strangers(store: KeyStore, keys: Iterable[SigningKey], vehicle: str, now_us: int) -> list[str]:
    """A warning for each key that the store's trust root does not accept for the vehicle. A run with this root refuses
    what they sign, but the vehicle may have another root.
    """
    if not store.exists():
        return []
    root = open_root(store.root(), pinned=store.pin(), now_us=0)
    warnings = []
    for key in keys:
        named = root.keys_for(key.duty).get(key.kid)
        refusal = None if named is None else key_refusal(named, vehicle=vehicle, now_us=now_us)
        if key.kid in root.revocations:
            why = "revokes it"
        elif named is None:
            why = f"does not name this {key.duty} key"
        elif refusal is not None:
            why = f"does not accept it for `{vehicle}` now ({refusal})"
        else:
            continue
        warnings.append(
            f"the trust root of this key store {why}: {key.kid.hex()}; `run` with this root refuses the bundle; "
            f"use one "
            "that names the key (`--root`)"
        )
    return warnings


def another_key(error: Untrusted, policy: Policy, mission: Mission) -> Refusal:
    """The refusal of a mission key for a mission, with the command that makes a suitable key."""
    if error.slug not in ("wrong-source", "wrong-role", "key-other-policy") or not mission.invocations:
        return untrusted(error)
    first = mission.invocations[0]
    source, role = SourceKind(first.source).name.lower(), policy.roles[first.role]
    make = f"`rtshcua keys mission {source} --role {role} --policy {policy.name}` makes a key that may"
    return Refusal(error.slug, str(error), make)
