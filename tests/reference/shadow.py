"""A pytest plug-in that repeats every decision of a test in C, and fails if the results differ:

    RTSHCUA_BOUNDARY=build/boundary/librtshcua.so pytest -p reference.shadow tests/unit tests/integration

Every request of every flight in this process is one more case; `make soak` runs it.
"""

import ctypes
import os
import sys
from collections import Counter
from types import SimpleNamespace
from typing import Any, Final

import pytest
from msgspec.structs import replace

from reference import flat_case, native
from rtshcua.decision import decide as decide_module
from rtshcua.decision.prepare import PreparedInvocation, PreparedPolicy
from rtshcua.model.decision import Decision
from rtshcua.model.flat.situation import Context, Now, State

_asked: Final = Counter[str]()
_decide = decide_module.decide
_c = native.Native(ctypes.CDLL(os.environ["RTSHCUA_BOUNDARY"]))
_ready: list[Any] = [None, None]  # the policy and the invocation that C has
_test: Final = SimpleNamespace(altered=False)  # whether the tested decision differs from the reference


def decide(
    invocation: PreparedInvocation, state: State, policy: PreparedPolicy, context: Context, now: Now
) -> Decision:
    """Return the decision of the reference, after checking that C decides the same."""
    decision = _decide(invocation, state, policy, context, now)
    if _test.altered:
        return decision
    if invocation.policy is not policy or len(state.values) != len(state.ages):
        _asked["what no request can say"] += 1
        return decision
    if _ready[0] is not policy:
        assert _c.policy(policy.policy) is None
        _ready[:] = policy, None
    if _ready[1] is not invocation:
        _prepare(invocation, policy)
        _ready[1] = invocation
    question = native.Question(state, context, now)
    assert _c.ask([question]) == [native.expected(invocation, question, decision)], question
    _asked["alike"] += 1
    return decision


def _prepare(invocation: PreparedInvocation, policy: PreparedPolicy) -> None:
    """Give C the step, in a mission with a phase of the same name if the policy has that name."""
    step = invocation.invocation
    name = policy.policy.phases[invocation.phase] if invocation.phase >= 0 else "a phase that no condition names"
    phases = (*(f"phase {number}" for number in range(step.phase)), name)
    mission = replace(flat_case.MISSION, phases=phases, invocations=(step,))
    _c.unchecked(mission, 0)


def pytest_configure() -> None:
    """Replace `decide` in every module that imported it."""
    for module in list(sys.modules.values()):
        if getattr(module, "decide", None) is _decide:
            module.decide = decide  # type: ignore[attr-defined]


def pytest_collection_finish() -> None:
    """Replace `decide` in the tests too."""
    pytest_configure()


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip marked tests."""
    _test.altered = item.get_closest_marker("altered") is not None


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Report the number of compared decisions."""
    terminalreporter.write_line(f"asked of the decision in C too: {dict(_asked)}")
