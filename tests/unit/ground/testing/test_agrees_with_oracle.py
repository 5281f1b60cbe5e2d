"""Random situations, written as rows of a table, are decided like by the naive oracle.

The oracle shares no code with the compiler: not for units, slots, ages, times, phases or people.
"""

from typing import Any, NamedTuple

from hypothesis import given, settings
from hypothesis import strategies as st

from reference.deciding import IMPORT, made
from reference.oracle import Oracle
from rtshcua.ground.testing.case import PolicyCase
from rtshcua.ground.testing.case_result import run_case
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.situation import ConfirmAnswer, Context, Now, State
from rtshcua.model.flat.zone import project
from rtshcua.model.outcome import Outcome

S = 1_000_000  # us
UTC = 1_780_300_800 * S  # 2026-06-01T08:00:00Z
NOMINAL = """nominal empty {
  under bridge_inspection on quad by role operator at "2026-06-01T08:00:00Z"
  phase departure of departure, inspection, recovery
}
"""
SIGNALS = ("battery", "gps.fix", "wind.speed", "link.quality", "obstacle.distance", "height", "position", "landed")
#: the values of each signal: as written, and in canonical units; the policy projects the place
FORMS: dict[str, Any] = {
    "battery": (st.integers(0, 100), "{} %", 100),
    "link.quality": (st.integers(0, 100), "{} %", 100),
    "wind.speed": (st.integers(0, 15), "{} m/s", 1000),
    "obstacle.distance": (st.integers(0, 40), "{} m", 1000),
    "height": (st.integers(0, 40), "{} m", 1000),
}
FIXES = {"dgps": 4, "fix_3d": 3, "fix_2d": None, "no_fix": None}  # None: `unknown at`
PLACES = {"47.39876 N, 8.54698 E": (473987600, 85469800), "47.39300 N, 8.54559 E": (473930000, 85455900)}
STALE = {"battery": 5, "link.quality": 5, "wind.speed": 10, "landed": 3}  # s; 2 for all others


class Row(NamedTuple):
    """A row, and the expected values and age of each signal."""

    text: str
    values: dict[str, tuple[tuple[int | tuple[int, int] | None], int]]


#: the text of good signals
GOOD = {"battery": 80, "link.quality": 90, "wind.speed": 3, "obstacle.distance": 40, "height": 20}


@st.composite
def rows(draw: st.DrawFn) -> Row:
    """One cell for each signal: mostly good, a few random, sometimes nearly stale or unknown."""
    cells, values = [], {}
    amiss = draw(st.sets(st.sampled_from(SIGNALS), max_size=2))
    for name in SIGNALS:
        written, value = draw(_written(name, name in amiss))
        age = 0
        if name in amiss:
            age = draw(st.sampled_from([0, 0, STALE.get(name, 2) * S, STALE.get(name, 2) * S + 1]))
            if draw(st.integers(0, 3)) == 0:
                written, value, age = "unknown", None, 0
        cells.append(written + (f" measured {age} us ago" if age else ""))
        values[name] = ((value,), age)
    return Row(", ".join(cells) + " expect allow", values)


@st.composite
def _written(draw: st.DrawFn, name: str, amiss: bool) -> tuple[str, Any]:
    if name in FORMS:
        numbers, form, unit = FORMS[name]
        number = draw(numbers) if amiss else GOOD[name]
        return form.format(number), number * unit
    if name == "gps.fix":
        label = draw(st.sampled_from(sorted(FIXES))) if amiss else "fix_3d"
        return label, FIXES[label]
    if name == "landed":
        return "in_air", 2
    place = list(PLACES)[int(amiss)]
    return place, PLACES[place]


class Asked(NamedTuple):
    """The parts of a test, and their expected values."""

    parts: tuple[str, ...]
    source: int
    role: str
    ages: tuple[int, int, int]  # us: the ages of the issue and the release, and the clock error
    phase: int
    granted: int | None
    skill: str


REQUESTS = [
    ("inspect_area(bridge_a, altitude = {} m)", "inspect_area", 1),
    ("goto(bridge_a.entry, altitude = {} m)", "goto", 1),
    ("hover({} s)", "hover", 1),
    ("return_home()", "return_home", 0),
]


