"""A test gives the vehicle's decision: the same step, compiled, sealed and opened on board, is decided equally."""

from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from hypothesis import given, settings
from hypothesis import strategies as st

from reference.flat_case import ISSUED, S
from reference.world import loaded
from rtshcua import library
from rtshcua.decision.decide import decide
from rtshcua.ground.language.load import Program, load, remembered
from rtshcua.ground.pipeline.program import compile_program
from rtshcua.ground.pipeline.suite import suite
from rtshcua.ground.testing.case_result import run_case
from rtshcua.mavlink import dialect
from rtshcua.model.flat.policy import Policy, RuleKind
from rtshcua.model.flat.signal import POSITION
from rtshcua.model.flat.situation import ConfirmAnswer, Context, Now, State
from rtshcua.model.flat.zone import project
from rtshcua.onboard.enforcement.load import Loaded

DIALECT = dialect.load()
AT = 7_000 * S  # monotonic
PHASES = ("departure", "inspection", "recovery")
#: the interesting values of each signal: as written, and in canonical units
VALUES: dict[str, list[tuple[str, int | tuple[int, int] | None]]] = {
    "battery": [(f"{n} %", n * 100) for n in (80, 80, 80, 41, 36, 35, 26, 24, 12)] + [("unknown", None)],
    "battery.cell": [("3.9 V", 3_900), ("3.9 V", 3_900), ("3.5 V", 3_500), ("3.49 V", 3_490), ("unknown", None)],
    "battery.drain": [("6 %", 600), ("17.6 %", 1_760), ("60 %", 6_000), ("unknown", None)],
    "gps.fix": [("fix_3d", 3), ("fix_3d", 3), ("dgps", 4), ("fix_2d", None)],
    "wind.speed": [(f"{n} m/s", n * 1000) for n in (2, 2, 3, 6, 7, 10, 12)],
    "link.quality": [(f"{n} %", n * 100) for n in (90, 90, 40, 39)],
    "obstacle.distance": [(f"{n} m", n * 1000) for n in (40, 40, 8, 3)] + [("unknown", None)],
    "height": [(f"{n} m", n * 1000) for n in (20, 10, 5, 0, 36, 130)],
    "position": [
        ("47.39876 N, 8.54698 E", (473987600, 85469800)),
        ("47.39774 N, 8.54559 E", (473977400, 85455900)),
        ("47.39300 N, 8.54559 E", (473930000, 85455900)),
    ],
    "landed": [("in_air", 2), ("on_ground", 1)],
    "velocity.north": [("0 m/s", 0)],
    "velocity.east": [("1 m/s", 1000)],
    "velocity.down": [("0 m/s", 0)],
}


class Flight(NamedTuple):
    """A mission that compiles: its policy's name and version, and its steps with the numbers of their phases."""

    policy: str
    version: int
    steps: tuple[tuple[str, int], ...]


FLIGHTS = (
    *(
        Flight(
            "bridge_inspection", 7,
            (
                (f"takeoff(altitude = {up} m)", 0),
                (f"goto({bridge}.entry, altitude = {up} m)", 1),
                (f"inspect_area({bridge}, altitude = {top} m, pattern = {pattern})", 1),
                ("return_home()", 2),
            ),
        )
        for up, bridge, top, pattern in ((20, "bridge_b", 20, "perimeter"), (12, "bridge_a", 8, "perimeter"))
    ),
    Flight(
        "training_field", 2, (("takeoff(altitude = 10 m)", 0), ("hover(5 s)", 1), ("return_home()", 2)),
    ),
)  # fmt: skip


class Asked(NamedTuple):
    """A step and its situation: indexes into `VALUES`, ages in us, the answer of a person, the mission's phase."""

    flight: Flight
    step: int
    values: dict[str, int]
    old: tuple[str, int] | None
    issued: int
    released: int
    error: int
    phase: int
    granted: int | None


@st.composite
def asked(draw: st.DrawFn) -> Asked:
    """Any situation, but mostly one that is nearly allowed."""
    flight = draw(st.sampled_from(FLIGHTS))
    step = draw(st.integers(0, len(flight.steps) - 1))
    amiss = draw(st.sets(st.sampled_from(sorted(VALUES)), max_size=2))
    return Asked(
        flight,
        step,
        {name: draw(st.integers(0, len(VALUES[name]) - 1)) if name in amiss else 0 for name in VALUES},
        draw(st.sampled_from([None, None, ("battery", 5 * S + 1), ("height", 2 * S + 1), ("gps.fix", 2 * S)])),
        draw(st.sampled_from([60 * S, 60 * S, 60 * S, 2400 * S, 2401 * S])),
        draw(st.sampled_from([0, S, S, 5 * S, 31 * S])),
        draw(st.sampled_from([0, 0, 0, 2 * S])),
        draw(st.sampled_from([flight.steps[step][1]] * 4 + [0, 1, 2])),
        draw(st.sampled_from([None, 0, 1])),
    )


