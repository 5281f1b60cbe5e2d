"""The decision in C, called in batches, and the same decisions by the reference."""

import ctypes
from array import array
from collections.abc import Iterable, Sequence
from typing import NamedTuple, TypeAlias

from msgspec.structs import astuple

from rtshcua.decision.decide import decide
from rtshcua.decision.evaluate import NO_PHASE
from rtshcua.decision.fallbacks import DEGRADE, choose_fallback, link_admissible
from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.model.decision import Decision
from rtshcua.model.flat.mission import Invocation, Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.situation import Context, Now, State
from rtshcua.model.outcome import REASON_NUMBERS
from rtshcua.wire import bundle, cbor
from rtshcua.wire.response import NO_CLAUSE, NO_TARGET, own_clauses, shared_clauses


class Question(NamedTuple):
    """One situation."""

    state: State
    context: Context
    now: Now


#: outcome, reason, step, clause, target, valid_until_us, the degrade rule's target, which links may fly (bits)
Answer: TypeAlias = tuple[int, ...]
SIZE = 8


class Native:
    """One policy, one mission and one of its steps, in C."""

    def __init__(self, library: ctypes.CDLL) -> None:
        self._library = library
        for name in ("rt_test_prepare_policy", "rt_test_prepare_mission", "rt_test_read_mission"):
            getattr(library, name).restype = ctypes.c_char_p
        self._kept: list[bytes] = [b"", b""]
        self._mission: Mission | None = None
        self._invocation: Invocation | None = None
        self._identity = ""

    def policy(self, policy: Policy) -> str | None:
        """Load a policy and return the slug of a refusal."""
        self._identity = policy.vehicle.identity
        return self.policy_bytes(bundle.policy_payload(policy))

    def policy_bytes(self, payload: bytes) -> str | None:
        """Do the same for encoded bytes."""
        self._kept[0] = payload
        slug = self._library.rt_test_prepare_policy(payload, len(payload))
        return None if slug is None else slug.decode()

    def mission(self, mission: Mission) -> str | None:
        """Load a mission under the policy and return the slug of a refusal."""
        self._mission = mission
        return self.mission_bytes(bundle.mission_payload(mission))

    def mission_bytes(self, payload: bytes) -> str | None:
        """Do the same for encoded bytes."""
        self._kept[1] = payload
        slug = self._library.rt_test_prepare_mission(payload, len(payload))
        return None if slug is None else slug.decode()

    def unchecked(self, mission: Mission, step: int) -> None:
        """Prepare a step of a mission that was not checked as a whole."""
        self._mission, self._kept[1] = mission, bundle.mission_payload(mission)
        assert self._library.rt_test_read_mission(self._kept[1], len(self._kept[1])) is None
        self.step(step)

    def step(self, step: int) -> None:
        """Prepare a step of the mission."""
        assert self._mission is not None
        self._invocation = self._mission.invocations[step]
        self._library.rt_test_prepare_step(step)

    def ask(self, questions: Sequence[Question]) -> list[Answer]:
        """The answers of the decision in C."""
        numbers = array("q", [number for question in questions for number in self._numbers(question)])
        found = array("q", bytes(8 * SIZE * len(questions)))
        at = (ctypes.c_void_p(each.buffer_info()[0]) for each in (numbers, found))
        asked, answers = at
        self._library.rt_test_decide(asked, len(questions), answers)
        return [tuple(found[at : at + SIZE]) for at in range(0, len(found), SIZE)]

    def again(self, question: Question, times: int) -> None:
        """Repeat the same decisions and discard the answers."""
        numbers = array("q", self._numbers(question))
        self._library.rt_test_again(ctypes.c_void_p(numbers.buffer_info()[0]), times)

    def candidates(self) -> int:
        """How many rules may apply to the step."""
        return int(self._library.rt_test_candidates())

    def along(self, zone: int, path: tuple[int, ...], error: int) -> int:
        """The truth of "the path, widened by an error, is in a zone"."""
        items = b"".join(cbor.encode(each) for each in path)
        return int(self._library.rt_test_along(zone, items, len(items), len(path), ctypes.c_int64(error)))

    def compared(self, zone: int, y0: int, y1: int, error: int) -> int:
        """The largest number of edges of a zone that are compared with a leg between these heights."""
        return int(self._library.rt_test_compared(zone, *map(ctypes.c_int64, (y0, y1, error))))

    def exists(self, zone: int, low: int, high: int, error: int) -> int:
        """The truth of a zone's existence between two moments that are known to within an error."""
        return int(self._library.rt_test_exists(zone, *map(ctypes.c_int64, (low, high, error))))

    def time_of_day(self, start: int, end: int, low: int, high: int, error: int) -> int:
        """The truth of a window of the day between such moments."""
        return int(self._library.rt_test_time_of_day(*map(ctypes.c_int64, (start, end, low, high, error))))

    def brings_home(self, charge: int, distance: int, low: int, high: int, asked: int, drain: int = 0) -> bool:
        """Whether a charge is enough for the way home."""
        numbers = array("q", (charge, distance, low, high, asked, drain))
        self._library.rt_test_home.restype = ctypes.c_bool
        return bool(self._library.rt_test_home(ctypes.c_void_p(numbers.buffer_info()[0])))

    def same_words(self, one: str, other: str) -> bool:
        """Whether two texts are equal when shown in one line."""
        a, b = one.encode(), other.encode()
        return not self._library.rt_test_words(a, len(a), b, len(b))

    def _numbers(self, question: Question) -> Iterable[int]:
        state, context, now = question
        assert self._invocation is not None
        assert len(state.values) == len(state.ages)
        return (
            len(state.values), len(state.monitors), now.monotonic_us, now.utc_us, now.utc_error_us,
            context.policy_version, context.consumed, context.released_us, context.phase, context.remaining_us,
            context.binding == self._invocation.binding, context.vehicle == self._identity, len(context.approvals),
            *(number for one in context.approvals for number in astuple(one)),
            *(0 if value is None else value for value in state.values), *(value is not None for value in state.values),
            *state.ages, *state.monitors,
        )  # fmt: skip


def expected(invocation: PreparedInvocation, question: Question, decision: Decision | None = None) -> Answer:
    """The answer of the reference with the numbers of the boundary; the decision may be given."""
    policy, (state, context, now) = invocation.policy, question
    shared = {clause: at for at, clause in enumerate(shared_clauses(policy.policy))}
    own = {
        clause: at
        for at, clause in enumerate(own_clauses(invocation.invocation.contract), len(shared_clauses(policy.policy)))
    }
    decision = decision or decide(invocation, state, policy, context, now)
    number = NO_CLAUSE
    if decision.clause is not None:
        number = own.get(decision.clause, -1)
        number = shared[decision.clause] if number == -1 else number

    def degrade(target: object) -> int:
        return next(-1 - shared[one.rule] for one in invocation.candidates.degrades if one.rule.target == target)

    target = NO_TARGET
    if decision.link is not None:
        target = degrade(decision.target) if decision.link == DEGRADE else decision.link
    choice = choose_fallback(invocation, state, policy, now)
    may = [
        link_admissible(link, state, policy, now, invocation.phase) << at for at, link in enumerate(invocation.chain)
    ]
    may += [link_admissible(link, state, policy, now, NO_PHASE) << 8 + at for at, link in enumerate(policy.contingency)]
    return (
        decision.outcome,
        REASON_NUMBERS[decision.reason],
        decision.step,
        number,
        target,
        decision.valid_until_us,
        degrade(choice.link) if choice is not None and choice.index == DEGRADE else NO_TARGET,
        sum(may),
    )
