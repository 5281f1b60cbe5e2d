"""File patterns agree with a naive implementation, and no pattern takes long."""

from itertools import repeat

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtshcua.ground.project.file_patterns import matches
from virtual.rows import rows

_PART = st.text("ab*?", min_size=1, max_size=4)
_PATTERN = st.builds(
    lambda lead, parts, tail: lead + "/".join(parts) + tail,
    st.sampled_from(["", "./", "/"]),
    st.lists(_PART | st.just("**"), min_size=1, max_size=4),
    st.sampled_from(["", "/"]),
)
_PATH = st.lists(st.text("ab*", min_size=1, max_size=4), min_size=1, max_size=5).map("/".join)


def naive(pattern: str, path: str) -> bool:
    """The definition of the docs page, by exhaustive search."""
    written = pattern.removeprefix("./")
    parts = [part for part in written.split("/") if part]
    if "/" not in written.rstrip("/"):
        parts = ["**", *parts]
    whole = path.split("/")
    return any(_all(parts, whole[:end]) for end in range(1, len(whole) + 1))


def _all(parts: list[str], path: list[str]) -> bool:
    if not parts:
        return not path
    if parts == ["**"]:
        return bool(path)
    if parts[0] == "**":
        return any(_all(parts[1:], path[begin:]) for begin in range(len(path) + 1))
    return bool(path) and _one(parts[0], path[0]) and _all(parts[1:], path[1:])


def _one(part: str, name: str) -> bool:
    if not part:
        return not name
    if part[0] == "*":
        return any(_one(part[1:], name[begin:]) for begin in range(len(name) + 1))
    return bool(name) and part[0] in (name[0], "?") and _one(part[1:], name[1:])


@given(_PATTERN, _PATH)
def test_pattern_agrees_with_the_naive_matcher(pattern: str, path: str) -> None:
    assert matches(pattern, path) == naive(pattern, path)


@pytest.mark.parametrize("pattern", ["/", "./", "//", ""])
def test_empty_pattern_matches_nothing(pattern: str) -> None:
    assert not matches(pattern, "a/b")


@rows(
    ("pattern", "path"),
    [
        ("/".join(repeat("**", 40)) + "/x", "/".join(repeat("a", 60))),
        ("**/a/" * 40 + "x", "/".join(repeat("a", 200))),
        ("*a" * 60 + "b", "a" * 250),
        ("*" * 200_000 + "b", "a" * 250),
        ("**/" * 200_000 + "b", "a/" * 250 + "a"),
        ("*a" * 200_000 + "b", "a" * 250),
    ],
    ids=["stars", "parts", "letters", "long", "deep", "both"],
)
def test_hostile_pattern_is_matched_in_time(pattern: str, path: str) -> None:
    """Full backtracking would take exponential time."""
    assert not matches(pattern, path)
