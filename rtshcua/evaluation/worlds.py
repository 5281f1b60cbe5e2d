"""A bundle in force for the evaluation: signed with the development keys, and loaded in any mode."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final, NamedTuple

from rtshcua.decision.session import InForce
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evaluation.design import EvaluationPoint
from rtshcua.evaluation.modes import load_in, started, unavailable
from rtshcua.evaluation.results import UnavailableMode
from rtshcua.evaluation.sources import compiled
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement.isolated import Caller
from rtshcua.onboard.enforcement.load import SESSION_KEY_BYTES, EnforcementMode, Loaded, session
from rtshcua.virtual import development_keys
from rtshcua.virtual.flight import LATER_US
from rtshcua.wire import bundle
from rtshcua.wire.binding import bind
from rtshcua.wire.document import FLIGHT_BYTES
from rtshcua.wire.keys import Duty
from rtshcua.wire.trust import open_root

#: UTC at which the missions of the evaluation are issued, in us: the same in each run, so that all octets are
ISSUED_US: Final = 1_767_225_600_000_000
#: when a bundle is received: one minute later
RECEIVED: Final = Now(500_000_000, ISSUED_US + LATER_US, 1_000)

_SESSION_KEY: Final = bytes(SESSION_KEY_BYTES)
_FLIGHT: Final = bytes(FLIGHT_BYTES)


class FlatProgram(NamedTuple):
    """A compiled policy and mission, not yet bound."""

    policy: Policy
    mission: Mission


def program_at(point: EvaluationPoint) -> FlatProgram:
    """The program of a point, issued at `ISSUED_US`."""
    return FlatProgram(*compiled(*point, ISSUED_US))


class World:
    """What loads bundles in one mode; where the mode is isolated, over one started home."""

    def __init__(self, mode: EnforcementMode, caller: Caller | None) -> None:
        self.mode = mode
        self._caller = caller
        self._sealed = b""  # the bundle in force

    def load(self, program: FlatProgram) -> Loaded:
        """The bundle in force. Raises RuntimeError where it is refused."""
        self._sealed = development_keys.seal(*program)
        found = load_in(self.mode, self._sealed, root=root_of(program.policy), now=RECEIVED, caller=self._caller)
        if isinstance(found, Refusal):
            raise RuntimeError(f"{self.mode}: the bundle of `{program.mission.name}` is refused: {found}")
        return found

    def renewed(self, of: Loaded) -> Loaded:
        """The bundle that was loaded last in a new session, in which no id is used."""
        if self._caller is not None:
            drawn = self._caller.load(self._sealed, RECEIVED)
            if isinstance(drawn, Refusal):
                raise RuntimeError(f"{self.mode}: the bundle is refused when it is loaded again: {drawn}")
            return of
        policy, vehicle = of.policy, of.vehicle
        trusted = open_root(root_of(policy.policy), pinned=pinned(), now_us=RECEIVED.utc_us)
        received_us = RECEIVED.monotonic_us
        return session(
            InForce(of.bundle, policy, of.invocations, trusted, vehicle, _FLIGHT, received_us), self.mode, _SESSION_KEY
        )


def bound(program: FlatProgram) -> Mission:
    """The mission, bound to the policy."""
    return bind(program.mission, bundle.policy_digest(bundle.policy_payload(program.policy)))


def root_of(policy: Policy) -> bytes:
    """The signed trust root of the development keys, for a policy's roles."""
    return development_keys.root(ISSUED_US, policy.roles)


def pinned() -> bytes:
    """The public half of the root's key."""
    return development_keys.keys()[Duty.ROOT].verification().public


@contextmanager
def world(mode: str, policy: Policy) -> Iterator[World]:
    """A world of an available mode, whose home is started here and ended with the context. Raises BoundaryError."""
    with (
        TemporaryDirectory(prefix="world-") as folder,
        started(mode, root_of(policy), policy.vehicle.identity, Path(folder)) as caller,
    ):
        yield World(EnforcementMode(mode), caller)


def not_here(mode: str) -> list[UnavailableMode]:
    """That a mode is not available on this computer; empty where it is."""
    missing = unavailable(mode)
    return [] if missing is None else [UnavailableMode(mode=mode, why=str(missing))]
