"""A compromised runtime claims wrong truths of temporal monitors: of a wrong length, or not a truth at all.

The boundary cannot detect a false truth, as it cannot detect a false wind speed; the log keeps the claim.
"""

import pytest
from msgspec.structs import replace

from reference.flat_case import CONTRACTS, MISSION, POLICY, TAKEOFF, WIND, M, S, apply, clause, const, signal
from reference.world import START, FakeVehicle, answer_to, loaded, request_for
from rtshcua.model.decision import Decision
from rtshcua.model.flat.code import Op
from rtshcua.model.flat.policy import Monitor, MonitorKind
from rtshcua.model.flat.situation import State
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.wire.response import Status
from virtual.rows import rows

BREEZE = clause("wind.speed < 8 m/s", apply(Op.LT, signal(WIND), const(8 * M)))


def armed() -> Loaded:
    """A bundle whose takeoff requires calm wind for 3 s."""
    takeoff = replace(
        CONTRACTS[TAKEOFF],
        require=(clause("wind.speed < 8 m/s for the last 3 s", (Op.MONITOR, 0, 0)),),
        assume=(),
        reads=(WIND,),
    )
    policy = replace(
        POLICY, monitors=(Monitor(MonitorKind.FOR_LAST, 3 * S, BREEZE),), contracts=(takeoff, *CONTRACTS[1:])
    )
    first = replace(MISSION.invocations[0], contract=takeoff)
    return loaded(policy, replace(MISSION, invocations=(first, *MISSION.invocations[1:])))


def claiming(of: Loaded, *monitors: int) -> bytes:
    values = FakeVehicle().values
    state = State(tuple(values[slot] for slot in range(len(values))), (0,) * len(values), monitors)
    return request_for(of, state=state)


@rows("monitors", [(), (1, 1), (1,) * 13, (0,), (3,), (5,), (7,), (255,)])
def test_request_without_truth_for_each_monitor_is_refused(monitors: tuple[int, ...]) -> None:
    of = armed()
    assert answer_to(of, claiming(of, *monitors)) is Status.MALFORMED
    assert isinstance(answer_to(of, claiming(of, 1)), Decision), "nothing is remembered of it"


@pytest.mark.parametrize(
    ("truth", "outcome", "reason"),
    [
        (1, Outcome.ALLOW, Reason.ADMITTED),
        (2, Outcome.FALLBACK, Reason.STATE_VIOLATED),
        (4, Outcome.DEFER, Reason.STATE_UNKNOWN),
    ],
)
def test_each_truth_is_decided_on(truth: int, outcome: Outcome, reason: Reason) -> None:
    of = armed()
    answer = answer_to(of, claiming(of, truth))
    assert isinstance(answer, Decision)
    assert (answer.outcome, answer.reason) == (outcome, reason)


def test_monitor_truth_cannot_be_used_later() -> None:
    """The permit ends a second after the observation at the latest, however fresh the wind is."""
    of = armed()
    answer = answer_to(of, claiming(of, 1))
    assert isinstance(answer, Decision)
    assert answer.valid_until_us <= START.monotonic_us + S


def test_request_with_the_wrong_number_of_monitors_is_malformed() -> None:
    of, without = armed(), loaded()
    assert answer_to(of, request_for(without)) is Status.MALFORMED
    assert answer_to(without, claiming(of, 1)) is Status.MALFORMED
