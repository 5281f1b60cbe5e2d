"""Queries of an archive: shipped queries match the log lines, conditions narrow them, and all are read-only."""

from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from reference import generated_logs
from reference.archived import SKILLS, records, refused
from reference.generated_logs import BEGUN_US
from rtshcua.adapters.archive import index
from rtshcua.adapters.archive.adding import Done
from rtshcua.adapters.archive.asking import ArchiveReader, DecisionQuery, canned
from rtshcua.adapters.archive.folder import ArchiveFolder
from rtshcua.wire.untrusted import Untrusted

Add = Callable[..., list[Done]]
UTC, VEHICLE, SKILL, OUTCOME, REASON, CLAUSE, VERSION, SEQ = range(8)


@pytest.fixture(scope="module")
def asker(filled: ArchiveFolder) -> Iterator[ArchiveReader]:
    asker = ArchiveReader(filled)
    yield asker
    asker.close()


@pytest.fixture(scope="session")
def wanted(fleet: Path) -> list[tuple[object, ...]]:
    """Every refusal of the fleet, collected without the archive."""
    return refused(fleet.glob("*.jsonl"))


def rows(folder: ArchiveFolder, name: str, **conditions: object) -> list[tuple[object, ...]]:
    asker = ArchiveReader(folder, DecisionQuery(**conditions))  # type: ignore[arg-type]
    try:
        return list(asker.ask(canned()[name].sql).rows)
    finally:
        asker.close()


@pytest.mark.slow
@pytest.mark.parametrize("name", canned())
def test_shipped_queries_describe_themselves_and_run(name: str, asker: ArchiveReader) -> None:
    question = canned()[name]
    assert len(question.tells) > 20
    assert not question.tells.startswith("--")
    assert asker.ask(question.sql).columns


def test_refusals_are_counted_by_vehicle_skill_and_reason(
    wanted: list[tuple[object, ...]], filled: ArchiveFolder
) -> None:
    found = rows(filled, "refused-by-vehicle")
    keys = [(row[0], row[2], row[3], row[4], row[5]) for row in found]
    counts = Counter((each[VEHICLE], each[VERSION], each[SKILL], each[OUTCOME], each[REASON]) for each in wanted)
    assert {key: row[6] for key, row in zip(keys, found, strict=True)} == counts
    assert [row[6] for row in found] == sorted((row[6] for row in found), reverse=True)
    first = found[0]
    times = [
        each[UTC]
        for each in wanted
        if (each[VEHICLE], each[VERSION], each[SKILL], each[OUTCOME], each[REASON]) == keys[0]
    ]
    assert (first[8], first[9]) == (min(times), max(times))


@pytest.mark.slow
def test_by_skill_reason_clause_rule_and_day(
    wanted: list[tuple[object, ...]], filled: ArchiveFolder, fleet: Path
) -> None:
    decisions = [r for log in fleet.glob("*.jsonl") for r in records(log) if r["type"] == "decision"]
    by_skill = {row[0]: (row[1], row[2]) for row in rows(filled, "refused-by-skill")}
    asked, no = Counter(SKILLS[r["step"]] for r in decisions), Counter(each[SKILL] for each in wanted)
    assert by_skill == {skill: (asked[skill], no[skill]) for skill in SKILLS}
    by_reason = {(row[0], row[1]): row[2] for row in rows(filled, "refused-by-reason")}
    assert by_reason == Counter((each[OUTCOME], each[REASON]) for each in wanted)
    by_clause = {(row[1], row[2]): row[4] for row in rows(filled, "refused-by-clause")}
    assert by_clause == Counter((each[VERSION], each[CLAUSE]) for each in wanted if each[CLAUSE] is not None)
    by_rule = {(row[1], row[2]): row[3] for row in rows(filled, "refused-by-rule")}
    assert by_rule == Counter((str(each[REASON]).partition("/")[0], each[OUTCOME]) for each in wanted)
    by_day = rows(filled, "refused-by-day")
    assert sum(row[2] for row in by_day) == len(wanted)  # type: ignore[misc]
    assert by_day[0][0] == "2025-06-15"


def test_policies(filled: ArchiveFolder) -> None:
    found = rows(filled, "policies")
    assert [row[:4] for row in found] == [("bridge_inspection", 7, 2, 4), ("bridge_inspection", 8, 1, 1)]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("conditions", "holds"),
    [
        ({"vehicle": "quad-08"}, lambda r: r[VEHICLE] == "quad-08"),
        ({"skill": "goto"}, lambda r: r[SKILL] == "goto"),
        ({"outcome": "defer"}, lambda r: r[OUTCOME] == "defer"),
        ({"reason": "state/violated"}, lambda r: r[REASON] == "state/violated"),
        ({"reason": "state"}, lambda r: r[REASON].startswith("state/")),
        ({"reason": "stat"}, lambda r: False),
        ({"rule": "safety"}, lambda r: r[REASON].startswith("safety/")),
        ({"clause": "battery"}, lambda r: r[CLAUSE] is not None and "battery" in r[CLAUSE]),
        ({"policy": "bridge_inspection", "policy_version": 8}, lambda r: r[VERSION] == 8),
        ({"policy": "other"}, lambda r: False),
        ({"since": BEGUN_US + 3_600_000_000}, lambda r: r[UTC] >= BEGUN_US + 3_600_000_000),
        ({"until": BEGUN_US + 400_000}, lambda r: r[UTC] < BEGUN_US + 400_000),
        ({"mission": "inspect_bridge_a", "skill": "takeoff"}, lambda r: r[SKILL] == "takeoff"),
        ({"witness": "witnessed"}, lambda r: False),
        ({"vehicle": "quad-08' OR 'a' = 'a"}, lambda r: False),
    ],
)  # fmt: skip
def test_conditions(
    conditions: dict[str, object], holds: Callable[..., bool], wanted: list[tuple[object, ...]], filled: ArchiveFolder
) -> None:
    found = rows(filled, "refused", **conditions)
    assert sorted((row[0], row[1], row[12]) for row in found) == sorted(
        (each[UTC], each[VEHICLE], each[SEQ]) for each in wanted if holds(each)
    )


