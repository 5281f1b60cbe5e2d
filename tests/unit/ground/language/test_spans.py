"""The span of every node is its exact source text."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.language.parse import parse
from rtshcua.model.ir.expression import (
    Arithmetic,
    Coordinates,
    Function,
    Grow,
    Quantity,
    Range,
    Reference,
    TimeOfDay,
)
from rtshcua.model.ir.missions import Overrides, Repeat, Step
from rtshcua.model.ir.node import Name, Node
from rtshcua.model.ir.places import Circle, Combination, Corridor, Daily, Dates, GeoJson, Polygon
from rtshcua.model.ir.policies import Delegation, RuleDecl, Use
from virtual.rows import rows

SHIPPED = sorted(path for folder in ("skills", "policies", "missions", "evaluation") for path in
                 (Path(__file__).resolve().parents[4] / folder).glob("*.rts"))  # fmt: skip

FORMS = Path(__file__).with_name("forms.rts")

CONDITIONS = {
    "comparison", "within", "one-of", "inside", "not", "for-last", "within-last", "near", "edge",
}  # fmt: skip

#: rarely used corners, with tabs, comments and line ends in the middle
CORNERS = """\ufeff// first\r
signal a.b:speed=M.x,M.y or\tN.z unknown at -1 , none stale/* now */after 5 s\r
zone z=circle(1 N,2 E,3 m)floor -2 m  above  sea
skill s(p: one of a , b=a, q: speed in 1 m/s..2 m/s=1.5 m/s){\t
  require not(x>1+2*(y - 3 m))and\r
    local  time in 08:00 .. 18:30 or 1 N , 2 W outside grow( z , -5 m ) and v in { a,b }
  valid for 1_000 s during a , b fallback c( 1 , d=e ) for 3 s , f
}
policy p version 1{ permit any by any when x>1 degrade any to c for 1 s airspace outside z }
mission m under p@1 on v { proposed by agent o for role r phase q{ c( d ) on
 inadmissible hold } }
"""


def nodes(node: Node) -> Iterator[tuple[Node, Node]]:
    """Every node with its parent."""
    for field in type(node).__struct_fields__:
        for child in within(getattr(node, field)):
            yield child, node
            yield from nodes(child)


def within(value: object) -> Iterator[Node]:
    """The nodes of a field: itself, those of a tuple, those of tuples in it."""
    if isinstance(value, Node):
        yield value
    elif isinstance(value, tuple) and not isinstance(value, Span):
        for part in value:
            yield from within(part)


def read(path: Path) -> str:
    return path.read_bytes().decode()


def reparsed(text: str) -> Node:
    """The value or condition that `text` is."""
    parsed = parse(Source("again", f"skill s() {{ require {text} }}"))
    if parsed.diagnostics:
        parsed = parse(Source("again", f"skill s() {{ require x < {text} }}"))
        assert parsed.diagnostics == (), text
        condition = parsed.unit.skills[0].require[0].condition
        assert condition.kind == "comparison"
        return condition.right
    return parsed.unit.skills[0].require[0].condition


def same(one: Node, other: Node) -> bool:
    """Equal but for their spans."""
    return without_spans(one) == without_spans(other)


def without_spans(value: object) -> object:
    if isinstance(value, Node):
        fields = [field for field in type(value).__struct_fields__ if field != "span"]
        return (type(value).__name__, *(without_spans(getattr(value, field)) for field in fields))
    if isinstance(value, tuple):
        return tuple(map(without_spans, value))
    return value


@rows("text", [pytest.param(read(path), id=path.stem) for path in (*SHIPPED, FORMS)] + [CORNERS])
def test_nodes_have_the_spans_of_their_text(text: str) -> None:
    source = Source("x.rts", text)
    parsed = parse(source)
    assert parsed.diagnostics == ()
    count = 0
    for node, parent in nodes(parsed.unit):
        count += 1
        written = source.slice(node.span)
        assert node.span.file == "x.rts"
        assert written == written.strip() != ""
        assert parent.span.start <= node.span.start < node.span.end <= parent.span.end
        if isinstance(node, Name):
            assert written == ("one of" if node.text == "choice" else node.text)
        elif isinstance(node, Reference):
            assert " ".join(written.split()) == node.name
        elif isinstance(node, TimeOfDay | Coordinates | Arithmetic | Function) or (
            isinstance(node, Quantity) and "utc" not in written
        ):
            assert same(reparsed(written), node)
        elif isinstance(node, Grow | Range):
            found = reparsed(f"a inside {written}" if isinstance(node, Grow) else f"a in {written}")
            assert same(getattr(found, "region" if isinstance(node, Grow) else "range"), node)
        elif getattr(node, "kind", None) in CONDITIONS:
            assert same(reparsed(written), node)
        elif isinstance(node, Circle | Polygon | Corridor | Combination | GeoJson):
            mark = "" if isinstance(node, GeoJson) else "="
            assert same(parse(Source("again", f"zone z {mark} {written}")).unit.zones[0].shape, node)
        elif isinstance(node, Daily | Dates):
            zone = parse(Source("again", f"zone z = circle(1 N, 2 E, 3 m) {written}")).unit.zones[0]
            assert same(zone.daily if isinstance(node, Daily) else zone.dates, node)
        elif isinstance(node, Step | Repeat):
            mission = parse(Source("again", f"mission m under p@1 on v {{ phase a {{ {written} }} }}")).unit.missions[0]
            assert same(mission.phases[0].items[0], node)
        elif isinstance(node, Overrides):
            mission = parse(
                Source("again", f"mission m under p@1 on v {{ phase a {{ x() {written} }} }}")
            ).unit.missions[0]
            assert same(mission.phases[0].items[0].overrides, node)
        elif isinstance(node, RuleDecl | Use | Delegation):
            policy = parse(Source("again", f"policy p version 1 {{ {written} }}")).unit.policies[0]
            assert same((*policy.rules, *policy.uses, *policy.delegations)[0], node)
    assert count > 5


def test_declarations_span_from_their_first_word_to_their_end() -> None:
    source = Source("x.rts", "/* a */ zone z = circle(1 N, 2 E, 3 m) floor 2 m // b\n skill s() { } // c")
    unit = parse(source).unit
    assert source.slice(unit.zones[0].span) == "zone z = circle(1 N, 2 E, 3 m) floor 2 m"
    assert source.slice(unit.skills[0].span) == "skill s() { }"
    assert source.slice(unit.span) == source.text
