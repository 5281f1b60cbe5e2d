"""Local times of named time zones, compared minute by minute with `zoneinfo`, and the proofs about them."""

import re
from datetime import UTC, datetime, timedelta
from functools import cache
from pathlib import Path
from zoneinfo import ZoneInfo

import pytest
import tzdata
from hypothesis import given, settings
from hypothesis import strategies as st

from reference.sources import IMPORTS, LIBRARY, mission, policy
from rtshcua.decision.times import LocalTime, daily, weekly
from rtshcua.decision.values import FALSE, TRUE, UNKNOWN
from rtshcua.ground.checker import time_zones
from rtshcua.ground.language.load import load
from rtshcua.ground.lower.zones import weekly_windows
from rtshcua.ground.pipeline.program import check_program, compile_program
from rtshcua.mavlink import dialect
from rtshcua.model.flat.limits import DAY, WEEK
from virtual.rows import rows

MINUTE = 60_000_000
H = 60 * MINUTE
ZONES = ("Europe/Berlin", "America/New_York", "Australia/Lord_Howe", "Asia/Kolkata")


@cache
def on_the_wall(name: str) -> ZoneInfo:
    """Return the zone of Python, from the same package."""
    with Path(tzdata.__file__).with_name("zoneinfo").joinpath(*name.split("/")).open("rb") as data:
        return ZoneInfo.from_file(data)


def us(moment: datetime) -> int:
    return (moment - datetime(1970, 1, 1, tzinfo=UTC)) // timedelta(microseconds=1)


def utc(text: str) -> int:
    return us(datetime.fromisoformat(text).replace(tzinfo=UTC))


@cache
def nights(name: str) -> tuple[datetime, ...]:
    """Return the days of 2026 with a clock change, found day by day; one other day if there is none."""
    zone = on_the_wall(name)
    days = [datetime(2026, 1, 1, tzinfo=UTC) + timedelta(days=number) for number in range(365)]
    return tuple(
        day
        for day in days
        if day.astimezone(zone).utcoffset() != (day + timedelta(days=1)).astimezone(zone).utcoffset()
    ) or (days[100],)


@pytest.mark.slow
@pytest.mark.hypothesis
@settings(deadline=None, max_examples=12)
@given(
    st.sampled_from(ZONES), st.integers(0, 1), st.integers(0, 1439), st.integers(0, 1439),
    st.one_of(st.just(frozenset[int]()), st.frozensets(st.integers(0, 6), min_size=1)),
)  # fmt: skip
def test_window_holds_exactly_while_the_local_time_is_in_it(
    name: str, number: int, start: int, end: int, days: frozenset[int]
) -> None:
    local = LocalTime(0, time_zones.offsets(name))
    first, last = start * MINUTE, end * MINUTE
    window = weekly(weekly_windows(first, last, sorted(days)), local) if days else daily(first, last, local)
    found = nights(name)
    day = found[number % len(found)] - timedelta(days=1)
    for minute in range(3 * 1440):
        moment = day + timedelta(minutes=minute)
        wall = moment.astimezone(on_the_wall(name))
        time, today = 60 * wall.hour + wall.minute, wall.weekday()
        yesterday = (today - 1) % 7
        if start <= end:
            shown = start <= time <= end and (not days or today in days)
        else:
            shown = (time >= start and (not days or today in days)) or (time <= end and (not days or yesterday in days))
        assert window.truth(((us(moment),) * 2,), (0, 0)) == (TRUE if shown else FALSE), (moment, wall)


@rows("name", ZONES)
def test_offsets_equal_those_of_the_tzdata_package(name: str) -> None:
    local = LocalTime(0, time_zones.offsets(name))
    for hour in range(0, 3 * 8766, 5):
        moment = datetime(2025, 6, 1, 0, 30, tzinfo=UTC) + timedelta(hours=hour)
        shown = moment.astimezone(on_the_wall(name)).utcoffset()
        assert shown is not None
        assert local.offset(us(moment)) == shown // timedelta(microseconds=1)


