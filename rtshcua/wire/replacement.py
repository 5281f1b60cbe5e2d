"""Replacements: a new mission for a flight that is under way, under the policy that it flies under.

A mission key signs a whole mission, the digest of the one that it supersedes, and how many of that one's first steps
stay. These must be the same steps, to the last argument and clause, though the sources may have moved; on board they
stay as they were signed first. What follows them takes the place of what was not yet released.
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

#: how many replacements one flight takes
MAX_REPLACEMENTS: Final = 64


class ReplacementDocument(Flat, frozen=True):
    """What a mission key signs: in this flight the mission of digest `supersedes` keeps its first `kept` steps, and
    `mission` is the whole that then flies.
    """

    flight: bytes
    supersedes: bytes
    kept: int
    mission: Mission


class VerifiedReplacement(NamedTuple):
    """A verified replacement of the mission of digest `supersedes`; `digest` names the mission from now on."""

    supersedes: bytes
    kept: int
    mission: Mission
    digest: bytes
    key: VerificationKey

    @property
    def new(self) -> frozenset[bytes]:
        """The ids of the steps that are new."""
        return frozenset([each.invocation_id for each in self.mission.invocations[self.kept :]])

    def over(self, bundle: Bundle) -> Bundle:
        """The bundle with what is in force now: the steps that stay as they were signed first, then the new ones."""
        steps = (*bundle.mission.invocations[: self.kept], *self.mission.invocations[self.kept :])
        mission = replace(self.mission, invocations=steps)
        return with_fields(bundle, mission=mission, mission_digest=self.digest, mission_key=self.key)


def sign_replacement(mission: Mission, *, over: Bundle, flight: bytes, kept: int, key: SigningKey) -> bytes:
    """The signed document, with the mission bound to the policy of `over`.

    Raises `WrongDuty` for a key of another duty, and `DocumentError` (`other-steps`) where the steps that are to stay
    are not those of `over`.
    """
    _check_kept(over.mission, mission, kept)
    bound = bind(mission, over.policy_digest, after=_after(flight, over.mission_digest, kept))
    body = ReplacementDocument(flight, over.mission_digest, kept, bound)
    return sign_document(names.REPLACEMENT, body, key, Duty.MISSION)


def open_replacement(
    document: bytes, *, root: TrustRoot, vehicle: str, flight: bytes | None, bundle: Bundle, now: Now
) -> VerifiedReplacement:
    """A replacement that is to be trusted here and now, for a flight (None: whichever it names) under the policy of
    `bundle`.

    Whether it fits what has flown is for `fit_replacement`. Raises `DocumentError` (`other-flight`, `issued-in-future`,
    `no-step`),
    `BundleError` as for a mission in a bundle, `EnvelopeError` and `ArtefactError`.
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
        raise DocumentError("issued-in-future", "it says that it will be issued later than now")
    if not found.mission.invocations:
        raise DocumentError("no-step", "it leaves no step to fly")
    return found


def fit_replacement(found: VerifiedReplacement, bundle: Bundle, released: int, *, compared: bytes = b"") -> Bundle:
    """What is in force after a replacement of the mission in `bundle`, of which `released` steps were released.
    `compared` is the digest of the mission that `check_stays` was asked about before.

    Raises `DocumentError`: `superseded` (it replaces what is not in force), `already-released`, `other-steps`; and
    `BundleError` for a key that may not speak for what is replaced.
    """
    if found.supersedes != bundle.mission_digest:
        raise DocumentError("superseded", "it replaces another mission than the one in force")
    if found.kept < released:
        text = f"it changes {step_words(found.kept)}, and {released} steps were released already"
        raise DocumentError("already-released", text)
    if compared != bundle.mission_digest:
        check_stays(found, bundle)
    return found.over(bundle)


def check_stays(found: VerifiedReplacement, bundle: Bundle) -> None:
    """Whether the steps of `bundle` that are to stay are the same, and the key may set the others aside. It takes as
    long as there are steps. Raises `DocumentError` and `BundleError`.
    """
    _check_kept(bundle.mission, found.mission, found.kept)
    check_set_aside(found.key, bundle, found.kept)


def _after(flight: bytes, supersedes: bytes, kept: int) -> bytes:
    """What the ids of a replacement follow from beside its mission: so they are those of no bundle
    and no other flight.
    """
    return cbor.encode([flight, supersedes, kept])


def check_set_aside(key: VerificationKey, bundle: Bundle, first: int) -> None:
    """Whether a mission key may set aside the steps of a bundle from `first` on: who does may speak for those who
    proposed them. An agent sets aside what agents proposed, no more. Whether the key expired is asked before.

    Raises `BundleError`.
    """
    steps = bundle.mission.invocations[first:]
    if HUMAN in key.sources:
        steps = tuple(replace(each, source=SourceKind.OPERATOR) for each in steps)
    check_proposer(key, bundle.policy, steps, now_us=0)


def _check_kept(old: Mission, new: Mission, kept: int) -> None:
    """The first `kept` steps are the same, in phases of the same names."""
    if not 0 <= kept <= min(len(old.invocations), len(new.invocations)):
        text = f"{kept} steps cannot stay: there were {len(old.invocations)}, and there are {len(new.invocations)}"
        raise DocumentError("other-steps", text)
    phases = 1 + max((each.phase for each in old.invocations[:kept]), default=-1)
    if old.phases[:phases] != new.phases[:phases]:
        raise DocumentError("other-steps", "the phases of the steps that stay have other names or another order")
    for number in range(kept):
        if _essence(old.invocations[number], phases) != _essence(new.invocations[number], phases):
            raise DocumentError("other-steps", f"{step_words(number)} is to stay, and is not the same step")


def _essence(invocation: Invocation, phases: int) -> Invocation:
    """All that an invocation says, without what names it, when it was issued, and where in its source it stood.

    Of the phases in which it means something, those count that both missions have.
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
