"""Threat: times are forged, or the clock is set back, so that something old looks fresh."""

from reference.forgery import edit, expect, flight, read, rewritten, signed

LINES = flight()
LAST = len(LINES) - 1
EFFECT = next(number for number, line in enumerate(LINES) if read(line).get("event") == "succeeded")


def moved(number: int, field: str, by: int) -> list[bytes]:
    return [*LINES[:number], edit(LINES[number], **{field: read(LINES[number])[field] + by}), *LINES[number + 1 :]]


def test_monotonic_time_going_back() -> None:
    back = read(LINES[EFFECT - 1])["at_us"] - read(LINES[EFFECT])["at_us"] - 1
    assert expect(rewritten(moved(EFFECT, "at_us", back))) == ("clock/backwards", EFFECT)
    assert expect(signed(moved(EFFECT, "at_us", back))) == ("clock/backwards", EFFECT)


def test_monotonic_time_going_too_far() -> None:
    assert expect(signed(moved(EFFECT, "at_us", 600_000_000))) == ("clock/backwards", EFFECT + 1)


def test_utc_set_back_by_more_than_its_error() -> None:
    assert expect(signed(moved(EFFECT, "utc_us", -3_600_000_000))) == ("clock/utc-backwards", EFFECT)


def test_utc_set_back_by_less_than_its_error_is_what_a_clock_may_do() -> None:
    error = read(LINES[EFFECT])["utc_error_us"]
    before = read(LINES[EFFECT])["utc_us"] - read(LINES[EFFECT - 1])["utc_us"]
    assert expect(rewritten(moved(EFFECT, "utc_us", -before - error))) == ("close/root", LAST)


def test_a_dispatch_after_its_permit_was_over() -> None:
    number = next(n for n, line in enumerate(LINES) if read(line).get("event") == "dispatched")
    after = [edit(line, at_us=read(line)["at_us"] + 3_600_000_000) for line in LINES[number:]]
    assert expect(signed([*LINES[:number], *after])) == ("dispatch/late", number)
