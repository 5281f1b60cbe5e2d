"""The missions that ship, compiled and sealed as `rtshcua compile` does it."""

from functools import cache
from typing import Any

from rtshcua import library
from rtshcua.cli.sources import compile_sources
from rtshcua.simulation.config import SimulationConfig
from virtual import case

NAMES = ("short", "standard", "extended", "one_bridge")


@cache
def shipped(name: str, issued_at_us: int = case.flat.ISSUED) -> bytes:
    """The bundle of `missions/<name>.rts`, issued at a UTC time."""
    source = library.root() / "missions" / f"{name}.rts"
    compiled, _ = compile_sources([source], mission=None, issued_at_us=issued_at_us)
    assert compiled.policy is not None, compiled.diagnostics
    assert compiled.mission is not None
    return case.seal(compiled.mission, compiled.policy)


def simulated(flavour: str, **fields: Any) -> SimulationConfig:
    """A simulated vehicle that returns at the height that the policies that ship say."""
    return case.simulated(flavour, return_mm=30 * case.M, **fields)
