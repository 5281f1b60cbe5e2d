"""A flight with images as a run folder: a camera that loses pictures, and one report that never arrives."""

from collections.abc import Sequence
from functools import cache
from pathlib import Path

from reference.kept_frames import Entries, kept
from rtshcua.model import faults
from virtual import case, run_folder
from virtual.flight import Flight
from virtual.once import once
from virtual.photographer import Photographer

#: the index of the image whose report never arrives
MISSING = 3


def _fly() -> tuple[list[bytes], Entries, bytes]:
    happens = (faults.CameraLoss(0, 2_000),)
    config = case.simulated("px4", camera=True, gimbal=True, faults=happens, utc_us=1_767_225_600_000_000)
    bundle = case.seal(case.mission(case.low_steps()))
    flying = Flight(bundle, config, attested=False)
    entries = kept(flying)
    photographer = Photographer(flying, never=lambda m: m.image_index == MISSING)
    return flying.fly(photographer).lines, entries, bundle


@cache
def _flown() -> tuple[Sequence[bytes], Entries, bytes]:
    return once("imaged-flight", _fly)


def flown() -> Sequence[bytes]:
    """The lines of its log."""
    return _flown()[0]


def run_in(folder: Path) -> Path:
    """Its run folder."""
    return run_folder.folder(folder, _flown())
