"""Responses of `enforce`: a decision, with a permit where it grants one, or a refusal to decide.

The body is one string of octets in a fixed layout, big-endian: status, outcome, reason number, step of section
4.1, clause, target, `valid_until_us`, consumed, then the permit, if any, and last the new digest of the boundary's
own evidence (`boundary_chain`, paper symbol `d_ev`). In a refusal all fields but status and digest are 0.

A clause is a number, counted through `shared_clauses`, then `own_clauses`. A target is the number of a link of the
fallback chain, or `-1 - rule` for that of a degrade rule. A response about a link has no target: the link is the
target.
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

#: `target` of a decision without a target: less than `-1 - rule` for any rule
NO_TARGET: Final = -(1 << 15) - 1
#: `clause` when the contract itself decided
NO_CLAUSE: Final = -1

_OUTCOMES: Final = tuple(Outcome)
_HEAD: Final = Struct(">BBBBiiqB")


class Status(IntEnum):
    """Whether `enforce` decided, or why not."""

    DECIDED = 0
    MALFORMED = 1  # the octets are not a request
    UNKNOWN_STEP = 2  # the bundle has no such step or link
    NOT_CURRENT = 3  # the bundle has it, but its turn has not come
    CLOCK_APART = 4  # the claimed time of day differs from the boundary's own
    CLOCK_UNKNOWN = 5  # the request claims a time of day, but the boundary knows none


def shared_clauses(policy: Policy) -> tuple[Rule | Airspace, ...]:
    """The clauses that can decide any request, numbered by position: the rules, then the airspace if there is one."""
    return (*policy.rules, *(() if policy.airspace is None else (policy.airspace,)))


def own_clauses(contract: Contract) -> tuple[Clause, ...]:
    """The clauses that can decide a request for this contract; their numbers continue those of the shared ones."""
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
    """Decode a response about a step of this contract, or a link of it (None: of the contingency); a refusal to
    decide is returned as its status. Raises nothing.
    """
    prefix, head, start, end = _PERMITTED if len(data) == _PERMITTED_BYTES else _BARE
    if not data.startswith(prefix) or len(data) != end + DIGEST_BYTES:
        return Refusal("malformed", f"not a response of version {names.RESPONSE.version}")
    status, outcome, reason, step, clause, target, valid_until_us, consumed = _HEAD.unpack_from(data, head)
    if status != Status.DECIDED:
        refused = Status(status) if status < len(Status) else None
        if refused is None or data != encode_refusal(refused, data[end:]):
            return Refusal("malformed", "a refusal contains more than its status")
        return refused
    if outcome >= len(_OUTCOMES) or reason >= len(WIRE_REASONS):
        return Refusal("malformed", "the outcome or the reason is unknown")
    try:
        decisive, (link, flown) = _clause(clause, policy, contract), _target(target, policy, contract)
    except LookupError:
        return Refusal("malformed", "the clause or the target is unknown")
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
    """The beginning of a response with a permit of this size, and the offsets of its head, its permit and its
    digest.
    """
    start = len(prefix) + _HEAD.size
    return prefix, len(prefix), start, start + size


_BARE: Final = _places(_WITHOUT_PERMIT, 0)
_PERMITTED: Final = _places(_WITH_PERMIT, SIZE)
_PERMITTED_BYTES: Final = _PERMITTED[-1] + DIGEST_BYTES
