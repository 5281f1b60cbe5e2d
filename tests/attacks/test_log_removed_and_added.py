"""Threat: records are deleted, inserted, duplicated or reordered, with and without renumbering and rehashing."""

from reference.forgery import edit, expect, flight, read, rehashed, renumbered, rewritten, signed, signers
from virtual.rows import rows

LINES = flight()
LAST = len(LINES) - 1
FIRST = next(number for number, line in enumerate(LINES) if read(line)["type"] == "decision")
SENT = next(number for number, line in enumerate(LINES) if read(line).get("event") == "dispatched")
SEAL = signers(LINES)[1]


def deleted(number: int) -> list[bytes]:
    return [*LINES[:number], *LINES[number + 1 :]]


@rows("number", range(1, LAST))
def test_deleted(number: int) -> None:
    assert expect(deleted(number)) == ("chain/sequence", number)
    assert expect(rehashed(deleted(number))) == ("chain/sequence", number)
    slug, record = expect(renumbered(deleted(number)))
    assert slug == "chain/broken"
    assert record in (number - 1, number)


def test_deleted_and_rewritten_fails_at_the_signature_or_before() -> None:
    assert expect(rewritten(deleted(SENT))) == ("seal/size", SEAL - 1)
    assert expect(rewritten(deleted(FIRST))) == ("seal/size", SEAL - 1)


def test_deleted_decision_leaves_unpermitted_effect() -> None:
    assert expect(signed(deleted(FIRST))) == ("dispatch/not-permitted", SENT - 1)


def test_the_head_cut_off() -> None:
    assert expect(LINES[1:]) == ("genesis/missing", 0)
    assert expect(rewritten(LINES[1:])) == ("genesis/missing", 0)


@rows("number", range(1, LAST))
def test_duplicated(number: int) -> None:
    twice = [*LINES[: number + 1], LINES[number], *LINES[number + 1 :]]
    assert expect(twice) == ("chain/sequence", number + 1)
    assert expect(rehashed(twice)) == ("chain/sequence", number + 1)
    slug, record = expect(rewritten(twice))
    seal = next(each for each in signers(LINES) if each >= number) + 1
    named = ("seal/key", number + 1) if number in signers(LINES) else ("seal/size", seal)
    assert (slug, record) == named or slug in ("decision/consumed", "dispatch/not-permitted")


def test_a_dispatch_duplicated_by_the_key_holder_has_one_permit_for_two() -> None:
    twice = [*LINES[: SENT + 1], LINES[SENT], *LINES[SENT + 1 :]]
    assert expect(signed(twice)) == ("dispatch/not-permitted", SENT + 1)


def test_inserted() -> None:
    made_up = edit(LINES[SENT], detail="all was well", event="note")
    inserted = [*LINES[:3], made_up, *LINES[3:]]
    assert expect(inserted)[0] == "chain/sequence"
    assert expect(rehashed(inserted))[0] == "chain/sequence"
    assert expect(renumbered(inserted))[0] == "chain/broken"
    assert expect(rewritten(inserted)) == ("seal/size", SEAL + 1)


@rows("number", range(1, LAST - 1))
def test_reordered(number: int) -> None:
    swapped = list(LINES)
    swapped[number], swapped[number + 1] = swapped[number + 1], swapped[number]
    assert expect(swapped) == ("chain/sequence", number)
    assert expect(rehashed(swapped)) == ("chain/sequence", number)
    assert expect(renumbered(swapped))[0] == "chain/broken"
    slug, _ = expect(rewritten(swapped))
    assert slug in ("seal/root", "seal/size", "seal/key", "clock/backwards", "dispatch/not-permitted")


def test_a_permission_written_after_the_deed_by_the_key_holder() -> None:
    """The times are forged too, so no clock check detects it."""
    swapped = list(LINES)
    swapped[FIRST], swapped[SENT] = swapped[SENT], swapped[FIRST]
    assert expect(signed(swapped))[0] == "dispatch/not-permitted"
