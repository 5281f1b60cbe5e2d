"""Sets of indices and lists of gaps, compared with plain sets; the ledger of images with an independent one."""

import itertools
import json
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from reference.independent_images import Contradicted, Images
from rtshcua.evidence.image_records import (
    IMAGE,
    IMAGES_MISSING,
    MOST_GAPS,
    ImageDetail,
    ImageLedger,
    IndexSet,
    encoded,
    missing_of,
    read_image,
    read_missing,
)
from rtshcua.evidence.records import Effect
from virtual.rows import rows

small = st.integers(-3, 40)


@given(st.lists(small), small, small)
def test_index_set_is_a_set(values: list[int], first: int, last: int) -> None:
    found, plain = IndexSet(), set[int]()
    for value in values:
        assert found.add(value) == (value not in plain)
        plain.add(value)
        assert len(found) == len(plain)
    assert all((value in found) == (value in plain) for value in range(-4, 42))
    assert (found.lowest, found.highest) == ((min(plain), max(plain)) if plain else (None, None))
    gaps = list(found.gaps(first, last))
    assert [each for low, high in gaps for each in range(low, high + 1)] == [
        each for each in range(first, last + 1) if each not in plain
    ]
    assert all(high + 1 < low for (_, high), (low, _) in itertools.pairwise(gaps))
    assert found.last_missing(first, last) == (gaps[-1][1] if gaps else None)


def image(**changed: Any) -> ImageDetail:
    fields = dict[str, Any](
        above_home_mm=20_000, above_sea_mm=508_000, asked=0, attitude="camera", camera=100, file="IMG_1.JPG",
        horizontal_mm=900, index=0, latitude=473_977_400, longitude=85_455_900, pitch_cd=-9_000, result=1, roll_cd=0,
        series=0, unit=0, utc_us=1_700_000_000_000_000, vertical_mm=1_780, yaw_cd=100,
    )  # fmt: skip
    return ImageDetail(**(fields | changed))


def effect(event: str, detail: str) -> Effect:
    return Effect("0" * 64, 1, detail, 1, event, -1, -1, 1, -1, -1, "effect", 1, 1)


def test_details_are_canonical_and_read_back() -> None:
    for one in (image(), image(index=None, result=0, latitude=None, file="")):
        text = encoded(one)
        assert text == json.dumps(json.loads(text), separators=(",", ":"), sort_keys=True)
        assert len(text) < 512
        assert read_image(text) == one
    assert read_image(encoded(image(index=None))) is None
    seen = IndexSet()
    for index in range(0, 200, 2):
        seen.add(index)
    many = missing_of(100, 0, seen, 0, 199, 3)
    assert (many.missing, len(many.lost), many.taken, many.failed) == (100, MOST_GAPS, 100, 3)
    assert read_missing(encoded(many)) == many


@st.composite
def histories(draw: st.DrawFn) -> list[tuple[str, str]]:
    """Records about images, mostly consistent."""
    records, ledger, series = list[tuple[str, str]](), ImageLedger(), 0
    for _ in range(draw(st.integers(0, 12))):
        what = draw(
            st.sampled_from(("image", "image", "image", "failed", "restart", "list", "odd list", "restart odd"))
        )
        series += {"restart": 1, "restart odd": draw(st.integers(-1, 2))}.get(what, 0)
        if "list" in what:
            told = ledger.missing(100, series, draw(st.integers(0, 2)), draw(st.integers(-1, 6)))
            if what == "odd list":
                told = missing_of(100, series, IndexSet(), draw(st.integers(0, 3)), draw(st.integers(0, 6)), 0)
            records.append((IMAGES_MISSING, encoded(told)))
        else:
            index = None if what == "failed" else draw(st.integers(0, 6))
            text = encoded(image(index=index, result=0 if index is None else 1, series=max(series, 0)))
            ledger.add(text)
            records.append((IMAGE, text))
    return records


@given(histories())
def test_the_ledger_and_an_independent_one_judge_alike(records: list[tuple[str, str]]) -> None:
    ledger, other = ImageLedger(), Images()
    for event, detail in records:
        record = effect(event, detail)
        flaw, contradicted = ledger.check(record), False
        try:
            other.line({"type": "effect", "event": event, "detail": detail})
        except Contradicted:
            contradicted = True
        assert (flaw is not None) == contradicted, (flaw, detail)
        if flaw is not None:
            return


@rows(
    ("told", "complete"),
    [
        ([], False),
        ([0, 1], False),
        ([0, 1, "list"], True),
        ([0, 2, "list"], False),
        ([0, 2, "list", 1], False),
        ([0, 2, "list", 1, "list"], True),
        ([0, None, "list"], False),
        ([0, "list", None], False),
    ],
)
def test_images_are_complete_only_by_a_list_that_is_up_to_date(told: list[int | str | None], complete: bool) -> None:
    ledger = ImageLedger()
    for each in told:
        if each == "list":
            record = effect(IMAGES_MISSING, encoded(ledger.missing(100, 0, 0, 0)))
        else:
            record = effect(IMAGE, encoded(image(index=each, result=0 if each is None else 1)))
        assert ledger.check(record) is None
    found = ledger.incomplete()
    assert (found is None) == complete
    assert found is None or found.slug == "image/incomplete"


def test_other_effects_are_nothing_to_the_ledger() -> None:
    ledger = ImageLedger()
    assert ledger.check(effect("said", "{}")) is None
    assert (ledger.taken, ledger.failed) == (0, 0)
