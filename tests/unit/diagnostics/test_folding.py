"""Findings on one missing name are merged."""

from dataclasses import replace

from rtshcua.diagnostics.codes import SYNTAX, UNKNOWN_NAME, UNKNOWN_ROLE
from rtshcua.diagnostics.diagnostic import Diagnostic, folded
from rtshcua.diagnostics.span import Span


def finding(
    at: int, message: str = "`fly` is not declared; expected a skill", code: object = UNKNOWN_NAME
) -> Diagnostic:
    return Diagnostic(code, message, Span("a.rts", at, at + 1))  # type: ignore[arg-type]


def test_findings_on_one_missing_name_are_merged_with_a_count() -> None:
    found = folded([finding(1), finding(9, "the role `b` is not declared", UNKNOWN_ROLE), *map(finding, range(20, 29))])
    assert [each.message for each in found] == [
        "`fly` is not declared; expected a skill (10 places)",
        "the role `b` is not declared",
    ]
    assert [label.span.start for label in found[0].labels] == [20, 21, 22]


def test_other_findings_are_not_merged() -> None:
    apart = (
        finding(1),
        finding(2, "`fry` is not declared; expected a skill"), finding(3, "x", SYNTAX), finding(4, "x", SYNTAX),
        replace(finding(5), pointer="/phases/0"), replace(finding(6), pointer="/phases/1"),
        replace(finding(7), span=None),
    )  # fmt: skip
    assert folded(apart) == apart
