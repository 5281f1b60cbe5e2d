"""A default must have the parameter's type and be in its range, ends included."""

from reference.sources import found, program, skill
from virtual.rows import rows


@rows(
    ("parameter", "codes"),
    [
        ("top: altitude in 5 m .. 30 m = 5 m", []),
        ("top: altitude in 5 m .. 30 m = 30 m", []),
        ("top: altitude in 5 m .. 30 m = 4999 mm", ["E0605"]),
        ("top: altitude in 5 m .. 30 m = 30001 mm", ["E0605"]),
        ("top: altitude in 5 m .. 30 m = 5 s", ["E0310"]),
        ("side: one of left, right = left", []),
        ("side: one of left, right = up", ["E0313"]),
    ],
)
def test_default_must_fit_its_parameter(parameter: str, codes: list[str]) -> None:
    assert [code for code, _ in found(program(skill(f"probe({parameter})")))] == codes
