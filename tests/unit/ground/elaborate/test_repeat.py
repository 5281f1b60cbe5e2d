"""`repeat` is unrolled at any nesting, up to the onboard limit."""

from collections.abc import Callable
from typing import Any

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rtshcua.diagnostics.span import Source
from rtshcua.ground.checker.report import Report
from rtshcua.ground.elaborate.elaborate import unrolled
from rtshcua.ground.language.parse import parse
from rtshcua.ground.pipeline.program import Checked, Compiled
from rtshcua.model.flat.limits import MAX_INVOCATIONS
from rtshcua.model.ir.missions import MissionDecl
from virtual.rows import rows

Compile = Callable[..., Compiled]
Check = Callable[[str], Checked]

#: a phase as nested lists: a name is a step, (n, [...]) a repetition
items = st.recursive(
    st.sampled_from("abc"),
    lambda inner: st.tuples(st.integers(1, 4), st.lists(inner, max_size=3)),
    max_leaves=8,
)


def text_of(item: Any) -> str:
    if isinstance(item, str):
        return f"{item}()"
    count, inner = item
    return f"repeat {count} {{ {' '.join(map(text_of, inner))} }}"


def steps_of(item: Any) -> list[str]:
    if isinstance(item, str):
        return [item]
    count, inner = item
    return [step for each in inner for step in steps_of(each)] * count


def mission_of(body: str) -> tuple[MissionDecl, Report]:
    source = Source("x.rts", f"mission m under p@1 on v {{ phase a {{ {body} }} phase b {{ z() }} }}")
    parsed = parse(source)
    assert parsed.diagnostics == ()
    return parsed.unit.missions[0], Report({"x.rts": source})


@settings(max_examples=settings().max_examples * 2, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(items, max_size=4))
def test_repeat_is_unrolled_in_order(phase: list[Any]) -> None:
    mission, report = mission_of(" ".join(map(text_of, phase)))
    plain = unrolled(report, mission)
    assert report.found == []
    found = [[step.skill.text for step in phase.steps] for phase in plain.phases]
    assert found == [[step for item in phase for step in steps_of(item)], ["z"]]
    assert all(len(phase.items) == len(phase.steps) for phase in plain.phases)
    steps = [step for phase in plain.phases for step in phase.steps]
    assert len(set(map(id, steps))) == len(steps) or plain is mission


@rows(
    ("body", "codes", "steps"),
    [
        ("repeat 0 { a() }", ["E0319"], 2),
        ("repeat 0 { a() } repeat 0 { b() }", ["E0319", "E0319"], 3),
        (f"repeat {MAX_INVOCATIONS - 1} {{ a() }}", [], MAX_INVOCATIONS),
        (f"repeat {MAX_INVOCATIONS} {{ a() }}", ["E0810"], 2),
        ("repeat 1000 { repeat 1000 { repeat 1000 { a() b() } } }", ["E0810"], 3),
        ("repeat 9_007_199_254_740_991 { }", [], 1),
    ],
)
def test_too_many_repetitions_are_refused_before_unrolling(body: str, codes: list[str], steps: int) -> None:
    mission, report = mission_of(body)
    plain = unrolled(report, mission)
    assert [each.code.id for each in report.found] == codes
    assert sum(len(phase.steps) for phase in plain.phases) == steps


def test_each_repetition_is_an_onboard_step(compile_text: Compile, site: str) -> None:
    text = (
        site
        + """
policy p version 1 {
  permit takeoff by role operator through agent
  permit hover, return_home, emergency_land by any
  contingency hover for 10 s, return_home, emergency_land
}
mission m under p@1 on quad {
  proposed by agent openclaw for role operator
  phase departure { takeoff(altitude = 10 m)  repeat 2 { hover(1 s) repeat 2 { hover(2 s) } }  return_home() }
}
"""
    )
    compiled = compile_text(text)
    assert compiled.diagnostics == ()
    assert compiled.mission is not None
    assert [step.arguments for step in compiled.mission.invocations] == [
        (10_000,), *[(1_000_000,), (2_000_000,), (2_000_000,)] * 2, (),
    ]  # fmt: skip
    assert [step.step for step in compiled.mission.invocations] == list(range(8))


def test_finding_in_a_repetition_is_reported_once(check_text: Check, site: str) -> None:
    text = (
        site
        + """
policy p version 1 {
  permit hover, return_home, emergency_land by any
  contingency hover for 10 s, return_home, emergency_land
}
mission m under p@1 on quad {
  proposed by agent openclaw for role operator
  phase departure { repeat 5 { hover(time = 2 m) } }
}
"""
    )
    assert [each.code.id for each in check_text(text).diagnostics] == ["E0310"]
