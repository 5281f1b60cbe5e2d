"""The mode `unenforced`: it decides by phase, timing, state and safety as `decide` does, and by nothing else."""

import ast
import time
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

import rtshcua
from rtshcua.adapters.boundary import process
from rtshcua.decision.decide import decide
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evaluation import flights, sources
from rtshcua.evaluation.design import MODES, UNENFORCED, EvaluationPlan, WorkUnit
from rtshcua.evaluation.modes import load_in, unavailable
from rtshcua.evaluation.results import PointFlight, UnavailableMode
from rtshcua.model.decision import Decision
from rtshcua.model.flat.situation import Context, Now, State
from rtshcua.onboard.enforcement.load import EnforcementMode, Loaded
from rtshcua.onboard.ports import Command
from rtshcua.virtual import development_keys
from rtshcua.wire.request import CONTINGENCY_LINK, STEP, Request, encode
from rtshcua.wire.response import Status, decode

ISSUED_US = 1_767_225_600_000_000
NOW = Now(7_000_000, ISSUED_US + 60_000_000, 1_000)
PACKAGE = Path(rtshcua.__file__).parent


def begun(mode: str) -> Loaded:
    policy, mission = sources.compiled("standard", 500_000, ISSUED_US)
    bundle, root = development_keys.seal(policy, mission), development_keys.root(ISSUED_US, policy.roles)
    loaded = load_in(mode, bundle, root=root, now=NOW)
    assert isinstance(loaded, Loaded), loaded
    return loaded


@cache
def unenforced() -> Loaded:
    return begun(UNENFORCED)


def answered(loaded: Loaded, request: Request) -> Decision:
    contract = loaded.invocations[request.step].invocation.contract
    answer = decode(loaded.boundary.enforce(encode(request)), loaded.policy.policy, contract)
    assert isinstance(answer, Decision), answer
    return answer


#: values with which each step of the mission may be allowed, by signal
FINE = {
    "position": 0, "height": 0, "landed": 1, "velocity.north": 0, "velocity.east": 0, "velocity.down": 0, "gps.fix": 3,
    "battery": 9_000, "wind.speed": 1_000, "obstacle.distance": 30_000, "link.quality": 9_000,
}  # fmt: skip


def fine(loaded: Loaded) -> list[int | None]:
    """The values of a vehicle at home, by slot."""
    values: list[int | None] = [0] * loaded.policy.policy.slots
    for signal in loaded.policy.policy.signals:
        values[signal.slot] = FINE[signal.name]
    return values


def asked(step: int, values: Sequence[int | None], ages: Sequence[int] = (), **changed: Any) -> Request:
    loaded = unenforced()
    state = State(
        values=tuple(values), ages=tuple(ages) or (0,) * len(values), monitors=(0,) * len(loaded.policy.monitors)
    )
    prepared = loaded.invocations[step].invocation
    request = Request(STEP, step, -1, prepared.binding, NOW, state, NOW.monotonic_us, 0, 0)
    return replace(request, **changed)


@st.composite
def requests(draw: st.DrawFn) -> Request:
    """A request about any step, at any time, in a state of which some values are troubled."""
    values = fine(unenforced())
    ages = [0] * len(values)
    for slot in draw(st.sets(st.integers(0, len(values) - 1), max_size=2)):
        values[slot] = draw(st.none() | st.integers(-100, 60_000))
        ages[slot] = draw(st.integers(0, 2_000_000))
    since_us = draw(st.sampled_from([0, 0, 1, 400_000, 600_000]))
    return asked(
        draw(st.integers(0, 5)), values, ages, released_us=NOW.monotonic_us - since_us, phase=draw(st.integers(0, 2)),
        remaining_us=draw(st.sampled_from([0, 0, 100_001])),
    )  # fmt: skip


@settings(max_examples=60, deadline=None)
@given(request=requests())
def test_unenforced_decides_as_decide_does_behind_authority(request: Request) -> None:
    loaded = unenforced()
    prepared = loaded.invocations[request.step]
    context = Context(
        request.binding, loaded.vehicle, loaded.policy.policy.version, 0, request.released_us, request.phase,
        request.remaining_us, (),
    )  # fmt: skip
    expected = decide(prepared, request.state, loaded.policy, context, request.now)
    answer = answered(loaded, request)
    if expected.step <= 3:  # integrity, freshness, authority or approval decided: this mode does not ask them
        assert answer.step > 3
    else:
        assert replace(answer, permit=b"") == expected
        assert bool(answer.permit) is (answer.outcome == expected.outcome == 0)


