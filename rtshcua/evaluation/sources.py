"""The programs of the evaluation: three missions under one policy, whose steps all have the deadline of a point.

They ship as `lib:evaluation/`: signals, skills, a policy for a vehicle with every sensor, and missions of 3, 6 and 12
steps with the skills and the order of the missions that ship for flying. `hover` and `inspect_area`, which the
degraded cases strike, assume charge, link quality, clearance, wind and a fix.
"""

from functools import lru_cache
from pathlib import Path
from typing import Any, Final

from rtshcua import library
from rtshcua.adapters.store.source_access import ReadableSources
from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import compile_program
from rtshcua.mavlink import dialect
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.quantity import Dimension, display
from rtshcua.simulation.config import SimulationConfig
from rtshcua.virtual.fitting import fitting

#: the deadline of each step in the sources that ship, us
SHIPPED_US: Final = 1_000_000
#: the interval between two reports of the radio, us, which the signals declare
RADIO_US: Final = 100_000


def folder() -> Path:
    """The folder of what ships for the evaluation."""
    return library.root() / "evaluation"


def source(mission: str, deadline_us: int) -> str:
    """The text of a mission, `short`, `standard` or `extended`, whose steps all have this deadline.

    Raises OSError where there is no such mission.
    """
    shipped = str(library.root())
    text = ReadableSources(shipped).read(f"{shipped}/evaluation/{mission}.rts").decode("utf-8")
    return text.replace(_deadline(SHIPPED_US), _deadline(deadline_us))


@lru_cache(maxsize=64)
def compiled(mission: str, deadline_us: int, issued_at_us: int) -> tuple[Policy, Mission]:
    """The policy and the mission of a point, compiled, and issued at a UTC time in us; not bound or signed yet.

    Raises ValueError, with the findings, where a deadline cannot be met.
    """
    name, shipped = f"{mission}.rts", str(library.root())
    readable, text = ReadableSources(shipped), source(mission, deadline_us).encode("utf-8")
    program = load([name], lambda path: text if path == name else readable.read(path), shipped)
    found = compile_program(program, dialect.load(), mission=None, issued_at_us=issued_at_us)
    if found.policy is None or found.mission is None:
        raise ValueError("; ".join(f"{each.code.id}: {each.message}" for each in found.diagnostics))
    return found.policy, found.mission


def fitted(policy: Policy, **chosen: Any) -> SimulationConfig:
    """A simulated vehicle with all that the policy reads, and a radio that reports as often as its signals declare;
    `chosen` overrides fields.
    """
    return fitting(policy, **{"radio_us": RADIO_US, **chosen})


def _deadline(us: int) -> str:
    return f"{{ deadline {display(us, Dimension.DURATION)} }}"
