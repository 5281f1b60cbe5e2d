"""A flight with images as a run folder: a camera that loses pictures, and reports that never arrive."""

from functools import cache
from pathlib import Path

from rtshcua.model import faults
from virtual import case
from virtual.flight import Flight
from virtual.once import once
from virtual.photographer import Photographer

#: the index of the image whose report never arrives
MISSING = 3


def _fly() -> list[bytes]:
    happens = (faults.CameraLoss(0, 2_000),)
    config = case.simulated(
        "px4", camera=True, gimbal=True, faults=happens, utc_us=1_767_225_600_000_000
    )  # fmt: skip
    flying = Flight(case.seal(case.mission(case.low_steps())), config, attested=False)
    return flying.fly(Photographer(flying, never=lambda m: m.image_index == MISSING)).lines


@cache
def flown() -> tuple[bytes, ...]:
    """The lines of its log."""
    return tuple(once("imaged-flight", _fly))


def run_in(folder: Path) -> Path:
    """Its run folder, without telemetry."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "log.jsonl").write_bytes(b"".join(flown()))
    return folder
