"""Records about images, forged by a holder of the log's keys: images that are counted twice, left out or invented."""

import json
from collections.abc import Callable
from functools import cache
from typing import Any

import pytest

from reference.forgery import edit, prove, read, signed
from rtshcua.simulation.config import SimulationConfig
from virtual import case
from virtual.flight import Flight
from virtual.once import once
from virtual.photographer import Photographer


def _fly() -> list[bytes]:
    config: SimulationConfig = case.simulated("px4", camera=True, utc_us=1_700_000_000_000_000)
    flying = Flight(case.seal(case.mission(case.low_steps())), config, attested=False)
    return flying.fly(Photographer(flying, never=lambda m: m.image_index == 3)).lines


@cache
def flown() -> tuple[bytes, ...]:
    return tuple(once("images-forged", _fly))


def where(event: str) -> list[int]:
    return [at for at, line in enumerate(flown()) if read(line).get("event") == event]


def found(lines: list[bytes]) -> str | None:
    """The slug of what the audit finds in lines that are signed anew; the independent verifier agrees."""
    failure = prove(signed(lines)).report.failure
    return None if failure is None else failure.slug


def detail(at: int, **changed: Any) -> bytes:
    """A record with other values in its detail."""
    now = {**json.loads(read(flown()[at])["detail"]), **changed}
    return edit(flown()[at], detail=json.dumps(now, separators=(",", ":"), sort_keys=True))


def replaced(at: int, line: bytes) -> list[bytes]:
    return [*flown()[:at], line, *flown()[at + 1 :]]


def test_the_log_as_it_was_written_verifies() -> None:
    assert found(list(flown())) is None
    assert len(where("image")) > 10
    assert json.loads(read(flown()[where("images-missing")[-1]])["detail"])["lost"] == [[3, 3]]


def test_an_image_that_is_left_out_contradicts_the_list_of_missing_ones() -> None:
    for at in (where("image")[0], where("image")[5]):
        assert found([*flown()[:at], *flown()[at + 1 :]]) == "image/missing"


def test_an_image_that_is_recorded_again_is_found() -> None:
    at = where("image")[4]
    assert found([*flown()[: at + 1], flown()[at], *flown()[at + 1 :]]) == "image/twice"


def test_an_image_that_is_invented_contradicts_the_list_of_missing_ones() -> None:
    at = where("image")[4]
    assert found([*flown()[: at + 1], detail(at, index=3), *flown()[at + 1 :]]) == "image/missing"
    assert found(replaced(at, detail(at, index=3))) == "image/missing"


def test_a_series_out_of_turn_is_found() -> None:
    first = where("image")[0]
    for series in (1, 7):
        assert found(replaced(first, detail(first, series=series))) == "image/series"


@pytest.mark.parametrize(
    "changed",
    [
        {"lost": []}, {"lost": [[3, 4]]}, {"lost": [[2, 2]]}, {"missing": 0}, {"missing": 2}, {"taken": 1},
        {"failed": 1}, {"first": 1}, {"last": 2}, {"last": 100}, {"camera": 101}, {"series": 1},
    ],
    ids=str,
)  # fmt: skip
def test_an_edited_list_of_missing_images_is_found(changed: dict[str, Any]) -> None:
    at = where("images-missing")[-1]
    assert found(replaced(at, detail(at, **changed))) == "image/missing"


MALFORMED: list[Callable[[dict[str, Any]], object]] = [
    lambda d: {**d, "more": 1},
    lambda d: {name: value for name, value in d.items() if name != "unit"},
    lambda d: {**d, "index": -1},
    lambda d: {**d, "index": None},
    lambda d: {**d, "index": 2**53},
    lambda d: {**d, "index": 3.0},
    lambda d: {**d, "index": "3"},
    lambda d: {**d, "index": True},
    lambda d: {**d, "result": 0},
    lambda d: {**d, "result": 2},
    lambda d: {**d, "attitude": "nobody"},
    lambda d: {**d, "attitude": None},
    lambda d: {**d, "camera": None},
    lambda d: {**d, "file": "../a b"},
    lambda d: {**d, "file": "a" * 65},
    lambda d: {**d, "file": "a\n"},
    lambda d: {**d, "latitude": 1.5},
    lambda d: {**d, "horizontal_mm": -1},
    lambda d: [d],
]


@pytest.mark.parametrize("number", range(len(MALFORMED)))
def test_a_malformed_record_of_an_image_is_found(number: int) -> None:
    at = where("image")[2]
    now = MALFORMED[number](json.loads(read(flown()[at])["detail"]))
    text = json.dumps(now, separators=(",", ":"), sort_keys=True)
    assert found(replaced(at, edit(flown()[at], detail=text))) == "image/malformed"


@pytest.mark.parametrize("spaced", ["{} ", " {}", "\n{}", "{}x", ""])
def test_a_record_of_an_image_that_is_not_canonical_is_found(spaced: str) -> None:
    at = where("image")[2]
    text = spaced.format(read(flown()[at])["detail"])
    assert found(replaced(at, edit(flown()[at], detail=text))) == "image/malformed"
    gaps = where("images-missing")[0]
    text = spaced.format(read(flown()[gaps])["detail"])
    assert found(replaced(gaps, edit(flown()[gaps], detail=text))) == "image/malformed"


def test_an_edit_without_keys_breaks_the_chain() -> None:
    at = where("image")[2]
    failure = prove(replaced(at, detail(at, latitude=1))).report.failure
    assert failure is not None
    assert failure.slug == "chain/broken"
