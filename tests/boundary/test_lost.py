"""The boundary is lost in flight: what was signed ahead brings the vehicle down, as a fallback by the boundary does."""

import ctypes
from typing import Any

import pytest

from boundary.losing import KEY, Apart, S, to_and_fro
from rtshcua.onboard.ports import Ending
from virtual import case

FLAVOURS = ("px4", "ardupilot")
KEYS = (KEY, None)


def config(flavour: str, key: bytes | None, **more: Any) -> Any:
    return case.simulated(flavour, signing_key=key, utc_us=case.flat.ISSUED + 60 * S, **more)


@pytest.mark.parametrize("key", KEYS, ids=("signed", "keyless"))
@pytest.mark.parametrize("flavour", FLAVOURS)
def test_ten_minutes_after_takeoff(
    flavour: str, key: bytes | None, boundary: ctypes.CDLL, monkeypatch: pytest.MonkeyPatch
) -> None:
    bundle = case.seal(case.mission(to_and_fro(80)))
    apart = Apart(boundary, monkeypatch, bundle, config(flavour, key, hover_us=40 * 60 * S), key)
    took_off: list[int] = []

    def dies(apart: Apart) -> bool:
        if apart.vehicle.simulation.truth().in_air and not took_off:
            took_off.append(apart.flight.clock.elapsed_us)
        return bool(took_off) and apart.flight.clock.elapsed_us - took_off[0] >= 600 * S

    flown = apart.fly(dies)
    assert apart.lost_us is not None
    assert flown.ending is Ending.ABORTED
    assert not flown.vehicle.simulation.truth().in_air
