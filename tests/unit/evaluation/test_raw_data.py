"""The raw data of an evaluation: what survives a crash, and which folders are continued."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from reference.evaluation_results import case_flights, checks, flight
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evaluation import raw_data
from rtshcua.evaluation.computer import Computer
from rtshcua.evaluation.design import POINTS, WorkUnit
from rtshcua.evaluation.raw_data import FORMAT, RawExperiment, RawFolder, RawHeader, design_digest
from rtshcua.evaluation.results import (
    FailedAttempt,
    FallbackReaction,
    FallbackTiming,
    Result,
    UnavailableMode,
    VerificationTiming,
)
from virtual.rows import rows

COMPUTER = Computer(
    processor="a processor", cores=2, memory=None, system="", python="", program="1", commit="c", versions={}, load=()
)
HEADER = RawHeader(
    format=FORMAT, experiment="X6", program="1", commit="c", design="d", quick=False, began=0, computer=COMPUTER
)
#: a header whose computer is nested deeply
DEEP = b'{"format":1,"computer":{"x":' + b"[" * 200_000
PARTS = "processor, cores, Python or libraries"
FIRST, SECOND = WorkUnit("X6", ("verify", 1000, 1)), WorkUnit("X6", ("verify", 1000, 2))


def verified(*repetitions: int) -> list[Result]:
    return [VerificationTiming(way="fast", records=1000, repetition=each, took_ns=each) for each in repetitions]


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[RawFolder]:
    made = RawFolder(tmp_path / "evaluation")
    with made.held():
        assert made.begin(HEADER) is None
        yield made


def keep(folder: RawFolder, unit: WorkUnit, *results: Result) -> None:
    folder.keep(unit, results, at=7, load=0.5, jobs=2)


def found(folder: RawFolder) -> RawExperiment:
    read = folder.read("X6")
    assert isinstance(read, RawExperiment)
    return read


def test_results_come_back_as_they_were_kept(folder: RawFolder) -> None:
    keep(folder, FIRST, *verified(1, 2, 3))
    keep(folder, SECOND, UnavailableMode(mode="optee", why="not installed"))
    read = found(folder)
    assert read.header == HEADER
    assert [*read.units] == [FIRST, SECOND]
    assert read.results == (*verified(1, 2, 3), UnavailableMode(mode="optee", why="not installed"))
    assert {(each.at, each.load, each.jobs) for each in read.units[FIRST]} == {(7, 0.5, 2)}
    assert read.skipped == 0


def test_unit_without_results_is_done(folder: RawFolder) -> None:
    keep(folder, FIRST)
    assert [*found(folder).units] == [FIRST]
    assert found(folder).results == ()


def test_every_cut_of_the_last_unit_leaves_the_units_before_it(folder: RawFolder) -> None:
    keep(folder, FIRST, *verified(1))
    path = folder.path / "X6.jsonl"
    before = path.stat().st_size
    keep(folder, SECOND, *verified(2, 3))
    whole = path.read_bytes()
    for length in range(before, len(whole)):
        path.write_bytes(whole[:length])
        done = length >= len(whole) - 1  # only the end of the last line is missing
        assert [*found(folder).units] == ([FIRST, SECOND] if done else [FIRST]), length
        assert folder.begin(HEADER) is None
        keep(folder, SECOND, *verified(4, 5))
        assert found(folder).results == (*verified(1), *(verified(2, 3) if done else []), *verified(4, 5)), length


def test_nothing_replaces_a_measurement(folder: RawFolder) -> None:
    """All results of a unit that was kept twice count, so that no failure disappears behind a success."""
    keep(folder, FIRST, *verified(1, 2))
    keep(folder, SECOND, *verified(3))
    keep(folder, FIRST, *verified(4, 5))
    assert found(folder).results == (*verified(1, 2), *verified(4, 5), *verified(3))
    assert found(folder).skipped == 0


def test_failed_attempt_is_kept_and_leaves_its_unit_undone(folder: RawFolder) -> None:
    why = FailedAttempt(why="RuntimeError: the home does not start")
    keep(folder, FIRST, why)
    keep(folder, FIRST, why)
    keep(folder, SECOND, *verified(1))
    assert [*found(folder).units] == [SECOND]
    assert found(folder).failed == [(FIRST, why)] * 2
    assert found(folder).results == (*verified(1),)


def line(**changed: str) -> bytes:
    """A line of one result, with members in the words given."""
    usual = {"key": '["a"]', "part": "0", "parts": "1", "at": "1", "load": "0.5", "jobs": "2", "result": "null"}
    return "{{{}}}".format(",".join(f'"{name}":{text}' for name, text in (usual | changed).items())).encode()


@rows(
    "written",
    [
        b"\xff\xfe", b'{"key":["\xff"]}', b'{"more":' + b"[" * 200_000,
        line(result='{"result":"flight","x":' + "[" * 200_000), line(result='{"result":"success"}'),
        line(parts="1" + "0" * 30), line(parts=str(10**12)), line(at="9" * 12), line(at="-1"), line(load="1e999"),
        line(load="-1"), line(load='"much"'), line(key='["\\ud800"]'), line(part="9" * 6000),
        line(result='{"result":"verification","way":"default","records":1000,"repetition":1,"took_ns":-5}'),
        line(result='{"result":"verification","way":"default","records":1000,"repetition":1,"took_ns":1e400}'),
        line(result=f'{{"result":"verification","way":"default","records":1000,"repetition":1,"took_ns":{10**400}}}'),
        line() + b" " * 5000,
    ],
)  # fmt: skip
def test_line_of_others_is_skipped_and_counted(written: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever stands in a line, the lines around it are read, and none is held whole in memory if it is too long."""
    monkeypatch.setattr(raw_data, "_LONGEST", 4096)
    made = RawFolder(tmp_path)
    with made.held():
        assert made.begin(HEADER) is None
        keep(made, FIRST, *verified(1))
        path = tmp_path / "X6.jsonl"
        path.write_bytes(path.read_bytes() + written + b"\n")
        keep(made, SECOND, *verified(2))
    read = found(made)
    assert (read.results, read.skipped) == ((*verified(1), *verified(2)), 1)
    path.unlink()


