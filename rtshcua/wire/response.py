"""Responses of `enforce`: a decision, with a permit where it grants one, or a refusal to decide.

The body is one string of octets in a fixed layout, big-endian: status, outcome, reason number, step of section 4.1,
clause, target, `valid_until_us`, consumed, then the permit, if any, and last the digest of the boundary's own evidence
after it (`boundary_chain`, paper symbol `d_ev`). In a refusal all but status and digest is 0.

A clause is a number, counted through `shared_clauses`, then `own_clauses`; so is a target, of a link of the fallback
chain, or `-1 - rule` for that of a degrade rule. Where a link was asked for, no target is said: it is that link.
"""

from enum import IntEnum
from struct import Struct
from typing import Final

from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.decision import Decision, Decisive
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import Contract, Link
from rtshcua.model.flat.policy import Airspace, Policy, Rule
from rtshcua.model.outcome import REASON_NUMBERS, WIRE_REASONS, Outcome
from rtshcua.wire import artefact, names
from rtshcua.wire.digest import DIGEST_BYTES
from rtshcua.wire.permit import SIZE
from rtshcua.wire.request import DEGRADE

#: `target` where the decision names none: less than `-1 - rule` for any rule
NO_TARGET: Final = -(1 << 15) - 1
#: `clause` where the contract itself decided
NO_CLAUSE: Final = -1

_OUTCOMES: Final = tuple(Outcome)
_HEAD: Final = Struct(">BBBBiiqB")


class Status(IntEnum):
    """Whether `enforce` decided, and if not, why."""

    DECIDED = 0
    MALFORMED = 1  # the octets are no request
    UNKNOWN_STEP = 2  # the bundle has no such step or link
    NOT_CURRENT = 3  # the bundle has it, but its turn has not come
    CLOCK_APART = 4  # the time of day that it names is not the boundary's own
    CLOCK_UNKNOWN = 5  # it names one, and the boundary knows of none


def shared_clauses(policy: Policy) -> tuple[Rule | Airspace, ...]:
    """What can decide any request, numbered by position: the rules, then the airspace if there is one."""
    return (*policy.rules, *(() if policy.airspace is None else (policy.airspace,)))


def own_clauses(contract: Contract) -> tuple[Clause, ...]:
    """What can decide a request for this contract; numbered on from the shared ones."""
    return (*contract.require, *contract.assume, *contract.maintain)


def encode(decision: Decision, clause: int, target: int, evidence: bytes) -> bytes:
    """The octets of a decision, with the numbers of its clause and its target, and the boundary's digest."""
    body = _HEAD.pack(
        Status.DECIDED,
        decision.outcome,
        REASON_NUMBERS[decision.reason],
        decision.step,
        clause,
        target,
        decision.valid_until_us,
        decision.consumed,
    )
    prefix = _WITH_PERMIT if decision.permit else _WITHOUT_PERMIT
    return prefix + body + decision.permit + evidence


def encode_refusal(status: Status, evidence: bytes = bytes(DIGEST_BYTES)) -> bytes:
    """The octets of a refusal to decide."""
    return _WITHOUT_PERMIT + _HEAD.pack(status, 0, 0, 0, 0, 0, 0, 0) + evidence


def decode(data: bytes, policy: Policy, contract: Contract | None) -> Decision | Status | Refusal:
    """Read a response about a step of this contract, or a link of it (None: of the contingency); a refusal to decide is
    its status. Raises nothing.
    """
    prefix, head, start, end = _PERMITTED if len(data) == _PERMITTED_BYTES else _BARE
    if not data.startswith(prefix) or len(data) != end + DIGEST_BYTES:
        return Refusal("malformed", f"not a response of version {names.RESPONSE.version}")
    status, outcome, reason, step, clause, target, valid_until_us, consumed = _HEAD.unpack_from(data, head)
    if status != Status.DECIDED:
        refused = Status(status) if status < len(Status) else None
        if refused is None or data != encode_refusal(refused, data[end:]):
            return Refusal("malformed", "a refusal with more than its status")
        return refused
    if outcome >= len(_OUTCOMES) or reason >= len(WIRE_REASONS):
        return Refusal("malformed", "an outcome or a reason that there is not")
    try:
        decisive, (link, flown) = _clause(clause, policy, contract), _target(target, policy, contract)
    except LookupError:
        return Refusal("malformed", "a clause or a target that there is not")
    said, why, permit = _OUTCOMES[outcome], WIRE_REASONS[reason], data[start:end]
    return Decision(said, why, step, decisive, link, flown, valid_until_us, consumed, permit)


def _clause(number: int, policy: Policy, contract: Contract | None) -> Decisive:
    """The clause of a number. Raises LookupError where there is none."""
    if number == NO_CLAUSE:
        return None
    clauses = (*shared_clauses(policy), *(() if contract is None else own_clauses(contract)))
    if number < 0:
        raise LookupError(number)
    return clauses[number]


def _target(number: int, policy: Policy, contract: Contract | None) -> tuple[int | None, Link | None]:
    """The target of a number, with its index in the chain. Raises LookupError where there is none."""
    if number == NO_TARGET:
        return None, None
    index = max(number, DEGRADE)
    link = policy.rules[-1 - number].target if number < 0 else None if contract is None else contract.fallback[number]
    if link is None:
        raise LookupError(number)
    return index, link


def _prefix(size: int) -> bytes:
    return artefact.wrap(names.RESPONSE, bytes(size))[:-size]


_WITHOUT_PERMIT: Final = _prefix(_HEAD.size + DIGEST_BYTES)
_WITH_PERMIT: Final = _prefix(_HEAD.size + SIZE + DIGEST_BYTES)


def _places(prefix: bytes, size: int) -> tuple[bytes, int, int, int]:
    """What a response with a permit of this size begins with; where its head, its permit and its digest begin."""
    start = len(prefix) + _HEAD.size
    return prefix, len(prefix), start, start + size


_BARE: Final = _places(_WITHOUT_PERMIT, 0)
_PERMITTED: Final = _places(_WITH_PERMIT, SIZE)
_PERMITTED_BYTES: Final = _PERMITTED[-1] + DIGEST_BYTES
