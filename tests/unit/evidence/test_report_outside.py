"""The report about witnesses: too few of them, and irrelevant notes."""

import pytest

from rtshcua.evidence.reading import may_be_torn
from rtshcua.evidence.report import LogReport, cosigned, rejected, unanchored, utc_of, with_anchors
from rtshcua.evidence.witnessing.anchors import AnchoredExtent, Witnessed


def outside(threshold: int, *sizes: int) -> AnchoredExtent:
    witnessed = tuple(Witnessed(bytes([n]) * 32, f"w{n}", size, 1) for n, size in enumerate(sizes))
    count = sizes[threshold - 1] + 1 if len(sizes) >= threshold else 0
    return AnchoredExtent(count, 10 - count, threshold, witnessed)


def test_too_few_witnesses() -> None:
    assert cosigned(outside(1, 9)) == ""
    assert cosigned(outside(2)) == ""
    assert cosigned(outside(2, 9)) == "cosigned by 1 of 2 required witnesses"
    assert cosigned(outside(3, 9, 9)) == "cosigned by 2 of 3 required witnesses"
    text = unanchored(10, 0, outside(2, 7)).text
    assert text.startswith(
        "unanchored tail: 10 records: records 0 to 7 are cosigned by 1 of 2 required witnesses; a holder"
    )
    text = unanchored(10, 5, outside(2, 9, 4)).text
    assert text.startswith("unanchored tail: 5 records: records 5 to 9 are cosigned by 1 of 2")
    assert "no witness holds them" in unanchored(10, 0, outside(2)).text
    assert "no witness holds them" in unanchored(10, 5, outside(1, 4)).text


def test_moments() -> None:
    assert utc_of(0) == "1970-01-01 00:00:00Z"
    assert utc_of(1_750_000_000) == "2025-06-15 15:06:40Z"
    assert utc_of(253_402_300_799) == "9999-12-31 23:59:59Z"
    assert utc_of(1 << 62) == f"{1 << 62} s after the Unix epoch"


def test_notes_that_say_nothing() -> None:
    report = LogReport(10, {}, None, None, None, None, 0, b"", (), ())
    for count, many in ((1, "1 note"), (2, "2 notes")):
        found = with_anchors(report, outside(1, 9)._replace(rejected=count, first="why"))
        assert found.unproven == (rejected(outside(1, 9)._replace(rejected=count, first="why")),)
        text = f"{many} of witnesses, damaged or forged and ignored: why"
        assert (found.unproven[0].slug, found.unproven[0].text) == ("anchor/signature", text)


@pytest.mark.parametrize(
    ("torn", "whole"), [(b"", True), (b"{", True), (bytes(9), True), (b"\0{", False), (b"x", False)]
)
def test_report_after_torn_record(torn: bytes, whole: bool) -> None:
    assert may_be_torn(torn, "ab" * 32) == whole
    start = b'{"_prev":"' + b"ab" * 32 + b'","at_us":'
    assert may_be_torn(start + torn, "ab" * 32)
    assert not may_be_torn(start.replace(b"ab", b"cd"), "ab" * 32)