def program(text: str) -> Program:
    return load(
        ["it.rts"],
        lambda path: text.encode() if path == "it.rts" else Path(path).read_bytes(),
        str(library.root()),
        None,
        remembered,
    )


@cache
def aboard(flight: Flight) -> Loaded:
    """The bundle of a flight, compiled like by `rtshcua compile` and in force on board."""
    parts = [[step for step, phase in flight.steps if phase == number] for number in range(len(PHASES))]
    phases = "\n".join(f"phase {name} {{ {' '.join(part)} }}" for name, part in zip(PHASES, parts, strict=True))
    text = f"""import "lib:policies/{flight.policy}.rts"
mission it under {flight.policy}@{flight.version} on quad {{
  intent "To be compared." proposed by agent openclaw for role operator
  {phases}
}}
"""
    compiled = compile_program(program(text), DIALECT, mission="it", issued_at_us=ISSUED)
    assert compiled.policy is not None, compiled.diagnostics
    assert compiled.mission is not None, compiled.diagnostics
    return loaded(compiled.policy, compiled.mission)


def known(policy: Policy, asked: Asked) -> dict[str, tuple[str, Any, int]]:
    """The text, value and age of each signal that a policy reads."""
    found = {}
    for signal in policy.signals:
        text, value = VALUES[signal.name][asked.values[signal.name]]
        age = asked.old[1] if asked.old is not None and asked.old[0] == signal.name and value is not None else 0
        found[signal.name] = (text + (f" measured {age} us ago" if age else ""), value, age)
    return found


def on_board(asked: Asked) -> tuple[str, str, str | None]:
    """The decision on the step of the bundle."""
    of = aboard(asked.flight)
    policy, invocation = of.policy.policy, of.invocations[asked.step]
    values: list[int | None] = [None] * policy.slots
    ages = [0] * policy.slots
    said = known(policy, asked)
    for signal in policy.signals:
        _, value, age = said[signal.name]
        cells = project(policy.projection, *value) if signal.kind == POSITION else (value,)
        for offset, cell in enumerate(cells):
            values[signal.slot + offset], ages[signal.slot + offset] = cell, age
    assert not policy.monitors  # others would need observations
    answers = tuple(
        ConfirmAnswer(number, rule.approver, asked.granted, AT)
        for number, rule in enumerate(policy.rules)
        if rule.kind == RuleKind.CONFIRM and asked.granted is not None
    )
    flat = invocation.invocation
    standing = Context(
        flat.binding, of.vehicle, policy.version, 0, AT - asked.released, asked.phase, 20_000, answers
    )  # fmt: skip
    now = Now(AT, ISSUED + asked.issued, asked.error)
    found = decide(invocation, State(tuple(values), tuple(ages)), of.policy, standing, now)
    flies = None if found.target is None else policy.contracts[found.target.skill].name
    return found.outcome.name, found.reason.value, flies


def as_tested(asked: Asked) -> tuple[str, str, str | None]:
    """A test of the same request."""
    policy = aboard(asked.flight).policy.policy
    request, _ = asked.flight.steps[asked.step]
    given = ", ".join(f"{name} = {text}" for name, (text, _, _) in known(policy, asked).items())
    confirmed = any(rule.kind == RuleKind.CONFIRM for rule in policy.rules)
    word = "" if asked.granted is None else ("refused", "approved")[asked.granted]
    answer = f"{word} by role supervisor" if word and confirmed else ""
    at = datetime.fromtimestamp((ISSUED + asked.issued) // S, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    text = f"""import "lib:policies/{asked.flight.policy}.rts"
nominal here {{
  under {asked.flight.policy} on quad by role operator through agent
  at "{at}" within {asked.error} us
  phase {PHASES[asked.phase]} of {", ".join(PHASES)}
  given {given}
}}
test "it" {{
  {answer} issued {asked.issued} us ago released {asked.released} us ago
  when {request} expect allow
}}
"""
    (case,) = suite(program(text), DIALECT).cases
    found = run_case(case).trace.decision
    flies = None if found.target is None else policy.contracts[found.target.skill].name
    return found.outcome.name, found.reason.value, flies


@settings(max_examples=settings().max_examples // 2)
@given(asked())
def test_case_is_decided_like_the_step_of_a_bundle_on_board(asked: Asked) -> None:
    assert as_tested(asked) == on_board(asked)