def test_offsets_do_not_depend_on_the_present_time() -> None:
    """They depend only on the version of the data, so that compiling again produces the same bytes."""
    year = int(tzdata.IANA_VERSION[:4])
    assert time_zones.VERSION == tzdata.IANA_VERSION
    known = LocalTime(0, time_zones.offsets("Europe/Berlin")).known()
    assert known == (utc(f"{year - 1}-01-01T00:00"), utc(f"{year + 10}-01-01T00:00"))
    assert time_zones.offsets("Europe/Berlin")[:5:2] == (known[0], utc("2025-03-30T01:00"), utc("2025-10-26T01:00"))


def test_time_zones_of_the_operating_system_are_not_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("zoneinfo.TZPATH", ("/nowhere",))
    time_zones.offsets.cache_clear()
    assert len(time_zones.offsets("Asia/Kolkata")) == 3
    for outside in ("../../etc/passwd", "Europe", "", "europe/berlin"):
        with pytest.raises(KeyError):
            time_zones.offsets(outside)


@rows(
    ("start", "end", "days", "windows"),
    [
        (8 * H, 18 * H, (0,), (8 * H, 18 * H + 1)),
        (22 * H, 6 * H, (4,), (4 * DAY + 22 * H, 5 * DAY + 6 * H + 1)),
        (22 * H, 6 * H, (6,), (0, 6 * H + 1, 6 * DAY + 22 * H, WEEK)),
        (0, DAY - 1, (5, 6), (5 * DAY, WEEK)),
        (0, DAY - 1, range(7), (0, WEEK)),
        (12 * H, 12 * H - 1, (0, 1), (12 * H, 2 * DAY + 12 * H)),
        (H, H, (0,), (H, H + 1)),
    ],
)
def test_weekly_windows_hold_on_their_days(start: int, end: int, days: range, windows: tuple[int, ...]) -> None:
    assert weekly_windows(start, end, days) == windows


# ------------------------------------------------------------------------------------------------------- programs

SITE = Path(LIBRARY, "policies", "site.rts").read_text(encoding="utf-8")
AT = "47.39864 N, 8.54559 E"
FLIGHT = mission("takeoff(20 m)", f"goto({AT}, 20 m)", "return_home()")
BERLIN = 'clock "Europe/Berlin"'


def source(*parts: str, clock: str = BERLIN) -> str:
    """Return the library's site with another clock of its vehicle, followed by parts."""
    imports = IMPORTS.replace('import "lib:policies/site.rts"\n', "")
    site, count = re.subn(r"clock +utc \+02:00", clock, SITE)
    assert count == 1
    return imports + site.replace('import "lib:skills/signals.rts"', "") + "".join(parts)


def codes(text: str, issued: str | None = None) -> list[str]:
    """Return the codes found by checking a source, or by compiling it for a time of issue."""

    def read(path: str) -> bytes:
        return text.encode() if path == "probe.rts" else Path(path).read_bytes()

    loaded = load(["probe.rts"], read, LIBRARY)
    if issued is None:
        found = check_program(loaded, dialect.load())
    else:
        found = compile_program(loaded, dialect.load(), mission=None, issued_at_us=utc(issued)).diagnostics
    return [each.code.id for each in found]


@cache
def latest() -> int:
    """Return the latest begin of the goto in seconds after the issue, as stated in a finding."""
    text = source(permitting("local time in 08:00 .. 08:02"), FLIGHT)
    loaded = load(
        ["probe.rts"], lambda path: text.encode() if path == "probe.rts" else Path(path).read_bytes(), LIBRARY
    )
    (found,) = check_program(loaded, dialect.load())
    told = re.search(r"it begins up to (\d+) s after", found.message)
    assert told is not None
    return int(told[1])


def permitting(condition: str) -> str:
    return (
        "policy rules version 1 {\n  permit takeoff, hover, return_home, emergency_land by any\n"
        f"  permit goto by any when {condition}\n  contingency return_home, emergency_land\n}}\n"
    )