@st.composite
def asked(draw: st.DrawFn) -> Asked:
    """A request that is allowed except for up to two mistakes."""
    amiss = draw(
        st.sets(st.sampled_from(["source", "role", "issued", "released", "error", "phase", "height"]), max_size=2)
    )

    def of(what: str, good: Any, *others: Any) -> Any:
        return draw(st.sampled_from(others)) if what in amiss else good

    form, skill, phase = draw(st.sampled_from([REQUESTS[0], *REQUESTS]))
    source = of("source", "operator", "agent", "onboard", "reflex")
    role = of("role", "operator", "supervisor")
    issued = of("issued", S, 0, 2400 * S, 2401 * S, -S)
    released = of("released", S, 4 * S, 5 * S, 29 * S, 31 * S)
    error = of("error", 0, S, S + 1)
    phase = of("phase", phase, 0, 1, 2)
    granted = draw(st.sampled_from([None, 0, 1, 1]))
    parts = [
        f"when {form.format(of('height', 20, 4, 8, 31, 61))} by {role} through {source}",
        f"issued in {-issued} us" if issued < 0 else f"issued {issued} us ago",
        f"released {released} us ago",
        f'at "2026-06-01T10:00:00+02:00" within {error} us',
        f"phase {('departure', 'inspection', 'recovery')[phase]}",
    ]
    if granted is not None:
        parts.append(f"{('refused', 'approved')[granted]} by role supervisor 1 s ago")
    number = ("agent", "operator", "onboard", "reflex").index(source)
    return Asked(tuple(parts), number, role, (issued, released, error), phase, granted, skill)


def expected(case: PolicyCase, asked: Asked, row: Row) -> tuple[Outcome, str, str | None]:
    """The oracle's decision in a situation that is built here."""
    policy, invocation = case.policy.lowered.policy, case.invocation.invocation
    assert policy.contracts[invocation.skill].name == asked.skill
    assert (invocation.source, policy.roles[invocation.role]) == (asked.source, asked.role)
    assert invocation.issued_at_us == UTC - asked.ages[0]
    at = 1000 * S
    answers = () if asked.granted is None else _answers(policy, asked.granted, at - S)
    standing = Context(
        invocation.binding, "quad-07", 7, 0, at - asked.ages[1], asked.phase, 20_000, answers
    )  # fmt: skip
    oracle = Oracle(policy, state(policy, row), Now(at, UTC, asked.ages[2]))
    outcome, reason, _ = oracle.decide(invocation, standing)
    target = oracle.target(invocation) if outcome is Outcome.FALLBACK else None
    return outcome, str(reason.value), None if target is None else target[1].text


def state(policy: Policy, row: Row) -> State:
    """The values of a row in the policy's slots."""
    values: list[int | None] = [None] * policy.slots
    ages = [0] * policy.slots
    for signal in policy.signals:
        (value,), age = row.values[signal.name]
        placed = project(policy.projection, *value) if isinstance(value, tuple) else (value,)
        for offset, each in enumerate(placed):
            values[signal.slot + offset] = each
            ages[signal.slot + offset] = age
        if value is None and signal.name == "position":
            ages[signal.slot + 1] = age
    return State(tuple(values), tuple(ages))


def _answers(policy: Policy, granted: int, at_us: int) -> tuple[ConfirmAnswer, ...]:
    role = policy.roles.index("supervisor")
    (rule,) = [number for number, rule in enumerate(policy.rules) if rule.approver == role]
    return (ConfirmAnswer(rule, role, granted, at_us),)


@settings(max_examples=settings().max_examples // 2)
@given(asked(), st.lists(rows(), min_size=1, max_size=12))
def test_case_is_decided_like_by_the_oracle(asked: Asked, rows: list[Row]) -> None:
    columns = ", ".join(SIGNALS)
    table = "\n".join(row.text for row in rows)
    found = made(f'test "it" {{ {" ".join(asked.parts)} table {columns} {{ {table} }} }}', IMPORT + NOMINAL)
    assert found.diagnostics == ()
    for case, row in zip(found.cases, rows, strict=True):
        decision = run_case(case).trace.decision
        target = None if decision.target is None else decision.target.text
        assert (decision.outcome, decision.reason.value, target) == expected(case, asked, row)
