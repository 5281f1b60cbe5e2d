"""Threat: epochs are left unsealed, sealed by another key, removed, emptied or exchanged, to hide something.

systemd's journal allowed the owner of a captured machine to continue after an unsealed epoch (CVE-2023-31438), and
to seal old entries with a later key (CVE-2023-31439).
"""

from collections.abc import Callable

import pytest

from reference.forgery import (
    as_log_key,
    by_one_key,
    edit,
    expect,
    flight,
    prove,
    public_of,
    read,
    seed_of,
    signed,
    signers,
)
from reference.log_vectors import close, effect, genesis, line_of, log, seal
from reference.resealing import note_of, resealed
from reference.verifiers import careful
from rtshcua.evidence.report import LogVerdict
from rtshcua.wire.keys import Duty, SigningKey
from virtual import case
from virtual.rows import rows

LINES = flight()
SIGNED = signers(LINES)
FIRST, SECOND, EMPTY = SIGNED[1], SIGNED[2], SIGNED[4]
LAST = len(LINES) - 1


def without(*numbers: int) -> list[bytes]:
    return [line for number, line in enumerate(LINES) if number not in numbers]


def test_the_flight_has_full_and_empty_epochs() -> None:
    assert read(LINES[FIRST])["records"] > 1
    assert read(LINES[EMPTY])["records"] == 1
    assert all(read(LINES[number])["type"] == "seal" for number in (FIRST, SECOND, EMPTY))


def test_a_seal_taken_out() -> None:
    for number in SIGNED[1:-1]:
        assert expect(resealed(without(number), seed_of, keep=("checkpoint",)))[0] in ("seal/key", "seal/missing")


def test_all_seals_taken_out_by_the_key_holder() -> None:
    """A holder of all keys rewrites the log, but still cannot leave records unsealed for longer than 20 s."""
    bare = signed(without(*SIGNED[1:-1]))
    first = next(n for n, line in enumerate(bare) if read(line)["at_us"] > read(bare[0])["at_us"] + 20_000_000)
    assert read(bare[first])["type"] != "close"
    assert expect(bare) == ("seal/missing", first)


def test_empty_epochs_taken_out_by_the_key_holder() -> None:
    """The vehicle hovered for a minute: a seal every ten seconds shows that nothing happened."""
    empty = [number for number in SIGNED[1:-1] if read(LINES[number])["records"] == 1]
    assert len(empty) > 2
    found = expect(signed(without(*empty)))
    assert found[0] == "seal/missing"
    assert "seal" not in read(LINES[empty[0]])["checkpoint"]


@pytest.mark.parametrize(("count", "whole"), [(2_048, True), (2_049, False)])
def test_the_most_records_of_an_epoch(count: int, whole: bool) -> None:
    lines = log(genesis(), *(effect(number) for number in range(count)), close(3_000))
    report = careful(b"".join(lines)).report
    assert (report.failure is None) is whole
    assert whole or expect(lines) == ("seal/missing", 2_049)


@pytest.mark.parametrize(("ms", "whole"), [(20_000, True), (20_001, False)])
def test_the_longest_time_of_an_epoch(ms: int, whole: bool) -> None:
    lines = log(genesis(), effect(ms), close(99_000))
    report = careful(b"".join(lines)).report
    assert (report.verdict is LogVerdict.VERIFIED) is whole
    assert whole or expect(lines) == ("seal/missing", 1)


def test_resealed_with_a_later_key() -> None:
    """The thief knows the key of that epoch, and seals an earlier one with it."""
    origin = read(LINES[0])["checkpoint"].partition("\n")[0]
    for number in SIGNED[1:-1]:
        for later in SIGNED[SIGNED.index(number) : -1]:
            key = seed_of(read(LINES[later])["next_key"])
            fields = read(LINES[number])
            forged = note_of(origin, fields["checkpoint"].partition("\n\n")[0] + "\n", key)
            sealed = [*LINES[:number], edit(LINES[number], checkpoint=forged), *LINES[number + 1 :]]
            assert expect(sealed) == ("seal/key", number)


def test_sealed_by_the_log_key() -> None:
    """The log key signs the genesis and recoveries, but no epoch."""
    forged = by_one_key(LINES, seed_of(read(LINES[0])["log_key"]))
    assert expect(forged) == ("seal/key", FIRST)


def test_another_key_named_for_what_follows() -> None:
    """The signature of a seal covers the next key, so the thief's key cannot be named in it."""
    thief = public_of(b"\x66" * 32).hex()
    swapped = [*LINES[:FIRST], edit(LINES[FIRST], next_key=thief), *LINES[FIRST + 1 :]]
    assert expect(swapped) == ("seal/self", FIRST)
    keys: Callable[[str], bytes] = lambda public: b"\x66" * 32 if public == thief else seed_of(public)  # noqa: E731
    resigned = resealed(swapped, keys)
    assert prove(resigned).report.verdict is LogVerdict.VERIFIED, (
        "the holder of the epoch's key may choose the next one"
    )
    named = read(LINES[FIRST])["checkpoint"].split("\n")[4]
    lying = resealed(
        swapped, keys, text=lambda n, text: text.replace(text.split("\n")[4], named) if n == FIRST else text
    )
    assert expect(lying) == ("seal/next-key", FIRST)