@rows(
    ("condition", "issued", "expected"),
    [
        ("local time in 08:00 .. 18:00", "2026-06-01T06:00", []),  # Monday, 08:00
        ("local time in 08:00 .. 18:00", "2026-12-01T06:00", ["E0718"]),  # 07:00 in winter
        ("local time in 08:00 .. 18:00", "2026-12-01T07:00", []),
        ("local time in 08:00 .. 18:00", None, []),
        ("local time in 08:00 .. 08:02", None, ["E0718"]),
        ("local time in 08:00 .. 18:00 on monday .. friday", "2026-06-05T06:00", []),  # Friday
        ("local time in 08:00 .. 18:00 on monday .. friday", "2026-06-06T06:00", ["E0718"]),
        ("local time in 08:00 .. 18:00 on monday .. friday", None, []),
        ("local time in 08:00 .. 08:02 on monday .. friday", None, ["E0718"]),
        ("local time on saturday, sunday", "2026-06-06T06:00", []),
        ("local time on saturday, sunday", "2026-06-05T06:00", ["E0718"]),
        ("local time on saturday", "2026-06-05T22:00", []),  # Saturday 00:00 in Berlin, Friday in UTC
        ("local time on saturday, sunday and local time in 08:00 .. 09:00", None, []),
        ("local time in 20:00 .. 04:00 on friday", "2026-06-06T00:00", []),  # begun on Friday
        ("local time in 20:00 .. 04:00 on friday", "2026-06-05T00:00", ["E0718"]),
        ("local time on saturday and local time in 23:55 .. 00:01 on friday", None, ["E0718"]),
        # the hour that comes twice is long enough; the one that is skipped never comes
        ("local time in 02:00 .. 02:59", "2026-10-25T00:30", []),
        ("local time in 02:00 .. 02:59", "2026-10-25T01:30", []),
        ("local time in 02:00 .. 02:59", "2026-03-29T00:59", ["E0718"]),
        ("local time in 02:00 .. 02:59", "2026-03-29T01:00", ["E0718"]),
        ("local time in 08:00 .. 18:00", "2046-06-01T08:00", ["E0703"]),  # the local time is unknown then
    ],
)
def test_step_must_be_permitted_whenever_it_may_begin(condition: str, issued: str | None, expected: list[str]) -> None:
    assert codes(source(permitting(condition), FLIGHT), issued) == expected


@rows(
    ("active", "airspace", "issued", "expected"),
    [
        ("active on saturday, sunday", "inside city outside works", "2026-06-06T06:00", ["E0508"]),
        ("active on saturday, sunday", "inside city outside works", "2026-06-05T06:00", []),
        ("active on saturday, sunday", "inside city outside works", None, []),
        ("active on monday", "inside works", None, []),
        ("active on monday", "inside works", "2026-06-01T06:00", []),
        ("active on monday", "inside works", "2026-06-02T06:00", ["E0508"]),
        ("active 08:00 .. 08:05 on monday .. sunday", "inside works", None, ["E0718"]),
        ("active 08:05 .. 08:01 on monday .. sunday", "inside city outside works", None, ["E0718"]),
        ("active 08:05 .. 08:01 on monday .. saturday", "inside city outside works", None, []),
        ("active 08:00 .. 16:00", "inside city outside works", "2026-06-01T06:00", ["E0508"]),
        ("active 08:00 .. 16:00", "inside city outside works", "2026-12-01T06:00", []),
        (
            'active on monday active "2026-01-01T00:00Z" .. "2027-01-01T00:00Z"',
            "inside city outside works", "2026-06-01T06:00", ["E0508"],
        ),
        (
            'active on monday active "2025-01-01T00:00Z" .. "2026-01-01T00:00Z"',
            "inside city outside works", "2026-06-01T06:00", [],
        ),
    ],
)  # fmt: skip
def test_zone_on_days_of_the_week_counts_at_its_times(
    active: str, airspace: str, issued: str | None, expected: list[str]
) -> None:
    works = f"zone works = circle({AT}, {30 if 'outside' in airspace else 300} m) {active}\n"
    assert codes(source(works, policy(f"airspace {airspace}"), FLIGHT), issued) == expected