FLIGHT = flight("short", 100_000, "software", 1)
CHECK = next(checks(["software"], POINTS[:1], runs=1))
FLOWN = next(case_flights())
TIMED = FallbackTiming(case="low battery", mode="software", repetition=1, local_ns=1, written_ns=2, synced_ns=3)
REACTED = FallbackReaction(case="low battery", mode="software", repetition=1, took_ns=1)
#: results with the keys of their units
OWN = [
    (("short", 100_000, 1, "software"), FLIGHT),
    (("check", "short", 100_000, "software", 1), CHECK),
    (("flight", "normal allow", "short", 100_000, "px4", "aloft"), FLOWN),
    (("software", 30), TIMED),
    (("reaction", "low battery", "software", 30), REACTED),
]
#: and such that are not of their unit, or not of the design
OTHERS = [
    (("short", 100_000, 2, "software"), FLIGHT),
    (("short", 100_000, 1, "process"), FLIGHT),
    (("short", 123_456, 1, "software"), replace(FLIGHT, deadline_us=123_456)),
    (("brief", 100_000, 1, "software"), replace(FLIGHT, mission="brief")),
    (("short", 100_000, 1, "magic"), replace(FLIGHT, mode="magic")),
    (("check", "short", 100_000, "process", 1), CHECK),
    (("check", "short", 100_000, "software", 1), replace(CHECK, case="another")),
    (("check", "short", 5, "software", 1), replace(CHECK, deadline_us=5)),
    (("flight", "replay", "short", 100_000, "px4", "aloft"), FLOWN),
    (("flight", "normal allow", "short", 100_000, "px4", "ground"), FLOWN),
    (("process", 30), TIMED),
    (("software", 30), replace(TIMED, case="another")),
    (("reaction", "replay", "software", 30), REACTED),
]


@rows(("key", "result"), OWN)
def test_result_of_its_unit_counts(key: tuple[str | int, ...], result: Result, tmp_path: Path) -> None:
    assert kept_as(key, result, tmp_path) == ((result,), 0)


@rows(("key", "result"), OTHERS)
def test_result_of_another_unit_or_design_is_skipped_and_counted(
    key: tuple[str | int, ...], result: Result, tmp_path: Path
) -> None:
    assert kept_as(key, result, tmp_path) == ((), 1)


def kept_as(key: tuple[str | int, ...], result: Result, path: Path) -> tuple[tuple[Result, ...], int]:
    """What is read of a result that was kept for a unit, and how many lines were skipped."""
    made = RawFolder(path)
    with made.held():
        assert made.begin(HEADER) is None
        keep(made, WorkUnit("X6", key), result)
    read = found(made)
    assert bool(read.units) == bool(read.results)
    (path / "X6.jsonl").unlink()
    return read.results, read.skipped