def test_unenforced_checks_neither_binding_nor_replay() -> None:
    loaded = begun(UNENFORCED)
    request = asked(0, fine(loaded), binding=bytes(32))
    first, second = answered(loaded, request), answered(loaded, request)
    assert first.permit
    assert second.permit
    assert first.permit != second.permit
    command = loaded.executor.dispatch(first.permit, NOW.monotonic_us)
    assert isinstance(command, Command)
    assert command.skill == "takeoff"
    refused = loaded.executor.dispatch(bytes(len(first.permit)), NOW.monotonic_us)
    assert isinstance(refused, Refusal), "octets that no answer had are no permit"
    enforced = answered(begun("software"), request)
    assert (enforced.outcome.name, enforced.reason.value) == ("DENY", "integrity/binding-mismatch")


def test_unenforced_gives_links_and_refuses_malformed_requests() -> None:
    loaded = begun(UNENFORCED)
    link = replace(
        asked(0, fine(loaded)), kind=CONTINGENCY_LINK, step=-1, link=0, binding=loaded.bundle.policy_digest
    )  # fmt: skip
    answer = decode(loaded.boundary.enforce(encode(link)), loaded.policy.policy, None)
    assert isinstance(answer, Decision)
    assert isinstance(loaded.executor.dispatch(answer.permit, NOW.monotonic_us), Command)
    assert decode(loaded.boundary.enforce(b"no request"), loaded.policy.policy, None) is Status.MALFORMED


def test_mode_of_the_evaluation_is_no_mode_of_run() -> None:
    assert UNENFORCED not in [*EnforcementMode]
    assert {*MODES} - {UNENFORCED} == {*EnforcementMode}
    for file in PACKAGE.rglob("*.py"):
        if "evaluation" in file.relative_to(PACKAGE).as_posix():
            continue
        names = ast.walk(ast.parse(text)) if "evaluation.modes" in (text := file.read_text(encoding="utf-8")) else ()
        assert not [*names], f"{file} reaches the mode without enforcement"


def test_unavailable_mode_says_what_to_install(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    assert [mode for mode in ("none", UNENFORCED, "software") if unavailable(mode)] == []
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(process, "program", lambda: None)
    for mode, installed in (
        ("process", "make setup"),
        ("trustzone-m", "apt-get install"),
        ("optee", "apt-get install"),
    ):
        missing = unavailable(mode)
        assert missing is not None
        assert installed in missing.help
    (unit, *_) = flights.units(EvaluationPlan(1, ("optee",)))
    (absent,) = flights.run(unit)
    assert isinstance(absent, UnavailableMode)
    assert (absent.mode, "qemu-system-aarch64" in absent.why) == ("optee", True)


@pytest.mark.slow
def test_flight_is_timed_in_each_mode_without_an_emulator() -> None:
    modes = ("none", UNENFORCED, "software", "process")
    units = flights.units(EvaluationPlan(1, modes, quick=True))
    short = [unit for unit in units if unit.key[:2] == ("short", 1_500_000)]
    assert [unit.key[3] for unit in short] == [*modes]
    for unit in short:
        (flight,) = flights.run(unit)
        assert isinstance(flight, PointFlight)
        assert (flight.mission, flight.deadline_us, flight.seed, flight.mode) == unit.key
        assert flight.ending == "completed"
        assert [(step.step, step.outcome) for step in flight.invocations] == [(0, "allow"), (1, "allow"), (2, "allow")]


@pytest.mark.slow
def test_late_and_deferred_steps_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """A computer that takes 0.2 s to decide misses a deadline of 0.1 s."""
    enforce = flights._TimedBoundary.enforce

    def slow(self: flights._TimedBoundary, request: bytes) -> bytes:
        time.sleep(0.2)
        return enforce(self, request)

    monkeypatch.setattr(flights._TimedBoundary, "enforce", slow)
    (flight,) = flights.run(WorkUnit("X1", ("short", 100_000, 1, "software")))
    assert isinstance(flight, PointFlight)
    assert flight.misses == 3
    assert all((step.end_to_end_ns or 0) > 200_000_000 for step in flight.invocations)
    assert all(step.validation_ns < 100_000_000 for step in flight.invocations)
