"""`--wind` takes units as `--fault wind` does."""

import pytest
import typer

from rtshcua.front.cli.options.flight_options import _wind as wind


@pytest.mark.parametrize(
    ("written", "taken"),
    [
        ("6,270,2", "6,270,2"),
        ("6m/s,270deg,2m/s", "6,270,2"),
        ("6m/s,270deg", "6,270,0"),
        ("2500mm/s,90", "2.5,90,0"),
        ("0.5,0", "0.5,0,0"),
        (None, None),
    ],
)
def test_with_and_without_units(written: str | None, taken: str | None) -> None:
    assert wind(written) == taken


@pytest.mark.parametrize("written", ["strong", "6", "6,270,2,1", "-6,270", "6deg,270", "6m/s,west", "6,270,", "6,inf"])
def test_invalid_wind_is_refused(written: str) -> None:
    with pytest.raises(typer.BadParameter, match="as in 6m/s,270deg,2m/s"):
        wind(written)