@rows(
    ("clock", "days", "expected"),
    [
        ('clock "Europe/Berlin"', "on monday", []),
        ("clock utc +02:00", "on monday", []),
        ('clock "Europe/Berlni"', "on monday", ["E0518"]),
        ('clock "CEST"', "", ["E0518"]),
        ('clock "Europe/Berlin"', "on mon", ["E0101"]),
        ('clock "Europe/Berlin"', "on mondag .. friday", ["E0101"]),
    ],
)
def test_names_of_time_zones_and_days_are_checked(clock: str, days: str, expected: list[str]) -> None:
    text = source(permitting(f"local time in 08:00 .. 18:00 {days}"), FLIGHT, clock=clock)
    assert codes(text) == expected


def test_days_are_accepted_only_for_the_local_time() -> None:
    assert codes(source(permitting("battery in 10 % .. 20 % on monday"), FLIGHT)) == ["E0314"]
    for condition in ("battery on monday", "position on friday"):
        assert codes(source(permitting(condition), FLIGHT)) == ["E0101"], condition


def test_dead_rules_are_found_across_days_of_the_week() -> None:
    def of(first: str, second: str) -> list[str]:
        rules = (
            "policy rules version 1 {\n  permit goto, takeoff, hover, return_home, emergency_land by any\n"
            f"  forbid goto by any when {first}\n  forbid goto by any when {second}\n"
            "  contingency return_home, emergency_land\n}\n"
        )
        return codes(source(rules))

    assert of("local time on monday", "local time on tuesday") == []
    assert of("local time on monday", "local time in 08:00 .. 18:00 on monday") != []
    assert of("local time on monday", "local time in 22:00 .. 06:00 on monday") == []
    assert of("local time on monday .. friday", "local time on saturday, sunday and local time < 09:00") == []
    assert of("local time on monday and local time on tuesday", "local time < 09:00") != []


def test_local_time_is_unknown_outside_the_years_of_the_data() -> None:
    window = daily(8 * H, 18 * H, LocalTime(0, time_zones.offsets("Asia/Kolkata")))
    assert window.truth(((utc("2046-06-01T08:00"),) * 2,), (0, 0)) == UNKNOWN


@pytest.mark.hypothesis
@settings(deadline=None, max_examples=6)
@given(
    st.sampled_from(ZONES), st.integers(0, 1), st.integers(-90, 1530), st.integers(0, 299), st.integers(1, 200),
    st.sampled_from(["", " on saturday", " on sunday", " on saturday, sunday"]),
)  # fmt: skip
def test_issue_time_is_refused_if_the_window_closes_before_the_step(
    name: str, number: int, minute: int, start: int, length: int, days: str
) -> None:
    found = nights(name)
    issued = found[number % len(found)].replace(tzinfo=UTC) + timedelta(minutes=minute)
    end = (start + length) % 1440
    condition = f"local time in {start // 60:02}:{start % 60:02} .. {end // 60:02}:{end % 60:02}{days}"
    text = source(permitting(condition), FLIGHT, clock=f'clock "{name}"')
    refused = codes(text, issued.strftime("%Y-%m-%dT%H:%M")) != []
    # the local time changes at whole minutes, and a window includes its last minute
    looked = [
        issued + timedelta(seconds=second, microseconds=late)
        for second in range(0, latest() + 1, 15)
        for late in (0, 1)
    ]
    shown = []
    for moment in looked[:-1]:
        wall = moment.astimezone(on_the_wall(name))
        time = (60 * wall.hour + wall.minute) * 60_000_000 + wall.second * 1_000_000 + wall.microsecond
        today = wall.strftime("%A").lower()
        shown.append(start * 60_000_000 <= time <= end * 60_000_000 and (not days or today in days))
    assert refused == (not all(shown))
