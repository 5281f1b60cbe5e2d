"""The shipped missions, compiled and sealed as `rtshcua compile` does."""

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from rtshcua import library
from rtshcua.app.programs import compile_sources
from rtshcua.simulation.config import SimulationConfig
from virtual import case

NAMES = ("short", "standard", "extended", "one_bridge")


@cache
def shipped(name: str, issued_at_us: int = case.flat.ISSUED) -> bytes:
    """The bundle of `missions/<name>.rts`, issued at a UTC time: for a stock copter."""
    return sealed(library.root() / "missions" / f"{name}.rts", issued_at_us)


@cache
def equipped(name: str) -> bytes:
    """Return the same bundle for a copter with all equipment."""
    text = (library.root() / "missions" / f"{name}.rts").read_text(encoding="utf-8")
    with TemporaryDirectory() as folder:
        source = Path(folder) / f"{name}.rts"
        source.write_text(text.replace(" on quad ", " on surveyor "), encoding="utf-8")
        return sealed(source)


def sealed(source: Path, issued_at_us: int = case.flat.ISSUED) -> bytes:
    """The bundle of the mission in a file."""
    compiled, _ = compile_sources([source], mission=None, issued_at_us=issued_at_us)
    assert compiled.policy is not None, compiled.diagnostics
    assert compiled.mission is not None
    return case.seal(compiled.mission, compiled.policy)


def simulated(flavour: str, **fields: Any) -> SimulationConfig:
    """Return a simulated vehicle with the return height of the shipped policies."""
    return case.simulated(flavour, return_mm=30 * case.M, **fields)
