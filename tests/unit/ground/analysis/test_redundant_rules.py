"""Deleting all rules reported as dead, shadowed or redundant changes no decision of authority."""

from itertools import product
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from rtshcua.decision.evaluate import Environment
from rtshcua.decision.prepare import PreparedPolicy, prepare
from rtshcua.decision.values import MISSING, TRUE, UNKNOWN, Value, point
from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import compile_program
from rtshcua.mavlink import dialect
from rtshcua.model.flat.policy import RuleKind

CHECKOUT = Path(__file__).resolve().parents[4]
LIBRARY = str(CHECKOUT / "tests/golden/checker/library")
ATOMS = (
    *(f"altitude {operator} {bound} m" for operator in ("<=", ">") for bound in (10, 20, 30)),
    *(f"battery {operator} {bound} %" for operator in ("<", ">=") for bound in (20, 50)),
    "height > altitude",
)
CONDITIONS = st.recursive(
    st.sampled_from(ATOMS),
    lambda inner: st.one_of(
        st.builds("({}) and ({})".format, inner, inner),
        st.builds("({}) or ({})".format, inner, inner),
        st.builds("not ({})".format, inner),
    ),
    max_leaves=3,
)
RULES = st.lists(
    st.builds(
        "{} takeoff by {} when {}".format, st.sampled_from(("permit", "forbid")), st.just("role operator"), CONDITIONS
    ),
    min_size=2,
    max_size=6,
)
TEXT = """
import "lib:policies/site.rts"
import "lib:skills/signals.rts"
import "lib:skills/takeoff.rts"
import "lib:skills/return_home.rts"
import "lib:skills/emergency_land.rts"
policy rules version 1 {{
  permit return_home, emergency_land by any
  {}
  contingency return_home, emergency_land
}}
mission m under rules@1 on quad {{
  proposed by operator x for role operator
  phase departure {{ emergency_land() }}
}}
"""
METRES = (5_000, 10_000, 10_001, 15_000, 20_000, 25_000, 30_000, 31_000)
CHARGES = (1_000, 2_000, 3_000, 5_000, 6_000, None)
HEIGHTS = (0, 12_000, 50_000, None)


def outcome(prepared: PreparedPolicy, kept: list[int], at: Environment) -> str:
    """Return the decision of authority on an operator's `takeoff`, by the rules with these numbers."""
    truths = [
        (prepared.policy.rules[each].kind, prepared.compiler.condition(prepared.policy.rules[each], each)(at))
        for each in kept
    ]
    if (RuleKind.FORBID, TRUE) in truths or (RuleKind.PERMIT, TRUE) not in truths:
        return "deny"
    return "defer" if (RuleKind.FORBID, UNKNOWN) in truths else "pass"


@given(RULES)
def test_reported_rules_do_not_change_any_decision(rules: list[str]) -> None:
    text = TEXT.format("\n  ".join(rules))
    program = load(["x.rts"], lambda path: text.encode() if path == "x.rts" else Path(path).read_bytes(), LIBRARY)
    compiled = compile_program(program, dialect.load(), mission=None, issued_at_us=0)
    assert compiled.policy is not None, compiled.diagnostics
    prepared = prepare(compiled.policy)
    assert isinstance(prepared, PreparedPolicy)
    spans = [each.span for each in compiled.diagnostics if each.code.id in ("E0720", "E0721", "E0722")]
    takeoff = next(number for number, each in enumerate(prepared.policy.contracts) if each.name == "takeoff")
    every = [number for number, rule in enumerate(prepared.policy.rules) if takeoff in rule.skills]
    gone = {
        number
        for number in every
        for span in spans
        if span is not None
        and prepared.policy.rules[number].start <= span.start
        and span.end <= prepared.policy.rules[number].end
    }
    kept = [number for number in every if number not in gone]
    known = prepared.tables.known
    for altitude, charge, height in product(METRES, CHARGES, HEIGHTS):
        slots: list[Value] = [MISSING] * (prepared.policy.slots + 1)
        slots[known.battery] = MISSING if charge is None else point(charge)
        slots[known.height] = MISSING if height is None else point(height)
        at = Environment(slots, (point(altitude),), ((0, 0),), (0, 0))
        assert outcome(prepared, every, at) == outcome(prepared, kept, at), (altitude, charge, height)
