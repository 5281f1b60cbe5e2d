"""Everything that `decide` reads beside the invocation and the policy; all of it is recorded."""

from rtshcua.model.flat.struct import Flat


class State(Flat, frozen=True):
    """Paper symbol `S_t`: one integer a slot in its signal's canonical unit, None where nothing valid was ever
    received.

    `monitors` has the truth of each temporal monitor of the policy at the last observation: 1 true, 2 false, 4 unknown.
    `ages` are in us at the moment of the decision, one a slot; the age of a slot that is None does not count.
    """

    values: tuple[int | None, ...]
    ages: tuple[int, ...]
    monitors: tuple[int, ...] = ()


#: the bound on the error of a UTC that nothing vouches for, in us: whatever is asked of the time of day is unknown then
UTC_UNKNOWN_US = 1 << 52


class Now(Flat, frozen=True):
    """The moment of a decision, in us: monotonic, and UTC since the epoch with a bound on its error.

    Where nobody knows how far UTC is off, the bound is `UTC_UNKNOWN_US`: 142 years, so that no window is inside it.
    """

    monotonic_us: int
    utc_us: int
    utc_error_us: int


class ConfirmAnswer(Flat, frozen=True):
    """A person's verified answer to a `confirm` rule: `granted` 1 or 0, at a monotonic time in us.

    `person` is a number: the same for all answers of one person, another for each other.
    """

    rule: int
    role: int
    granted: int
    monotonic_us: int
    person: int = 0


class Context(Flat, frozen=True):
    """Where the mission stands. Times are monotonic, in us.

    `binding` is the one that the request presented, `vehicle` the identity of the vehicle we are on,
    `policy_version` the one in force (latched at take-off), `consumed` 1 when the id was used before,
    `released_us` the moment the predecessor ended or the phase began, `phase` the current mission phase's index,
    `remaining_us` paper symbol `L_rem`.
    """

    binding: bytes
    vehicle: str
    policy_version: int
    consumed: int
    released_us: int
    phase: int
    remaining_us: int
    approvals: tuple[ConfirmAnswer, ...]