@pytest.mark.parametrize(
    "sql",
    [
        "", ";", "SELEC 1", "SELECT 1; SELECT 2", "SELECT * FROM nowhere", "CREATE TABLE x (a INT)",
        "DROP VIEW decided",
        "COPY logs TO 'stolen.csv'", "ATTACH 'other.db'", "INSTALL httpfs", "SET enable_external_access = true",
        "PRAGMA database_list", "SELECT * FROM read_text('/etc/hostname')", "SELECT * FROM '/etc/hostname'",
        "SELECT * FROM read_csv('/proc/self/environ')", "SELECT getenv('HOME')", "EXPORT DATABASE 'x'",
        "EXPLAIN ANALYZE SELECT 1", "CALL pragma_version()", "SELECT * FROM read_parquet('https://example.com/x')",
    ],
)  # fmt: skip
def test_only_one_select_over_the_archive(
    sql: str, asker: ArchiveReader, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(Untrusted) as refusal:
        asker.ask(sql)
    assert refusal.value.slug == "malformed"
    assert str(refusal.value).isprintable(), "it is told on one line"
    assert not list(tmp_path.iterdir())


def test_a_question_of_ones_own(asker: ArchiveReader, fleet: Path) -> None:
    sql = "WITH v AS (SELECT DISTINCT vehicle FROM decided) SELECT COUNT(*) AS vehicles FROM v"
    assert asker.ask(sql) == (("vehicles",), [(2,)])
    assert len(asker.ask("SELECT * FROM decided", 5).rows) == 5


@pytest.mark.slow
def test_a_log_that_is_not_there_is_missing(take: Add, fleet: Path, folder: ArchiveFolder) -> None:
    first, last = take([fleet / "quad-07-0.jsonl", fleet / "quad-07-2.jsonl"])
    assert [row[:2] for row in rows(folder, "missing")] == [("quad-07", last.entry.log)]
    (between,) = take([fleet / "quad-07-1.jsonl"])
    assert rows(folder, "missing") == []
    assert rows(folder, "forks") == []
    assert between.entry.before == first.entry.last_leaf


def test_a_log_that_failed_does_not_stand_for_the_one_before(
    take: Add, fleet: Path, folder: ArchiveFolder, tmp_path: Path
) -> None:
    data = (fleet / "quad-07-0.jsonl").read_bytes()
    (tmp_path / "changed.jsonl").write_bytes(data.replace(b'"outcome":"deny"', b'"outcome":"defer"', 1))
    take([tmp_path / "changed.jsonl", fleet / "quad-07-1.jsonl"])
    assert len(rows(folder, "missing")) == 1


def test_two_stories_of_one_boot_are_a_conflict(take: Add, fleet: Path, folder: ArchiveFolder, tmp_path: Path) -> None:
    """Who holds all keys wrote the flight anew: both verify, and only side by side they give themselves away."""
    other = tmp_path / "rewritten.jsonl"
    lines = list(generated_logs.lines("quad-07", 0, records=300, ending="aborted"))
    other.write_bytes(b"".join(lines))
    one, two = take([fleet / "quad-07-0.jsonl", other])
    assert {one.entry.status, two.entry.status} == {"verified"}
    assert one.entry.boot == two.entry.boot
    ((vehicle, boot, seq, *logs),) = rows(folder, "conflicts")
    assert (vehicle, boot, seq) == ("quad-07", one.entry.boot, one.entry.records - 1)
    assert sorted(logs) == sorted([one.entry.log, two.entry.log])


def test_the_beginning_of_a_log_does_not_contradict_it(take: Add, folder: ArchiveFolder, tmp_path: Path) -> None:
    lines = list(generated_logs.lines("quad-07", 4, records=1_200))
    (tmp_path / "whole.jsonl").write_bytes(b"".join(lines))
    (tmp_path / "early.jsonl").write_bytes(b"".join(lines[:1_100]))
    assert [done.entry.status for done in take(sorted(tmp_path.glob("*.jsonl")))] == ["incomplete", "verified"]
    assert rows(folder, "conflicts") == []


@pytest.mark.slow
def test_a_bundle_that_flew_twice_is_told(take: Add, fleet: Path, folder: ArchiveFolder) -> None:
    """What kept used bundles was emptied, put back or made anew: each log is whole, and an archive has both."""
    (first,) = take([fleet / "quad-07-0.jsonl"])
    assert rows(folder, "twice") == []
    (second,) = take([fleet / "quad-07-1.jsonl"])
    assert {first.entry.status, second.entry.status} == {"verified"}
    ((vehicle, _, digest, *logs),) = rows(folder, "twice")
    assert (vehicle, digest) == ("quad-07", first.entry.bundle_digest)
    assert sorted(logs[::2]) == sorted([first.entry.log, second.entry.log])


@pytest.mark.slow
def test_two_flights_after_the_same_one_are_a_fork(
    take: Add, fleet: Path, folder: ArchiveFolder, tmp_path: Path
) -> None:
    (first,) = take([fleet / "quad-07-0.jsonl"])
    generated_logs.write(tmp_path / "other.jsonl", "quad-07", 5, before=first.entry.last_leaf)
    take([fleet / "quad-07-1.jsonl", tmp_path / "other.jsonl"])
    assert len(rows(folder, "forks")) == 1
    assert len(index.read_catalogue(folder)) == 3