def test_invalid_epoch_key_is_rejected() -> None:
    """Some 32 octets are not a point of the curve, and a point of small order matches many signatures."""
    for key in ("00" * 32, "01" + "00" * 31, "ff" * 32, "ec" + "ff" * 30 + "7f"):
        odd = [edit(LINES[0], next_key=key), *LINES[1:]]
        assert expect(signed(odd))[0] in ("seal/key", "seal/signature")


def test_a_signature_stripped_from_any_signed_record() -> None:
    for number in SIGNED:
        note = read(LINES[number])["checkpoint"]
        for left in (None, "", note.partition("\n\n")[0] + "\n\n", note.rstrip("\n"), note + note.split("\n\n")[1]):
            stripped = [*LINES[:number], edit(LINES[number], checkpoint=left), *LINES[number + 1 :]]
            assert expect(stripped) == ("seal/note", number)


@rows(
    ("change", "slug"),
    [
        (lambda n, text: text.replace(f"\n{n}\n", f"\n{n + 1}\n"), "seal/size"),
        (lambda n, text: text.replace(f"\n{n}\n", f"\n0{n}\n"), "seal/note"),
        (lambda n, text: text.replace(f"\n{n}\n", f"\n{n} \n"), "seal/note"),
        (lambda n, text: text.replace(text.split("\n")[2], text.split("\n")[3][7:]), "seal/root"),
        (lambda n, text: text.replace(text.split("\n")[3][7:], text.split("\n")[2]), "seal/self"),
        (lambda n, text: text + "more\n", "seal/note"),
        (lambda n, text: text.replace(f"{text.split(chr(10))[4]}\n", ""), "seal/next-key"),
        (lambda n, text: text.rpartition("after ")[0], "seal/after"),
        (lambda n, text: f"{text.rpartition('after ')[0]}after {'A' * 43}=\n", "seal/after"),
        (lambda n, text: text.replace("quad-07", "quad-08"), "seal/note"),
    ],
)
def test_another_text_signed_by_the_key_holder(change: Callable[[int, str], str], slug: str) -> None:
    lines = resealed(LINES, seed_of, text=lambda n, text: change(n, text) if n == SECOND else text)
    assert expect(lines) == (slug, SECOND)


def test_a_close_that_names_a_key() -> None:
    key = f"\nkey {'A' * 43}=\nafter "
    lines = resealed(LINES, seed_of, text=lambda n, text: text.replace("\nafter ", key) if n == LAST else text)
    assert expect(lines) == ("seal/next-key", LAST)


def test_two_epochs_exchanged() -> None:
    one, two = LINES[FIRST + 1 : SECOND + 1], LINES[SECOND + 1 : SIGNED[3] + 1]
    swapped = [*LINES[: FIRST + 1], *two, *one, *LINES[SIGNED[3] + 1 :]]
    assert expect(swapped)[0] == "chain/sequence"
    assert expect(resealed(swapped, seed_of, keep=("checkpoint",)))[0] in ("clock/backwards", "seal/key", "seal/size")


def test_an_epoch_taken_out_whole() -> None:
    cut = [*LINES[: FIRST + 1], *LINES[SECOND + 1 :]]
    assert expect(cut) == ("chain/sequence", FIRST + 1)
    assert expect(resealed(cut, seed_of, keep=("checkpoint",))) == ("seal/key", SIGNED[3] - (SECOND - FIRST))


def test_an_epoch_put_in_twice() -> None:
    twice = [*LINES[: SECOND + 1], *LINES[FIRST + 1 : SECOND + 1], *LINES[SECOND + 1 :]]
    assert expect(twice) == ("chain/sequence", SECOND + 1)


def test_a_key_of_another_duty() -> None:
    """A key that the trust root names for something else begins no log."""
    for duty in (Duty.MISSION, Duty.POLICY, Duty.ROOT):
        key = SigningKey(Duty.LOG, True, case.KEYS[duty].private)
        assert expect(signed(as_log_key(LINES, key), key)) == ("trust/log-key", 0)


def test_seals_alone() -> None:
    lines = log(genesis(), seal(10, 1), seal(20, 2), seal(20, 3), close(30))
    assert careful(b"".join(lines)).report.verdict is LogVerdict.VERIFIED
    assert [read(line)["records"] for line in lines[1:]] == [1, 1, 1, 1]
    assert line_of(read(lines[1])) == lines[1]
