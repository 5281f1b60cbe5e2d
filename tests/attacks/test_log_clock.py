"""Threat: times are forged, or the clock is set back, so that old data appears fresh."""

from reference.forgery import edit, expect, flight, read, rewritten, signed, signers

LINES = flight()
EFFECT = next(number for number, line in enumerate(LINES) if read(line).get("event") == "succeeded")


def moved(number: int, field: str, by: int) -> list[bytes]:
    return [*LINES[:number], edit(LINES[number], **{field: read(LINES[number])[field] + by}), *LINES[number + 1 :]]


def test_monotonic_time_going_back() -> None:
    back = read(LINES[EFFECT - 1])["at_us"] - read(LINES[EFFECT])["at_us"] - 1
    assert expect(rewritten(moved(EFFECT, "at_us", back))) == ("clock/backwards", EFFECT)
    assert expect(signed(moved(EFFECT, "at_us", back))) == ("clock/backwards", EFFECT)


def test_monotonic_time_going_too_far() -> None:
    assert expect(signed(moved(EFFECT, "at_us", 600_000_000))) == ("clock/utc-jump", EFFECT)


def test_both_clocks_going_too_far() -> None:
    """After a silence of ten minutes the epoch should have been sealed long before."""
    far = [edit(line, **{key: read(line)[key] + 600_000_000 for key in ("at_us", "utc_us")}) for line in LINES[EFFECT:]]
    assert expect(signed([*LINES[:EFFECT], *far])) == ("seal/missing", EFFECT)


def test_utc_set_back_by_more_than_its_error() -> None:
    assert expect(signed(moved(EFFECT, "utc_us", -3_600_000_000))) == ("clock/utc-backwards", EFFECT)


def test_utc_set_back_within_its_error_is_accepted() -> None:
    """The clocks are valid, so only the seal shows that the record was edited."""
    error = read(LINES[EFFECT])["utc_error_us"]
    seal = next(number for number in signers(LINES) if number > EFFECT)
    assert error > 0
    assert expect(rewritten(moved(EFFECT, "utc_us", -error))) == ("seal/root", seal)


def test_utc_running_away_from_monotonic_time() -> None:
    """Each step is small, but their sum exceeds the stated errors."""
    fast = [edit(line, utc_us=read(line)["utc_us"] + 700 * number) for number, line in enumerate(LINES)]
    error = read(LINES[0])["utc_error_us"]
    first = next(number for number in range(len(LINES)) if 700 * number > 2 * error)
    assert expect(signed(fast)) == ("clock/utc-jump", first)


def test_a_dispatch_after_its_permit_was_over() -> None:
    number = next(n for n, line in enumerate(LINES) if read(line).get("event") == "dispatched")
    allowed_us = read(LINES[number - 1])["valid_until_us"] - read(LINES[number])["at_us"]
    later = dict.fromkeys(("at_us", "utc_us"), allowed_us + 1)
    after = [edit(line, **{key: read(line)[key] + by for key, by in later.items()}) for line in LINES[number:]]
    assert expect(signed([*LINES[:number], *after])) == ("dispatch/late", number)
