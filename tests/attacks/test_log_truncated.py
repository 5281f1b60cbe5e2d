"""Threat: the end of the log is removed, within a record, between two, or completely."""

from reference.forgery import edit, expect, flight, prove, read, rewritten, signers
from rtshcua.evidence.report import LogVerdict
from virtual.rows import rows

LINES = flight()
LAST = len(LINES) - 1


@rows("count", range(1, LAST + 1))
def test_cut_between_records(count: int) -> None:
    assert expect(LINES[:count]) == ("close/missing", count)
    assert prove(LINES[:count]).report.verdict is LogVerdict.INCOMPLETE


@rows("kept", [1, 10, 40, 74, 200, -2, -1])
def test_cut_inside_a_record(kept: int) -> None:
    for number in (1, 2, LAST):
        cut = [*LINES[:number], LINES[number][: kept if kept < 0 else min(kept, len(LINES[number]) - 1)]]
        assert expect(cut) == ("tail/torn", number)
        assert prove(cut).report.verdict is LogVerdict.INCOMPLETE


def test_cut_inside_the_genesis() -> None:
    for kept in (1, 10, 500, len(LINES[0]) - 1):
        assert expect([LINES[0][:kept]]) == ("genesis/missing", 0)


def test_cut_to_nothing() -> None:
    assert expect([]) == ("log/empty", 0)


def test_cut_with_the_old_close_put_at_the_end() -> None:
    for count in range(1, LAST):
        slug = "seal/key" if count <= signers(LINES)[-2] else "seal/size"
        assert expect([*LINES[:count], LINES[-1]]) == ("chain/sequence", count)
        assert expect(rewritten([*LINES[:count], LINES[-1]])) == (slug, count)


def test_the_size_in_the_signed_text_cannot_be_changed() -> None:
    close = read(LINES[-1])
    text = close["checkpoint"].replace(f"\n{LAST}\n", f"\n{LAST - 1}\n", 1)
    cut = rewritten([*LINES[: LAST - 1], edit(LINES[-1], checkpoint=text)])
    assert expect(cut) == ("seal/signature", LAST - 1)


def test_cut_log_lists_the_close_as_unproven() -> None:
    report = prove(LINES[:-1]).report
    assert "signed-close" in [claim.slug for claim in report.unproven]
    assert "signed-close" not in [claim.slug for claim in report.proven]
