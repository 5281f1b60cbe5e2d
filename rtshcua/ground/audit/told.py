"""What an audit proves beyond its log's own chain and seals, and what it does not, in words."""

from rtshcua.evidence.finding import Claim
from rtshcua.evidence.records import Genesis
from rtshcua.ground.audit.meaning import UNENFORCED, Meaning
from rtshcua.ground.audit.trust import Basis

Claims = tuple[tuple[Claim, ...], tuple[Claim, ...]]


def of_trust(genesis: Genesis, basis: Basis) -> Claims:
    """What the pinned key vouches for, and what it does not."""
    bundle = basis.bundle
    kind = "development root" if basis.root.development else "trust root"
    proven = (
        Claim("trust", f"the {kind} is signed by the pinned key, and gives log key {genesis.log_kid} its duty"),
        Claim(
            "bundle",
            f"mission `{bundle.mission.name}` under `{bundle.policy.name}@{bundle.policy.version}` on "
            f"`{genesis.vehicle}`, both signed by keys that the root trusts for them",
        ),
    )
    if not basis.root.development:
        return proven, ()
    text = "development keys lie unencrypted where they were made: whoever can read them can sign anything"
    return proven, (Claim("development", text),)


def of_meaning(basis: Basis, meaning: Meaning) -> Claims:
    """What deriving again proved."""
    proven = [Claim("decisions", f"{_many(meaning.derived, 'decision')} derived again, each with the same answer")]
    documents = [
        f"{_many(count, kind)}{_by(meaning.people[kind])}" for kind, count in meaning.documents.items() if count
    ]
    if documents:
        text = f"{', '.join(documents)}, each signed by a key that the root trusts for it, and good when it came"
        proven.append(Claim("documents", text))
    if meaning.preparations.count:
        text = f"{_many(meaning.preparations.count, 'parameter')} listed to be set or put back, none while it flew"
        proven.append(Claim("preparations", text))
    unproven = [Claim("state", "that the recorded state is what the vehicle's sensors saw")]
    if basis.policy.monitors:
        text = "what the temporal monitors said between the records: only that no recorded state rules it out"
        unproven.append(Claim("monitors", text))
    if meaning.mode == UNENFORCED:
        unproven.append(Claim("enforcement", "mode `none`: nothing was enforced, so dispatches needed no permit"))
    else:
        text = f"{_many(meaning.dispatches, 'dispatch', 'dispatches')}, each after a record that permits it"
        proven.append(Claim("dispatches", text))
    return tuple(proven), tuple(unproven)


def _by(people: list[str]) -> str:
    return f" by {' and '.join(people)}" if people else ""


def _many(count: int, one: str, more: str | None = None) -> str:
    return f"{count} {one if count == 1 else more or one + 's'}"
