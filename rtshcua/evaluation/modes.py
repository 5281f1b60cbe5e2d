"""The modes of the evaluation: those of `run`, with the homes outside of this process, and `unenforced`.

`unenforced` is a baseline for measurements only: it takes the steps phase, timing, state and safety of the decision,
and none of what makes them binding. It checks neither integrity, freshness nor authority, seals no permit, and chains,
records and stores no evidence. No other package can start it.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from msgspec.structs import replace

from rtshcua.adapters.boundary import optee, process, trustzone_m
from rtshcua.adapters.boundary.home import BoundaryHome
from rtshcua.decision.decide import PASS, PASSED, Found, phase, safety, state, timing, valid_until
from rtshcua.decision.evaluate import Environment
from rtshcua.decision.fallbacks import START as FIRST_LINK
from rtshcua.decision.fallbacks import fallbacks
from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.decision.session import InForce
from rtshcua.decision.situation import environment, situation
from rtshcua.decision.values import Sets
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evaluation.design import UNENFORCED
from rtshcua.evidence.log_writer import Recorder
from rtshcua.model.decision import Decision
from rtshcua.model.flat.situation import Context, Now
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.onboard.enforcement.boundary import PermitIssuer, SoftwareBoundary
from rtshcua.onboard.enforcement.executor import Commands, Executor
from rtshcua.onboard.enforcement.isolated import Caller
from rtshcua.onboard.enforcement.load import SESSION_KEY_BYTES, Attestation, EnforcementMode, Loaded, load
from rtshcua.virtual import development_keys
from rtshcua.wire import bundle as bundles
from rtshcua.wire import cose
from rtshcua.wire.boundary_chain import START, BoundaryChain, Tag
from rtshcua.wire.document import FLIGHT_BYTES
from rtshcua.wire.keys import Duty
from rtshcua.wire.permit import SIZE, Permit
from rtshcua.wire.request import STEP, decode
from rtshcua.wire.response import NO_CLAUSE, NO_TARGET, Status, encode, encode_refusal
from rtshcua.wire.trust import MAX_ROOT, open_root

#: the step of a decision that passed them all, as `decision.decide` numbers them
_PASSED_ALL: Final = 8
_HOMES: Final[dict[str, Callable[..., BoundaryHome]]] = {
    "process": process.BoundaryProcess,
    "trustzone-m": trustzone_m.SecureWorld,
    "optee": optee.TrustedApplication,
}


def unavailable(mode: str) -> Refusal | None:
    """Why a mode cannot run on this computer, and what would make it run; None where it can."""
    missing = None
    match mode:
        case "process" if process.program() is None:
            return Refusal("missing", "the boundary's program was not built", process.UNBUILT_HELP)
        case "trustzone-m":
            missing = trustzone_m.missing_packages()
        case "optee":
            missing = optee.missing_packages()
    return None if missing is None else Refusal(missing.slug, str(missing), missing.help)


@contextmanager
def started(mode: str, root: bytes, vehicle: str, folder: Path) -> Iterator[Caller | None]:
    """Start the home of a mode for a vehicle, with its state in a folder; None for a mode in this process.

    The boundary has the development key for its own evidence. Raises BoundaryError and OSError.
    """
    home = _HOMES.get(mode)
    if home is None:
        yield None
        return
    keys = development_keys.keys()
    pinned = keys[Duty.ROOT].verification().public
    begun = home(root, pinned, vehicle, folder, own_seed=keys[Duty.BOUNDARY].private.private_bytes_raw(), paced=True)
    try:
        yield Caller(begun.call, part=begun.part, most_ahead=begun.most_ahead)
    finally:
        begun.close()


def load_in(mode: str, bundle: bytes, *, root: bytes, now: Now, caller: Caller | None = None) -> Loaded | Refusal:
    """Load a bundle under a trust root of the development keys, in one mode: see `onboard.enforcement.load`."""
    signed_by = cose.unverified(root, limit=MAX_ROOT).kid
    loaded = load(
        bundle, root=open_root(root, pinned=signed_by, now_us=now.utc_us), vehicle=bundles.claimed_vehicle(bundle),
        now=now, mode=EnforcementMode.NONE if mode == UNENFORCED else EnforcementMode(mode), caller=caller,
        session_key=bytes(SESSION_KEY_BYTES), flight=bytes(FLIGHT_BYTES), peer_is_own_simulator=True,
    )  # fmt: skip
    return _without_enforcement(loaded) if mode == UNENFORCED and isinstance(loaded, Loaded) else loaded


class NoRecorder(Recorder):
    """Makes no records: each line is empty."""

    def __init__(self) -> None:
        super().__init__(lambda _: b"", b"", lambda: b"")

    def genesis(self, *_: Any, **__: Any) -> bytes:
        """Return an empty line."""
        return b""

    decision = effect = genesis

    def attested(self, *_: Any, **__: Any) -> tuple[bytes, ...]:
        """Return no line."""
        return ()

    sealing = closing = caught_up = attested

    def due(self, now: Now) -> bool:
        """Return False: there are no epochs."""
        return False

    overdue = due


class NoEvidence:
    """Stores nothing, and counts each line as stored."""

    def __init__(self) -> None:
        self.kept = self.synced = 0

    def append(self, line: bytes, durability: int) -> int:
        """Count a line."""
        self.kept += 1
        self.synced = self.kept
        return self.kept

    def trouble(self) -> str | None:
        """Return None: nothing can go wrong."""
        return None

    late = trouble

    def close(self) -> None:
        """Do nothing."""


class _NoChain(BoundaryChain):
    """A chain to which nothing is added."""

    __slots__ = ()

    def add(self, tag: Tag, payload: bytes) -> bytes:
        return START

    def leave(self, frame: bytes) -> None:
        pass

    def stop(self, frame: bytes) -> None:
        pass


class _UnsealedIssuer(PermitIssuer):
    """Issues permits by number, without a MAC; `permits` has them by their octets."""

    def __init__(self) -> None:
        super().__init__(b"")
        self.permits: dict[bytes, Permit] = {}

    def _seal(self, permit: Permit) -> bytes:
        octets = permit.serial.to_bytes(SIZE)
        self.permits[octets] = permit
        return octets


class _UnenforcedBoundary(SoftwareBoundary):
    """Decides on a step by its phase, timing, state and safety only; on a link as usual."""

    def __init__(self, in_force: InForce, commands: Commands, issuer: _UnsealedIssuer) -> None:
        super().__init__(in_force, commands, b"", _NoChain(), enforced=False)
        self._issuer = issuer

    def enforce(self, request: bytes, own: Now | None = None) -> bytes:
        asked = decode(request, self._slots, self._monitors)
        if isinstance(asked, Refusal):
            return encode_refusal(Status.MALFORMED)
        if asked.kind != STEP or not 0 <= asked.step < len(self._in_force.invocations):
            return super().enforce(request, own)
        prepared, policy, now = self._in_force.invocations[asked.step], self._in_force.policy, asked.now
        context = Context(
            asked.binding,
            self._vehicle,
            self._version,
            0,
            asked.released_us,
            asked.phase,
            asked.remaining_us,
            (),
        )
        sets = situation(asked.state, policy, now)
        at = environment(sets, policy, prepared.arguments, prepared.phase)
        for number, found in _steps(prepared, context, sets, at):
            if found is not PASSED and found[0] is not PASS:
                outcome, reason, clause = found[0]
                falls = outcome is Outcome.FALLBACK
                choice = next(fallbacks(prepared, sets, policy, FIRST_LINK, exact=True)) if falls else None
                link, target = (None, None) if choice is None else (choice.index, choice.link)
                decision = Decision(outcome, reason, number, clause, link, target, now.monotonic_us)
                return encode(
                    decision,
                    NO_CLAUSE if clause is None else self._clause(asked.step, clause),
                    NO_TARGET if link is None else self._target(asked.step, link, target),
                    START,
                )
        until_us = valid_until(prepared, asked.state, context, sets, at)
        links = len(prepared.invocation.contract.fallback)
        permit = self._issuer.step(asked.step, until_us, links, self._contingencies)
        decision = Decision(Outcome.ALLOW, Reason.ADMITTED, _PASSED_ALL, None, None, None, until_us, 0, permit)
        return encode(decision, NO_CLAUSE, NO_TARGET, START)


def _steps(prepared: PreparedInvocation, context: Context, sets: Sets, at: Environment) -> Iterator[tuple[int, Found]]:
    """The verdicts of phase, timing, state and safety, one after the other: see `decision.decide.steps`."""
    yield 4, phase(prepared, context)
    yield 5, timing(prepared, context, at, sets.monotonic_us)
    yield 6, state(prepared, at, exact=True)
    yield 7, safety(prepared, at, exact=True)


class _UnsealedExecutor(Executor):
    """Opens the permits of `_UnsealedIssuer`."""

    def __init__(self, commands: Commands, permits: Mapping[bytes, Permit]) -> None:
        super().__init__(b"", commands, _NoChain())
        self._permits = permits

    def _open(self, sealed: bytes) -> Permit | None:
        return self._permits.get(sealed)


def _without_enforcement(loaded: Loaded) -> Loaded:
    """The same bundle, without enforcement."""
    in_force = loaded.in_force
    commands = Commands(in_force.bundle.policy, in_force.bundle.mission)
    issuer = _UnsealedIssuer()
    attestation = Attestation(_NoChain(), in_force.flight, b"", enforced=False)
    return replace(
        loaded, boundary=_UnenforcedBoundary(in_force, commands, issuer),
        executor=_UnsealedExecutor(commands, issuer.permits), attestation=attestation,
    )  # fmt: skip
