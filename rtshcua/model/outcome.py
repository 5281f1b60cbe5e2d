"""Outcomes (paper symbol eta) and the stable slugs of their reasons."""

from enum import IntEnum, StrEnum


class Outcome(IntEnum):
    """The outcome of a decision."""

    ALLOW = 0
    DENY = 1
    DEFER = 2
    FALLBACK = 3


class Reason(StrEnum):
    """The reason of a decision; stable, one namespace for each step of section 4.1. `WIRE_REASONS` numbers them in
    order of definition: append only.
    """

    ADMITTED = "admitted"
    # 1 integrity
    BINDING_MISMATCH = "integrity/binding-mismatch"
    WRONG_VEHICLE = "integrity/wrong-vehicle"
    POLICY_VERSION = "integrity/policy-version"
    ARGUMENT_RANGE = "integrity/argument-out-of-range"
    # 2 freshness
    REPLAYED = "freshness/replayed"
    ISSUED_IN_FUTURE = "freshness/issued-in-future"
    EXPIRED = "freshness/expired"
    CLOCK_UNCERTAIN = "freshness/clock-uncertain"
    # 3 authority
    CLASS_NOT_PERMITTED = "authority/class-not-permitted"
    FORBIDDEN = "authority/forbidden"
    FORBID_UNKNOWN = "authority/forbid-unknown"
    NOT_PERMITTED = "authority/not-permitted"
    OUT_OF_SCOPE = "authority/out-of-scope"
    # 3b confirmation
    AWAITING_APPROVAL = "approval/awaited"
    APPROVAL_REFUSED = "approval/refused"
    APPROVAL_TIMED_OUT = "approval/timed-out"
    # 4 context
    PHASE_NOT_REACHED = "context/phase-not-reached"
    PHASE_PASSED = "context/phase-passed"
    # 5 timing
    NO_SLACK = "timing/no-slack"
    # 6 state
    STATE_VIOLATED = "state/violated"
    STATE_UNKNOWN = "state/unknown"
    # 7 safety
    ENVELOPE = "safety/envelope"
    AIRSPACE = "safety/airspace"
    INVARIANT = "safety/invariant-violated"
    ENERGY = "safety/energy"
    DEGRADED = "safety/degraded"
    SAFETY_UNKNOWN = "safety/unknown"


#: reasons by their number on the wire
WIRE_REASONS: tuple[Reason, ...] = tuple(Reason)
REASON_NUMBERS: dict[Reason, int] = {reason: number for number, reason in enumerate(WIRE_REASONS)}

_DEFERS = frozenset(
    {
        Reason.CLOCK_UNCERTAIN,
        Reason.FORBID_UNKNOWN,
        Reason.AWAITING_APPROVAL,
        Reason.PHASE_NOT_REACHED,
        Reason.STATE_UNKNOWN,
        Reason.SAFETY_UNKNOWN,
    }
)
_FALLS_BACK = frozenset(
    {
        Reason.NO_SLACK,
        Reason.STATE_VIOLATED,
        Reason.ENVELOPE,
        Reason.AIRSPACE,
        Reason.INVARIANT,
        Reason.ENERGY,
        Reason.DEGRADED,
    }
)


def outcome_of(reason: Reason) -> Outcome:
    """The outcome of a decision with this reason (design 4.1)."""
    if reason is Reason.ADMITTED:
        return Outcome.ALLOW
    if reason in _DEFERS:
        return Outcome.DEFER
    return Outcome.FALLBACK if reason in _FALLS_BACK else Outcome.DENY
