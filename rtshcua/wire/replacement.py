"""Replacements: a new mission for a flight in progress, under the policy in force.

A mission key signs a whole mission, the digest of the mission that it supersedes, and how many of that mission's
first steps are kept. These must be the same steps, to the last argument and clause; only source positions may
differ. On board they stay as they were first signed. The steps after them replace those that were not released.
"""

from dataclasses import replace as with_fields
from typing import Final, NamedTuple

from msgspec.structs import replace

from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import Contract, SourceKind
from rtshcua.model.flat.mission import Invocation, Mission
from rtshcua.model.flat.situation import Now
from rtshcua.model.flat.struct import Flat
from rtshcua.model.step_number import step_words
from rtshcua.wire import cbor, names
from rtshcua.wire.binding import bind
from rtshcua.wire.bundle import Bundle, check_bundle, check_proposer
from rtshcua.wire.digest import MISSION, digest
from rtshcua.wire.document import DocumentError, check_flight, open_document, sign_document
from rtshcua.wire.keys import Duty, SigningKey, VerificationKey
from rtshcua.wire.trust import HUMAN, TrustRoot

#: the most replacements of one flight
MAX_REPLACEMENTS: Final = 256


class ReplacementDocument(Flat, frozen=True):
    """The content that a mission key signs: in this flight the mission of digest `supersedes` keeps its first `kept`
    steps, and `mission` is the whole mission that then flies.
    """

    flight: bytes
    supersedes: bytes
    kept: int
    mission: Mission


class VerifiedReplacement(NamedTuple):
    """A verified replacement of the mission of digest `supersedes`; `digest` is the digest of the new mission."""

    supersedes: bytes
    kept: int
    mission: Mission
    digest: bytes
    key: VerificationKey

    @property
    def new(self) -> frozenset[bytes]:
        """The ids of the new steps."""
        return frozenset([each.invocation_id for each in self.mission.invocations[self.kept :]])

    def over(self, bundle: Bundle) -> Bundle:
        """The bundle with the mission now in force: the kept steps as they were first signed, then the new ones."""
        steps = (*bundle.mission.invocations[: self.kept], *self.mission.invocations[self.kept :])
        mission = replace(self.mission, invocations=steps)
        return with_fields(bundle, mission=mission, mission_digest=self.digest, mission_key=self.key)


def sign_replacement(mission: Mission, *, over: Bundle, flight: bytes, kept: int, key: SigningKey) -> bytes:
    """The signed document, with the mission bound to the policy of `over`.

    Raises `WrongDuty` for a key of another duty, and `DocumentError` (`other-steps`) if the kept steps differ from
    those of `over`.
    """
    _check_kept(over.mission, mission, kept)
    bound = bind(mission, over.policy_digest, after=_after(flight, over.mission_digest, kept))
    body = ReplacementDocument(flight, over.mission_digest, kept, bound)
    return sign_document(names.REPLACEMENT, body, key, Duty.MISSION)


def open_replacement(
    document: bytes, *, root: TrustRoot, vehicle: str, flight: bytes | None, bundle: Bundle, now: Now
) -> VerifiedReplacement:
    """The replacement in a document, if it is trusted now, for a flight (None: the one that it names) under the
    policy of `bundle`.

    `fit_replacement` checks it against the flown steps. Raises `DocumentError` (`other-flight`,
    `issued-in-future`, `no-step`), `BundleError` as for a mission in a bundle, `EnvelopeError` and
    `ArtefactError`.
    """
    said, opened = open_document(document, names.REPLACEMENT, ReplacementDocument, Duty.MISSION, root, now)
    if flight is not None:
        check_flight(said.flight, flight)
    found = VerifiedReplacement(said.supersedes, said.kept, said.mission, digest(MISSION, opened.payload), opened.key)
    candidate = with_fields(bundle, mission=found.mission, mission_digest=found.digest, mission_key=opened.key)
    check_bundle(
        candidate, vehicle, now.utc_us + now.utc_error_us, after=_after(said.flight, said.supersedes, said.kept)
    )
    if found.mission.issued_at_us > now.utc_us + now.utc_error_us:
        raise DocumentError("issued-in-future", "the document's time of issue is in the future")
    if not found.mission.invocations:
        raise DocumentError("no-step", "the replacement contains no new step")
    return found


