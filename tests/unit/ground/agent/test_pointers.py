"""The value of a specification that a finding is about: the smallest one that contains its span."""

import json

from hypothesis import given
from hypothesis import strategies as st

from rtshcua.diagnostics.span import Span
from rtshcua.ground.agent.json_tree import JsonPlaces, JsonTree, Path, pointer, read_json

VALUES = st.recursive(
    st.integers(-9, 9) | st.text(max_size=3) | st.none(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=2), inner, max_size=3),
    max_leaves=12,
)


def smallest(tree: JsonTree, span: Span) -> Path:
    """The definition, by a search over all places."""
    holding = [
        (place.end - place.start, path)
        for places in (tree.spans, tree.keys)
        for path, place in places.items()
        if place.start <= span.start and span.end <= place.end
    ]
    return min(holding, key=lambda each: each[0])[1] if holding else ()


@given(VALUES, st.integers(0, 80), st.integers(0, 80))
def test_innermost_value_is_the_smallest_that_contains_the_span(value: object, one: int, other: int) -> None:
    text = json.dumps(value, indent=1)
    _, tree, _ = read_json("x", text.encode())
    assert tree is not None
    span = Span("x", *sorted((min(one, len(text)), min(other, len(text)))))
    assert JsonPlaces(tree).innermost(span) == smallest(tree, span)


def test_pointer_is_escaped() -> None:
    assert pointer(("a/b", 0, "~")) == "/a~1b/0/~0"
