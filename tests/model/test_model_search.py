"""Every reachable state of small runs, on the real runtime, boundary and executor (docs/model-checking.md).

During a search, `watching` checks each dispatch, end and stand-down. Afterwards, the graph
shows whether every path ends, and the duration of the longest.
"""

from dataclasses import replace as with_fields

import pytest

from model.graph import longest
from model.searching import Found, Search
from model.small import ALL, LIMITS, TINY, UNIT, Small
from reference.flat_case import S
from rtshcua.onboard.runtime.limits import falling_us, run_us
from rtshcua.wire.permit import LINK_VALID_US
from virtual.rows import rows

#: the interval, in transitions, of checks that states counted as equal behave equally
DOUBLE_OF = 101


def check(of: Small) -> Found:
    """Search it and check its bounds; print the figures of docs/model-checking.md."""
    found = Search(of).run(double_of=DOUBLE_OF)
    assert found.whole
    assert len(found.doubles) > 20
    _, endless = longest([[(target, units) for target, units, _ in edges] for edges in found.edges])
    assert not endless, f"time may pass for ever: {found.way(endless[0])}"
    times, _ = longest([[(target, heard) for target, _, heard in edges] for edges in found.edges])
    whole = run_us(of.policy, of.mission, LIMITS, UNIT)
    assert whole is not None
    assert max(times) * UNIT <= whole
    chains = [falling_us(of.policy, contract, LIMITS, UNIT) for contract in {*_contracts(of), None}]
    falling = max(time for time, falls in zip(times, found.falling, strict=True) if falls)
    assert falling * UNIT <= max(chains)
    figures = f"{found.states} states, {found.transitions} transitions, ends within {max(times)} of {whole // UNIT}"
    print(f"{of.name}: {figures}, falls back within {falling} of {max(chains) // UNIT}")
    return found


def _contracts(of: Small) -> list[object]:
    return [invocation.contract for invocation in of.mission.invocations]


@pytest.mark.slow
def test_every_state_of_a_tiny_run() -> None:
    found = check(TINY)
    assert found.states > 400, "the search must not be cut off by what it does not try"
    expected = {"completed", "aborted", "refused", "interrupted", "stood-down", "crashed", "left"}
    assert found.endings == expected


def test_run_ended_by_silence_sends_nothing() -> None:
    found = Search(with_fields(TINY, profiles=("good",), events=("ready", "link lost", "time"))).run()
    assert "link-lost" in found.endings


@pytest.mark.soak
@pytest.mark.parametrize("of", ALL, ids=lambda of: of.name)
def test_every_state_of_a_small_run(of: Small) -> None:
    check(of)


@rows(
    ("edges", "times", "endless"),
    [
        ([[]], [0], []),
        ([[(1, 1)], [(2, 0)], []], [1, 0, 0], []),
        ([[(0, 0), (1, 2)], []], [2, 0], []),
        ([[(1, 0), (2, 1)], [(0, 0), (2, 3)], []], [3, 3, 0], []),
        ([[(1, 0)], [(0, 1)]], [0, 0], [0, 1]),
        ([[(1, 0)], [(1, 1)], [(0, 0)], []], [0, 0, 0, 0], [0, 1, 2]),
    ],
)
def test_longest_path_is_within_bound(edges: list[list[tuple[int, int]]], times: list[int], endless: list[int]) -> None:
    found = longest(edges)
    assert found[1] == endless
    assert endless or found[0] == times


def test_the_bounds_of_a_policy_are_sums_over_its_chains() -> None:
    policy, takeoff = TINY.policy, TINY.mission.invocations[0].contract
    slack = LIMITS.flapping_us + UNIT
    last = S + slack
    insisting = LIMITS.tries * (LIMITS.retry_us + slack + last) + slack
    late = LIMITS.tries * (LINK_VALID_US + slack)
    contingency = 3 * (S + slack) + insisting + last + insisting + 2 * late
    assert falling_us(policy, None, LIMITS, UNIT) == contingency
    assert falling_us(policy, takeoff, LIMITS, UNIT) == S + slack + contingency