def fit_replacement(found: VerifiedReplacement, bundle: Bundle, released: int, *, compared: bytes = b"") -> Bundle:
    """The bundle in force after a replacement of the mission in `bundle`, of which `released` steps were released.
    `compared` is the digest of the mission that `check_stays` compared before.

    Raises `DocumentError`: `superseded` (it replaces a mission that is not in force), `already-released`,
    `other-steps`; and `BundleError` for a key that is not authorised for the replaced steps.
    """
    if found.supersedes != bundle.mission_digest:
        raise DocumentError("superseded", "the replacement is for a mission that is not in force")
    if found.kept < released:
        text = f"the replacement changes {step_words(found.kept)}, but {released} steps were released already"
        raise DocumentError("already-released", text)
    if compared != bundle.mission_digest:
        check_stays(found, bundle)
    return found.over(bundle)


def check_stays(found: VerifiedReplacement, bundle: Bundle) -> None:
    """Check that the kept steps of `bundle` are the same, and that the key may set the others aside. The time grows
    with the number of steps. Raises `DocumentError` and `BundleError`.
    """
    _check_kept(bundle.mission, found.mission, found.kept)
    check_set_aside(found.key, bundle, found.kept)


def _after(flight: bytes, supersedes: bytes, kept: int) -> bytes:
    """The additional input of a replacement's ids, so that they differ from those of every bundle and other flight."""
    return cbor.encode([flight, supersedes, kept])


def check_set_aside(key: VerificationKey, bundle: Bundle, first: int) -> None:
    """Check that a mission key may set aside the steps of a bundle from `first` on: it must be authorised for their
    proposers. An agent may only set aside what agents proposed. Expiry of the key is checked before.

    Raises `BundleError`.
    """
    steps = bundle.mission.invocations[first:]
    if HUMAN in key.sources:
        steps = tuple(replace(each, source=SourceKind.OPERATOR) for each in steps)
    check_proposer(key, bundle.policy, steps, now_us=0)


def _check_kept(old: Mission, new: Mission, kept: int) -> None:
    """Check that the first `kept` steps are the same, in phases of the same names."""
    if not 0 <= kept <= min(len(old.invocations), len(new.invocations)):
        text = (
            f"{kept} steps cannot be kept: the old mission has {len(old.invocations)} and the new one "
            f"{len(new.invocations)}"
        )
        raise DocumentError("other-steps", text)
    phases = 1 + max((each.phase for each in old.invocations[:kept]), default=-1)
    if old.phases[:phases] != new.phases[:phases]:
        raise DocumentError("other-steps", "the phases of the kept steps have other names or another order")
    for number in range(kept):
        if _essence(old.invocations[number], phases) != _essence(new.invocations[number], phases):
            raise DocumentError("other-steps", f"{step_words(number)} should be kept but differs")


def _essence(invocation: Invocation, phases: int) -> Invocation:
    """The content of an invocation without its name, its time of issue and its source position.

    Of its phases, those count that both missions have.
    """
    return replace(
        invocation,
        invocation_id=b"",
        binding=b"",
        issued_at_us=0,
        phases=invocation.phases & ((1 << phases) - 1),
        contract=_unplaced(invocation.contract),
        file=0,
        start=0,
        end=0,
    )


def _unplaced(contract: Contract) -> Contract:
    return replace(
        contract,
        require=tuple(map(_nowhere, contract.require)),
        assume=tuple(map(_nowhere, contract.assume)),
        maintain=tuple(map(_nowhere, contract.maintain)),
        fallback=tuple(replace(link, source=0, start=0, end=0) for link in contract.fallback),
    )


def _nowhere(clause: Clause) -> Clause:
    return replace(clause, source=0, start=0, end=0)
