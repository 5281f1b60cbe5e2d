"""`load`: opens a bundle once and returns a boundary that may decide. All signatures are verified here.

Checked in this order: that the mode may be used with this peer; by `open_bundle`, the signatures, the
authorisation of each key for its duty, vehicle, role and source, the format versions, and every binding; by
`prepare`, that policy and mission are well-formed and the mission only tightens; and last, that the requests of
this policy fit the wire.
"""

from collections.abc import Mapping
from enum import StrEnum
from hashlib import sha256
from types import MappingProxyType
from typing import Final

import msgspec

from rtshcua.decision.prepare import PreparedInvocation, PreparedPolicy, prepare, prepare_mission
from rtshcua.decision.session import InForce
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement.boundary import SoftwareBoundary
from rtshcua.onboard.enforcement.executor import Commands, Executor, never
from rtshcua.onboard.enforcement.isolated import (
    Caller,
    IsolatedAttestation,
    IsolatedBoundary,
    IsolatedExecutor,
    IsolatedGate,
    IsolatedIssuer,
)
from rtshcua.onboard.enforcement.preparation import Owed, PreparationIssuer
from rtshcua.onboard.ports import BoundaryKey
from rtshcua.wire import boundary_chain
from rtshcua.wire.boundary_chain import BoundaryChain, Tag
from rtshcua.wire.bundle import Bundle, open_bundle
from rtshcua.wire.clock import ClockSource
from rtshcua.wire.document import FLIGHT_BYTES
from rtshcua.wire.keys import SigningKey
from rtshcua.wire.statement import Statement, sign
from rtshcua.wire.trust import TrustRoot
from rtshcua.wire.untrusted import Untrusted


class Attestation:
    """Signs the state of one boundary's chain. Nothing is signed before it has begun, or without a key."""

    def __init__(self, chain: BoundaryChain, flight: bytes, bundle: bytes, *, enforced: bool) -> None:
        self._chain = chain
        self._flight = flight
        self._bundle = sha256(bundle).digest()
        self._enforced = enforced
        self._key: BoundaryKey | None = None
        self._signs: SigningKey | None = None

    @property
    def digest(self) -> bytes:
        """The digest to store for the next session, 32 octets."""
        return self._chain.digest

    def begin(self, key: BoundaryKey | None) -> int | None:
        """Begin the flight's log. Returns the number of the session, None without a key. Raises RuntimeError on a
        second call, because a chain has one beginning.
        """
        if self._key is not None:
            raise RuntimeError("the boundary's session has begun already")
        if key is None or key.key is None:
            return None
        self._key, self._signs = key, key.key
        payload = boundary_chain.begin(key.session, key.before, self._flight, self._bundle, enforced=self._enforced)
        self._chain.add(Tag.BEGIN, payload)
        return key.session

    def statement(self, now: Now, *, final: bool = False) -> bytes | None:
        """A signed statement at a moment, None without a key or after the final one. After the final one nothing is
        dispatched, and no frame that moves the vehicle passes, so that the signed end is the end. The boundary
        shares the runtime's clock.
        """
        key, chain = self._key, self._chain
        if key is None or self._signs is None or chain.over:
            return None
        chain.over = final
        said = Statement(
            self._flight, key.session, key.before, chain.count, chain.digest, chain.marks(), chain.frames, chain.left,
            chain.repeated, chain.declined, chain.stopped, chain.ahead, chain.aside,
            ClockSource.SHARED, now.monotonic_us, now.utc_us, now.utc_error_us, final,
        )  # fmt: skip
        return sign(said, self._signs)

    def home(self) -> bytes | None:
        """Nothing: this boundary runs in the process of the runtime, and has no home of its own."""
        return None


#: length of a session key in bytes
SESSION_KEY_BYTES: Final = 32


class EnforcementMode(StrEnum):
    """How `enforce` is separated from the runtime. `NONE` enforces nothing: for measurements, in simulation only."""

    NONE = "none"
    SOFTWARE = "software"
    PROCESS = "process"
    TRUSTZONE_M = "trustzone-m"
    OPTEE = "optee"

    @property
    def apart(self) -> bool:
        """Whether the boundary is outside of the runtime, and called."""
        return self is EnforcementMode.PROCESS or self.emulated

    @property
    def emulated(self) -> bool:
        """Whether the boundary is in the secure world of an emulated machine."""
        return self in (EnforcementMode.TRUSTZONE_M, EnforcementMode.OPTEE)


