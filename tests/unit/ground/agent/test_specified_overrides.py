"""Overrides of a step in a specification: the same as in the language, with findings that point into the JSON."""

from collections.abc import Callable
from typing import Any

import jsonschema
import pytest

from rtshcua.diagnostics.diagnostic import Diagnostic, has_errors
from rtshcua.ground.agent.specification_schema import schema
from rtshcua.ground.pipeline.program import Compiled

Compile = Callable[[str | bytes], tuple[Compiled, tuple[Diagnostic, ...]]]
Dump = Callable[[Any], str]

ALL = {
    "deadline": "2 s",
    "valid_for": "10 min",
    "during": ["inspection"],
    "lasts_at_most": "110 s",
    "grace": "500 ms",
    "energy_at_most": "13 %",
    "require": ["battery > 40 % and velocity.down < 8 m/s"],
    "assume": ["velocity.north < 20 m/s"],
    "maintain": ["height <= 30 m", "height <= altitude + 20 m"],
    "record": ["effect"],
}
AT = "/phases/1/steps/1/overrides"


def with_overrides(good: dict[str, Any], overrides: Any) -> dict[str, Any]:
    good["phases"][1]["steps"][1]["overrides"] = overrides
    return good


def test_step_may_have_every_override(good: dict[str, Any], compile_text: Compile, dumped: Dump) -> None:
    spec = with_overrides(good, ALL)
    jsonschema.validate(spec, schema())
    compiled, found = compile_text(dumped(spec))
    assert not has_errors(found)
    assert compiled.mission is not None
    assert compiled.policy is not None
    contract = compiled.mission.invocations[2].contract
    skills = compiled.policy.contracts[compiled.mission.invocations[2].skill]
    assert (contract.deadline_us, contract.validity_us, contract.grace_us) == (2_000_000, 600_000_000, 500_000)
    assert (contract.duration_us, contract.energy) == (110_000_000, 1_300)
    own = [
        [clause.text for clause in mine[len(theirs) :]]
        for mine, theirs in (
            (contract.require, skills.require),
            (contract.assume, skills.assume),
            (contract.maintain, skills.maintain),
        )
    ]
    assert own == [
        ["battery > 40 %", "velocity.down < 8 m/s"],
        ["velocity.north < 20 m/s"],
        ["height <= 30 m", "height <= altitude + 20 m"],
    ]


def test_empty_overrides_change_nothing(good: dict[str, Any], compile_text: Compile, dumped: Dump) -> None:
    plain, _ = compile_text(dumped(good))
    for overrides in ({}, None, {"deadline": None, "require": []}):
        compiled, found = compile_text(dumped(with_overrides(good, overrides)))
        assert not has_errors(found)
        assert compiled.mission is not None
        assert plain.mission is not None
        assert compiled.mission.invocations[2].contract == plain.mission.invocations[2].contract


@pytest.mark.parametrize(
    ("overrides", "code", "at", "under"),
    [
        ({"deadline": "2 min"}, "E0617", "/deadline", "2 min"),
        ({"deadline": "2 parsecs"}, "E0301", "/deadline", "2 parsecs"),
        ({"deadline": "2 m"}, "E0310", "/deadline", "2 m"),
        ({"deadline": 2}, "E0902", "/deadline", "2"),
        ({"deadline": "2 s grace 1 s"}, "E0902", "/deadline", "2 s grace 1 s"),
        ({"deadline": "2 s } hover() {"}, "E0902", "/deadline", None),
        ({"deadline": "2 s // }"}, "E0902", "/deadline", "2 s // }"),
        ({"require": ["battery > 20 % /* x */"]}, "E0902", "/require/0", None),
        ({"dedline": "2 s"}, "E0902", "/dedline", '"dedline"'),
        ({"energy_at_most": "1 %"}, "E0617", "/energy_at_most", "1 %"),
        ({"during": ["recovery"]}, "E0617", "/during/0", '"recovery"'),
        ({"require": "battery > 20 %"}, "E0902", "/require", '"battery > 20 %"'),
        ({"require": ["battery > 20 m"]}, "E0310", "/require/0", "20 m"),
        ({"maintain": ["height <= 30 m", "batery > 20 %"]}, "E0201", "/maintain/1", "batery"),
        ({"maintain": ["position inside grow(city, -17 m)"]}, "E0622", "/maintain/0", None),
        ({"maintain": ["height <= 30 m maintain height <= 31 m"]}, "E0106", "/maintain/0", None),
        ({"maintain": ["height <= 30 m record effect"]}, "E0902", "/maintain/0", None),
        ({"maintain": [""]}, "E0101", "/maintain/0", None),
        ({"record": ["nothing"]}, "E0610", "/record/0", '"nothing"'),
    ],
)
def test_finding_points_at_the_wrong_override(
    good: dict[str, Any],
    compile_text: Compile,
    dumped: Dump,
    overrides: dict[str, Any],
    code: str,
    at: str,
    under: str | None,
) -> None:
    text = dumped(with_overrides(good, overrides))
    _, found = compile_text(text)
    assert [each.code.id for each in found] == [code]
    assert found[0].pointer == AT + at
    assert found[0].span is not None
    if under is not None:
        assert text[found[0].span.start : found[0].span.end] == under
