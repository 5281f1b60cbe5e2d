"""Lowered conditions, evaluated as on board, agree with a naive reading of the source."""

from collections.abc import Callable, Mapping
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from rtshcua.decision.evaluate import Environment, build
from rtshcua.decision.prepare import PreparedPolicy, prepare
from rtshcua.decision.values import FALSE, MISSING, TRUE, UNKNOWN, Value, point
from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import compile_program
from rtshcua.mavlink import dialect

CHECKOUT = Path(__file__).resolve().parents[4]

SOURCE = """
import "lib:policies/site.rts"
import "lib:skills/signals.rts"
import "lib:skills/emergency_land.rts"

skill probe(
  up:   altitude in -100 m .. 100 m,
  pace: speed in 1 m/s .. 8 m/s,
  look: one of near, far, all,
) {
  motion   hold
  class    tactical
  deadline 5 s
  valid    for 40 min
  lasts    at most 1 min
  fallback emergency_land
  energy   at most 5 %%
}

policy rules version 1 {
  permit probe by role operator
  forbid probe by any when %s
  permit emergency_land by any
  contingency emergency_land
}

mission m under rules@1 on surveyor {
  proposed by operator x for role operator
  phase a { emergency_land() }
}
"""

#: the value of each name in a condition; None is unknown
World = Mapping[str, int | str | None]
#: a condition as source text, with its truth value in a world
Meaning = tuple[str, Callable[[World], bool | None]]

NUMBERS: dict[str, tuple[str, int]] = {
    "height": ("m", 1000),
    "up": ("m", 1000),
    "battery": ("%", 100),
    "wind.speed": ("m/s", 1000),
    "pace": ("m/s", 1000),
}
PAIRS = [("height", "up"), ("wind.speed", "pace"), ("battery", "battery")]
ENUMS = {
    "gps.fix": ["no_gps", "no_fix", "fix_2d", "fix_3d", "dgps", "rtk_float", "rtk_fixed", "static", "ppp"],
    "look": ["near", "far", "all"],
}
OPERATORS: dict[str, Callable[[int, int], bool]] = {
    "<": lambda a, b: a < b,
    "<=": lambda a, b: a <= b,
    ">": lambda a, b: a > b,
    ">=": lambda a, b: a >= b,
    "==": lambda a, b: a == b,
    "!=": lambda a, b: a != b,
}


@st.composite
def atoms(draw: st.DrawFn) -> Meaning:
    """Draw a comparison or a membership."""
    operator = draw(st.sampled_from(sorted(OPERATORS)))
    kind = draw(st.sampled_from(["number", "sum", "range", "enum", "one of"]))
    if kind in ("enum", "one of"):
        return draw(memberships(kind, operator))
    name, other = draw(st.sampled_from(PAIRS))
    unit, scale = NUMBERS[name]
    least = 0 if name == "battery" else -9  # the checker refuses a negative charge
    low, high, factor = draw(st.integers(least, 40)), draw(st.integers(least, 40)), draw(st.integers(-3, 3))
    if kind == "number":
        return f"{low} {unit} {operator} {name}", lambda w: known(
            w[name], lambda v: OPERATORS[operator](low * scale, v)
        )
    if kind == "range":
        low, high = min(low, high), max(low, high)
        return (
            f"{name} in {low} {unit} .. {high} {unit}",
            lambda w: known(w[name], lambda v: low * scale <= v <= high * scale),
        )

    def total(world: World) -> bool | None:
        return known(
            world[name], lambda v: known(world[other], lambda o: OPERATORS[operator](v, o + factor * high * scale))
        )

    return f"{name} {operator} {other} + {factor} * ({high} {unit})", total


@st.composite
def memberships(draw: st.DrawFn, kind: str, operator: str) -> Meaning:
    """Draw a condition over an enumeration. The choices of a parameter have no order."""
    name = draw(st.sampled_from(sorted(ENUMS)))
    members = ENUMS[name]
    if kind == "one of":
        chosen = draw(st.lists(st.sampled_from(members), min_size=1, unique=True))
        return f"{name} in {{ {', '.join(chosen)} }}", lambda w: known(w[name], lambda v: v in chosen)
    member = draw(st.sampled_from(members))
    operator = operator if name == "gps.fix" or operator in ("==", "!=") else "=="
    return f"{name} {operator} {member}", lambda w: known(
        w[name], lambda v: OPERATORS[operator](members.index(v), members.index(member))
    )


def known(value: object, judge: Callable[..., bool | None]) -> bool | None:
    """Return unknown if the value is unknown."""
    return None if value is None else judge(value)


def negated(meaning: Meaning) -> Meaning:
    text, truth = meaning
    return f"not ({text})", lambda w: None if truth(w) is None else not truth(w)


def joined(parts: list[Meaning], word: str) -> Meaning:
    """Join truth values by Kleene: a false part makes `and` false, a true part makes `or` true."""
    decisive = word == "or"

    def truth(world: World) -> bool | None:
        found = [part(world) for _, part in parts]
        return decisive if decisive in found else None if None in found else not decisive

    return f" {word} ".join(f"({text})" for text, _ in parts), truth


CONDITIONS = st.recursive(
    atoms(),
    lambda inner: st.one_of(
        inner.map(negated),
        st.builds(joined, st.lists(inner, min_size=2, max_size=3), st.sampled_from(["and", "or"])),
    ),
    max_leaves=6,
)
WORLDS = st.fixed_dictionaries(
    {
        **{name: st.none() | st.integers(-9, 40).map(lambda v, s=scale: v * s) for name, (_, scale) in NUMBERS.items()},
        **{name: st.none() | st.sampled_from(members) for name, members in ENUMS.items()},
    }
)
ARGUMENTS = ("up", "pace", "look")


def lowered(text: str) -> PreparedPolicy:
    """Compile a policy with a condition."""
    program = load(
        ["x.rts"], lambda path: (SOURCE % text).encode() if path == "x.rts" else Path(path).read_bytes(), str(CHECKOUT)
    )
    compiled = compile_program(program, dialect.load(), mission=None, issued_at_us=0)
    assert compiled.policy is not None, [d.message for d in compiled.diagnostics]
    prepared = prepare(compiled.policy)
    assert isinstance(prepared, PreparedPolicy), prepared
    return prepared


@given(CONDITIONS, st.lists(WORLDS, min_size=3, max_size=3))
def test_lowered_condition_agrees_with_a_naive_reading(condition: Meaning, worlds: list[World]) -> None:
    text, truth = condition
    prepared = lowered(text)
    node = next(prepared.compiler.when(rule) for rule in prepared.policy.rules if rule.when is not None)
    assert node is not None
    condition_on_board = build(node, prepared.tables)
    for world in worlds:
        world = {
            name: 0 if value is None and name in NUMBERS and name in ARGUMENTS else value
            for name, value in world.items()
        }
        world["look"] = world["look"] or "near"
        slots: list[Value] = [MISSING] * (prepared.policy.slots + 1)
        for signal in prepared.policy.signals:
            value = world.get(signal.name)
            if value is not None:
                number = value if isinstance(value, int) else ENUMS[signal.name].index(value)
                slots[signal.slot] = point(number)
        up, pace, look = world["up"], world["pace"], world["look"]
        assert isinstance(up, int)
        assert isinstance(pace, int)
        assert isinstance(look, str)
        arguments = (point(up), point(pace), point(ENUMS["look"].index(look)))
        ours = condition_on_board(Environment(slots, arguments, ((0, 0),), (0, 0)))
        expected = truth(world)
        assert ours == (UNKNOWN if expected is None else TRUE if expected else FALSE), (text, world)