class Loaded(msgspec.Struct, frozen=True):
    """A bundle in force: the boundary and the executor, which share the session key and the chain that `attestation`
    signs, and the verified parts.
    """

    boundary: SoftwareBoundary | IsolatedBoundary
    executor: Executor | IsolatedExecutor
    in_force: InForce
    policy: PreparedPolicy
    vehicle: str
    mode: EnforcementMode
    preparation: PreparationIssuer | IsolatedIssuer
    attestation: Attestation | IsolatedAttestation

    @property
    def bundle(self) -> Bundle:
        """The bundle; after a replacement, with the mission in force."""
        return self.in_force.bundle

    @property
    def invocations(self) -> tuple[PreparedInvocation, ...]:
        """The invocations of the mission in force."""
        return self.in_force.invocations

    @property
    def issued_us(self) -> int:
        """The UTC time in us before which not every step of this bundle was issued."""
        return max(prepared.invocation.issued_at_us for prepared in self.invocations)

    @property
    def expires_us(self) -> int:
        """The UTC time in us after which no step of this bundle is valid: until then its replay must be refused."""
        return max(
            prepared.invocation.issued_at_us + prepared.invocation.contract.validity_us for prepared in self.invocations
        )


def load(
    bundle: bytes,
    *,
    root: TrustRoot,
    vehicle: str,
    now: Now,
    mode: EnforcementMode,
    session_key: bytes,
    flight: bytes,
    peer_is_own_simulator: bool,
    settings: Mapping[str, int] = MappingProxyType({}),
    owed: Mapping[str, Owed] = MappingProxyType({}),
    caller: Caller | None = None,
) -> Loaded | Refusal:
    """Open a bundle for the vehicle of this identity. `session_key` is 32 random bytes for this use only; `flight`,
    16 random bytes, is the id of the flight, and is recorded in the genesis of its log. `settings` are the
    parameters that the operator has set before the flight, `owed` those that earlier runs left to be restored.

    `now` is when the bundle was received (paper symbol `t_r`). With a `caller` the boundary is elsewhere: it opens
    the bundle itself, draws the id of the flight, and received `owed` when it began.

    Raises ValueError for a session key or an id of another length; a problem of the bundle is returned as a
    `Refusal`.
    """
    if len(session_key) != SESSION_KEY_BYTES:
        raise ValueError(f"a session key must have {SESSION_KEY_BYTES} bytes, not {len(session_key)}")
    if len(flight) != FLIGHT_BYTES:
        raise ValueError(f"the id of a flight must have {FLIGHT_BYTES} bytes, not {len(flight)}")
    if mode is EnforcementMode.NONE and not peer_is_own_simulator:
        return Refusal("mode-refused", "mode `none` is only allowed with a simulated vehicle that this run started")
    try:
        opened = open_bundle(bundle, root=root, vehicle=vehicle, now_us=now.utc_us)
    except Untrusted as error:
        return Refusal(error.slug, str(error))
    policy = prepare(opened.policy)
    if isinstance(policy, Refusal):
        return Refusal("malformed", f"the policy is malformed: {policy.text}")
    invocations = prepare_mission(opened.mission, policy)
    if isinstance(invocations, Refusal):
        return Refusal("malformed", f"the mission is malformed: {invocations.text}")
    if not opened.policy.contingency or not invocations:
        what = "mission has no step" if opened.policy.contingency else "policy has no contingency"
        return Refusal("malformed", f"the {what}")
    if caller is None:
        issuer = PreparationIssuer(session_key, settings, owed)
        in_force = InForce(opened, policy, invocations, root, vehicle, flight, now.monotonic_us)
        return session(in_force, mode, session_key, issuer, bundle=bundle)
    drawn = caller.load(bundle, now)
    if isinstance(drawn, Refusal):
        return drawn
    in_force = InForce(opened, policy, invocations, root, vehicle, drawn, now.monotonic_us)
    commands = Commands(policy.policy, opened.mission)
    commands.called_off = caller.reopened
    boundary = IsolatedBoundary(caller, in_force, commands)
    executor = IsolatedExecutor(caller, commands, IsolatedGate(caller, commands))
    settable = IsolatedIssuer(caller, settings)
    return Loaded(boundary, executor, in_force, policy, vehicle, mode, settable, IsolatedAttestation(caller))


def session(
    in_force: InForce,
    mode: EnforcementMode,
    session_key: bytes,
    issuer: PreparationIssuer | None = None,
    *,
    bundle: bytes = b"",
) -> Loaded:
    """A new session of a verified and prepared bundle. Without an `issuer` no parameter can be set, and without the
    octets of the bundle its statements fit no log.
    """
    commands = Commands(in_force.bundle.policy, in_force.bundle.mission)
    enforced = mode is not EnforcementMode.NONE
    chain = BoundaryChain()
    boundary = SoftwareBoundary(in_force, commands, session_key, chain, enforced=enforced)
    give_back = boundary.give_back if enforced else never
    issuer = issuer or PreparationIssuer(session_key, {})
    attestation = Attestation(chain, in_force.flight, bundle, enforced=enforced)
    executor = Executor(session_key, commands, chain, give_back)
    policy, vehicle = in_force.policy, in_force.vehicle
    return Loaded(boundary, executor, in_force, policy, vehicle, mode, issuer, attestation)
