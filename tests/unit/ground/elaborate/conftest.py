"""Helpers of the elaboration's tests: compile a text with the shipped library."""

from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from rtshcua.ground.elaborate.parameters import parse_settings
from rtshcua.ground.language.load import Program, load
from rtshcua.ground.pipeline.program import Checked, Compiled, compile_program, examine_program
from rtshcua.mavlink import dialect

CHECKOUT = Path(__file__).resolve().parents[4]

SKILLS = "".join(
    f'import "lib:skills/{name}.rts"\n'
    for name in ("takeoff", "hover", "goto", "inspect_area", "return_home", "emergency_land")
)
SITE = 'import "lib:policies/site.rts"\n' + SKILLS


def program_of(text: str) -> Program:
    def read(name: str) -> bytes:
        return text.encode() if name == "x.rts" else Path(name).read_bytes()

    return load(["x.rts"], read, str(CHECKOUT))


Compile = Callable[..., Compiled]
Check = Callable[[str], Checked]


@pytest.fixture
def compile_text() -> Compile:
    """Compile the one mission of a text, with values for its parameters; the site and the skills are imported."""

    def run(text: str, values: Sequence[str] = ()) -> Compiled:
        settings = parse_settings(values)
        return compile_program(program_of(text), dialect.load(), mission=None, issued_at_us=0, settings=settings)

    return run


@pytest.fixture
def check_text() -> Check:
    """Check a text."""
    return lambda text: examine_program(program_of(text), dialect.load())


@pytest.fixture
def site() -> str:
    """Imports of the shipped site and of all skills."""
    return SITE
