"""A mission prepared for decisions under its policy, also from an unverified bundle."""

from typing import NamedTuple

from rtshcua.app.documents import PreparedBundle, claimed_and_prepared, over, recorded_replacement
from rtshcua.decision.prepare import PreparedInvocation, PreparedPolicy, prepare, prepare_mission
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.wire.untrusted import Untrusted


class Subject(NamedTuple):
    """A mission prepared for decisions under its policy."""

    policy: PreparedPolicy
    mission: Mission
    invocations: tuple[PreparedInvocation, ...]

    @property
    def phases(self) -> tuple[str, ...]:
        """The names of the mission's phases."""
        return self.mission.phases


def unpacked(data: bytes, name: str) -> Subject | Refusal:
    """Return the prepared mission of a bundle; a refusal if it is not a bundle."""
    try:
        bundle = claimed_and_prepared(data)
    except Untrusted as error:
        help = "accepted: a source (.rts, .json), a bundle, a log or a run's folder"
        return Refusal(error.slug, f"{name}: {error}", help)
    return subject_of(bundle)


def subject_of(bundle: PreparedBundle) -> Subject:
    """Return the mission of a bundle that was prepared when it was read."""
    return Subject(bundle.policy, bundle.said.mission, bundle.invocations)


def prepared(policy: Policy, mission: Mission) -> Subject | Refusal:
    """Return a policy and a mission, prepared as on board."""
    ready = prepare(policy)
    if isinstance(ready, Refusal):
        return _refused(ready)
    return _under(ready, mission)


def _under(ready: PreparedPolicy, mission: Mission) -> Subject | Refusal:
    invocations = prepare_mission(mission, ready)
    return _refused(invocations) if isinstance(invocations, Refusal) else Subject(ready, mission, invocations)


def _refused(refusal: Refusal) -> Refusal:
    return Refusal("input", f"the vehicle would refuse this: {refusal.text}")


def after(subject: Subject, detail: str) -> Subject | Refusal:
    """Return the mission after a recorded replacement.

    The kept steps stay as prepared first, as on board: they may refer to phases that the new mission does not have.
    """
    try:
        said = recorded_replacement(detail)
    except Untrusted as error:
        return Refusal("input", f"invalid replacement in the log: {error}")
    newer = _under(subject.policy, said.mission)
    if isinstance(newer, Refusal):
        return newer
    steps = (*subject.invocations[: said.kept], *newer.invocations[said.kept :])
    return Subject(subject.policy, over(said, subject.mission), steps)
