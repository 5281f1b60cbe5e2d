"""The claim about a gap, and who vouches for it."""

from rtshcua.evidence.gaps import RecordGap, seconds, told
from virtual.rows import rows


@rows(
    ("gap", "words"),
    [
        (RecordGap(7, 127_560_000, 9, 8), "the key that signed record 9 and by the boundary, which signed in record 8"),
        (RecordGap(7, 127_560_000, 9), "vouched for by the key that signed record 9"),
        (RecordGap(7, 127_560_000), "not signed for yet"),
    ],
)  # fmt: skip
def test_gap_claim_names_length_and_signer(gap: RecordGap, words: str) -> None:
    claim = told(gap)
    assert claim.slug == "gap"
    assert claim.text.startswith("what happened in a gap of 127.56 s before record 7: nothing was recorded; ")
    assert words in claim.text


def test_a_time_is_never_rounded() -> None:
    told = ["0 s", "99.999 ms", "20.000001 s", "60.999999 s"]
    assert [seconds(us) for us in (0, 99_999, 20_000_001, 60_999_999)] == told
