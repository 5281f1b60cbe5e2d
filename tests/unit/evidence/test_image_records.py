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
    MissingDetail,
    encoded,
    missing_of,
    read_image,
    read_missing,
)
from rtshcua.evidence.records import Effect, Recover
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


def test_ranges_are_joined_in_each_order() -> None:
    found = IndexSet()
    assert (found.lowest, found.highest, found.last_missing(0, 3)) == (None, None, 3)
    assert [found.add(index) for index in (5, 6, 4, 9, 8, 7, 5)] == [True] * 6 + [False]
    assert (found.lowest, found.highest, len(found)) == (4, 9, 6)
    assert list(found.gaps(2, 11)) == [(2, 3), (10, 11)]
    assert (found.last_missing(4, 9), found.last_missing(2, 9), found.last_missing(0, 20)) == (None, 3, 20)
    found.add(20)
    assert list(found.gaps(0, 9)) == [(0, 3)]


def listed(**changed: Any) -> str:
    """The list after images 0 and 2 of camera 100, changed."""
    fields = dict[str, Any](camera=100, failed=0, first=0, last=3, lost=((1, 1), (3, 3)), missing=2, series=0, taken=2)
    return encoded(MissingDetail(**(fields | changed)))


@rows(
    ("event", "detail", "code"),
    [
        (IMAGE, "no JSON", "image/malformed"),
        (IMAGE, encoded(image(index=3)).replace(":", ": ", 1), "image/malformed"),
        (IMAGE, encoded(image(index=0)), "image/twice"),
        (IMAGE, encoded(image(index=7, series=2)), "image/series"),
        (IMAGE, encoded(image(index=7, series=1)), None),
        (IMAGE, encoded(image(index=None, result=0)), None),
        (IMAGES_MISSING, "no JSON", "image/malformed"),
        (IMAGES_MISSING, listed(), None),
        (IMAGES_MISSING, listed(missing=1), "image/missing"),
        (IMAGES_MISSING, listed(last=1, lost=((1, 1),), missing=1), "image/missing"),
        (IMAGES_MISSING, listed(camera=101, lost=((0, 3),), missing=4, taken=0), None),
        ("landed", "", None),
    ],
)
def test_records_that_contradict_those_before_are_flaws(event: str, detail: str, code: str | None) -> None:
    ledger = ImageLedger()
    for index in (0, 2):
        assert ledger.check(effect(IMAGE, encoded(image(index=index)))) is None
    found = ledger.check(effect(event, detail))
    assert (None if found is None else found.slug) == code


AFTER_A_CRASH = Recover("0" * 64, 1, 0, None, "0" * 64, 0, "0" * 64, 0, "0" * 64, 0, 1, "recover", 1, 1)


@rows(
    ("details", "complete"),
    [
        ([(IMAGES_MISSING, listed())], False),
        ([(IMAGES_MISSING, listed(last=2, lost=((1, 1),), missing=1))], False),
        ([(IMAGE, encoded(image(index=1))), (IMAGES_MISSING, listed(last=2, lost=(), missing=0, taken=3))], True),
        ([(IMAGE, encoded(image(index=1)))], False),
        (
            [
                (IMAGE, encoded(image(index=1))),
                (IMAGE, encoded(image(index=None, result=0))),
                (IMAGES_MISSING, listed(last=2, lost=(), missing=0, taken=3, failed=1)),
            ],
            False,
        ),
    ],
)
def test_a_step_that_requires_all_images_needs_a_list_without_gaps(
    details: list[tuple[str, str]], complete: bool
) -> None:
    ledger = ImageLedger()
    for index in (0, 2):
        ledger.check(effect(IMAGE, encoded(image(index=index))))
    for event, detail in details:
        assert ledger.check(effect(event, detail)) is None
    assert (ledger.incomplete() is None) == complete


def test_what_is_missing_counts_failed_pictures_and_begins_anew_after_a_crash() -> None:
    ledger = ImageLedger()
    for one in (image(index=0), image(index=None, result=0), image(index=2)):
        assert ledger.check(effect(IMAGE, encoded(one))) is None
    assert (ledger.taken, ledger.failed) == (2, 1)
    told = ledger.missing(100, 0, 1, 1)
    assert (told.first, told.last, told.lost, told.failed, told.taken) == (0, 2, ((1, 1),), 1, 2)
    assert ledger.missing(101, 0, 0, 1).missing == 2
    ledger.check(AFTER_A_CRASH)
    assert ledger.incomplete() is not None, "no list of this run"
    assert ledger.check(effect(IMAGE, encoded(image(index=0)))) is None


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