def test_lines_of_another_program_do_not_make_a_unit(folder: RawFolder) -> None:
    path = folder.path / "X6.jsonl"
    for parts in ([(1, 2), (0, 2)], [(0, 2), (0, 2)], [(0, 2), (1, 3)], [(0, 0)], [(0, 1), (1, 1)], [(0, 2), (2, 2)]):
        lines = [line(part=str(part), parts=str(of)) for part, of in parts]
        before = path.read_bytes()
        path.write_bytes(before + b"\n".join(lines) + b"\n")
        assert (found(folder).units, found(folder).skipped) == ({}, len(parts)), parts
        path.write_bytes(before)


def test_second_process_cannot_write(folder: RawFolder) -> None:
    with pytest.raises(BlockingIOError), RawFolder(folder.path).held():
        pass


def test_files_of_a_killed_run_are_removed(tmp_path: Path) -> None:
    left, of_others = tmp_path / ".rtshcua-work-abc" / "log", tmp_path / ".work-of-others"
    left.mkdir(parents=True)
    of_others.mkdir()
    with RawFolder(tmp_path).held() as scratch:
        assert not left.exists()
        assert Path(scratch).parent == tmp_path
    assert sorted(path.name for path in tmp_path.iterdir()) == [".lock", ".work-of-others"]


@rows(
    "change, said",
    [
        ({"program": "2"}, "version of this program"),
        ({"commit": "e"}, "commit of this program"),
        ({"design": "e"}, "design of the measurements"),
        ({"quick": True}, "extent (`--quick`)"),
        ({"computer": replace(COMPUTER, processor="a faster one")}, f"computer ({PARTS})"),
        ({"computer": replace(COMPUTER, python="CPython 3.14")}, f"computer ({PARTS})"),
    ],
)
def test_other_measurements_are_not_continued(change: dict[str, Any], said: str, tmp_path: Path) -> None:
    made = RawFolder(tmp_path)
    with made.held():
        assert made.begin(HEADER) is None
        if found(made).results == ():
            keep(made, FIRST, *verified(1))
        refused = made.begin(replace(HEADER, **change))
    assert isinstance(refused, Refusal)
    assert refused.text == f"`{tmp_path}/X6.jsonl` was measured with another {said}"
    assert "-o" in refused.help
    assert found(made).results == (*verified(1),)


def test_another_time_and_load_are_continued(folder: RawFolder) -> None:
    later = replace(HEADER, began=9, computer=replace(COMPUTER, load=(9.0,)))
    assert folder.begin(later) is None
    assert found(folder).header == HEADER


@rows(
    "first",
    [b"", b"{}\n", b"[1]\n", b'{"format":1', b'{"format":1,"experiment":"\xff"}\n', DEEP, b'{"format":1e999}\n'],
)
def test_foreign_file_is_refused(first: bytes, tmp_path: Path) -> None:
    path = tmp_path / "X6.jsonl"
    path.write_bytes(first)
    refused = RawFolder(tmp_path).read("X6")
    assert isinstance(refused, Refusal)
    assert refused.slug == "malformed"
    assert path.read_bytes() == first


def test_later_format_is_refused(folder: RawFolder) -> None:
    (folder.path / "X1.jsonl").write_bytes(
        (folder.path / "X6.jsonl").read_bytes().replace(b'"format":1', b'"format":2', 1)
    )
    refused = folder.read("X1")
    assert isinstance(refused, Refusal)
    assert "has format 2" in refused.text


def test_links_are_not_followed(folder: RawFolder, tmp_path: Path) -> None:
    other = tmp_path / "other"
    other.write_bytes((folder.path / "X6.jsonl").read_bytes())
    (folder.path / "X6.jsonl").unlink()
    (folder.path / "X6.jsonl").symlink_to(other)
    before = other.read_bytes()
    with pytest.raises(OSError, match="links are not followed"):
        folder.read("X6")
    with pytest.raises(OSError, match="links are not followed"):
        keep(folder, FIRST, *verified(1))
    assert other.read_bytes() == before


def test_pipe_is_refused_without_waiting(tmp_path: Path) -> None:
    import os

    os.mkfifo(tmp_path / "X6.jsonl")
    with pytest.raises(OSError, match="regular"):
        RawFolder(tmp_path).read("X6")


def test_design_changes_with_each_file(tmp_path: Path) -> None:
    (tmp_path / "a.py").write_text("a")
    first = design_digest([tmp_path])
    assert design_digest([tmp_path]) == first
    (tmp_path / "cache.pyc").write_text("b")
    assert design_digest([tmp_path]) == first
    (tmp_path / "b.rts").write_text("b")
    second = design_digest([tmp_path])
    (tmp_path / "b.rts").write_text("c")
    assert len({first, second, design_digest([tmp_path])}) == 3
