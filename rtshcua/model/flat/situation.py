"""The inputs of `decide` besides the invocation and the policy. All of them are recorded."""

from rtshcua.model.flat.struct import Flat


class State(Flat, frozen=True):
    """Paper symbol `S_t`: one integer for each slot in its signal's canonical unit, None where no valid value was
    received.

    `monitors` has the truth of each temporal monitor of the policy at the last observation: 1 true, 2 false, 4
    unknown. `ages` are in us at the moment of the decision, one for each slot; the age of a slot that is None does
    not count.
    """

    values: tuple[int | None, ...]
    ages: tuple[int, ...]
    monitors: tuple[int, ...] = ()


#: the error bound of an unverified UTC, in us, with which every condition on the time of day is unknown
UTC_UNKNOWN_US = 1 << 52


class Now(Flat, frozen=True):
    """The moment of a decision, in us: monotonic, and UTC since the epoch with a bound on its error.

    If the error of UTC is unknown, the bound is `UTC_UNKNOWN_US`: 142 years, so that no window contains it.
    """

    monotonic_us: int
    utc_us: int
    utc_error_us: int


class ConfirmAnswer(Flat, frozen=True):
    """A person's verified answer to a `confirm` rule: `granted` 1 or 0, at a monotonic time in us.

    `person` is a number: the same for all answers of one person, and different for each other person.
    """

    rule: int
    role: int
    granted: int
    monotonic_us: int
    person: int = 0


class Context(Flat, frozen=True):
    """The state of the mission. Times are monotonic, in us.

    `binding` is the one in the request, `vehicle` the identity of this vehicle, `policy_version` the one in force
    (latched at take-off), `consumed` 1 when the id was used before, `released_us` the moment the predecessor ended
    or the phase began, `phase` the current mission phase's index, `remaining_us` paper symbol `L_rem`.
    """

    binding: bytes
    vehicle: str
    policy_version: int
    consumed: int
    released_us: int
    phase: int
    remaining_us: int
    approvals: tuple[ConfirmAnswer, ...]
