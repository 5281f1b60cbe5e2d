"""The service `bench paper` with a tiny experiment: what is run, kept, continued and refused."""

import re
from collections.abc import Sequence
from contextlib import nullcontext
from errno import EACCES, ENOSPC
from pathlib import Path
from tempfile import gettempdir

import msgspec
import pytest

from reference.evaluation_results import campaign
from rtshcua.app import evaluation
from rtshcua.app.evaluation import (
    Evaluation,
    EvaluationOutcome,
    EvaluationRequest,
    WrittenReport,
    measure,
    prepare,
    report,
)
from rtshcua.campaign.workers import Here, Look, cores
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evaluation import experiments, raw_data
from rtshcua.evaluation.design import MODES, RUNS, EvaluationPlan, WorkUnit
from rtshcua.evaluation.experiments import Experiment, UnitResults, batches
from rtshcua.evaluation.raw_data import RawExperiment, RawFolder
from rtshcua.evaluation.results import FailedAttempt, Result, UnavailableMode, VerificationTiming
from virtual.rows import rows

TWO = ("none", "software")


class Asked(Exception):
    """Somebody asked to stop."""


class Silent:
    """Shows nothing, and remembers the units; stops after `most` of them."""

    def __init__(self, most: int = 1 << 30) -> None:
        self.units: list[WorkUnit] = []
        self.left_s: list[float | None] = []
        self.most = most

    def begun(self, made: Evaluation) -> None:
        assert not self.units

    def measured(self, found: UnitResults, left_s: float | None) -> None:
        self.units.append(found.unit)
        self.left_s.append(left_s)
        if len(self.units) == self.most:
            raise Asked

    def clear(self) -> None:
        """Nothing was shown."""


class Never(nullcontext[object]):
    """Does not stop."""

    def look(self) -> None:
        """Go on."""


def units(plan: EvaluationPlan) -> Sequence[WorkUnit]:
    return [WorkUnit("X1", (mode, seed)) for seed in range(plan.runs) for mode in plan.modes]


def timing(unit: WorkUnit) -> Sequence[Result]:
    mode, seed = unit.key
    return [VerificationTiming(way=str(mode), records=part, repetition=int(seed), took_ns=1) for part in range(2)]


@pytest.fixture(autouse=True)
def tiny(monkeypatch: pytest.MonkeyPatch) -> dict[str, Experiment]:
    """The only experiment, in place of all."""
    table = {"X1": Experiment(units, timing)}
    monkeypatch.setattr(evaluation, "EXPERIMENTS", table)
    monkeypatch.setattr(experiments, "EXPERIMENTS", table)
    return table


def here(jobs: int, look: Look) -> Here:
    assert jobs == 1
    look()
    return Here()


def asked(folder: Path, runs: int = 3, modes: Sequence[str] = TWO, **more: object) -> Evaluation:
    request = EvaluationRequest((), modes, runs, 1, quick=False, output=folder)._replace(**more)
    made = prepare(request)
    assert isinstance(made, Evaluation), made
    return made


def ended(made: Evaluation, progress: Silent | None = None) -> EvaluationOutcome:
    outcome = measure(made, progress or Silent(), Never(), here)
    assert isinstance(outcome, EvaluationOutcome), outcome
    return outcome


def kept(folder: Path) -> RawExperiment:
    read = RawFolder(folder).read("X1")
    assert isinstance(read, RawExperiment)
    return read


def test_each_unit_is_measured_once(tmp_path: Path) -> None:
    progress = Silent()
    outcome = ended(asked(tmp_path), progress)
    assert (outcome.done, outcome.asked, outcome.failed) == (6, 6, [])
    assert progress.units == [*units(EvaluationPlan(3, TWO))]
    assert [*kept(tmp_path).units] == progress.units
    assert len(kept(tmp_path).results) == 12
    assert progress.left_s[-1] == 0
    again = asked(tmp_path)
    assert again.left == []
    assert ended(again).done == 6


def test_default_extent_is_the_published_one(tmp_path: Path) -> None:
    made = asked(tmp_path, modes=(), runs=None)
    assert made.plan == EvaluationPlan(RUNS, MODES)
    assert asked(tmp_path, modes=(), runs=None, quick=True).plan == EvaluationPlan(1, MODES, quick=True)


def test_interrupted_run_is_continued(tmp_path: Path) -> None:
    with pytest.raises(Asked):
        measure(asked(tmp_path), Silent(most=4), Never(), here)
    assert len(kept(tmp_path).units) == 4
    progress = Silent()
    made = asked(tmp_path)
    assert len(made.left) == 2
    assert ended(made, progress).done == 6
    assert progress.units == [*units(EvaluationPlan(3, TWO))][4:]


def test_more_runs_and_modes_extend_a_folder(tmp_path: Path) -> None:
    ended(asked(tmp_path, runs=1))
    made = asked(tmp_path, runs=2, modes=(*TWO, "optee"))
    assert set(made.left) == {
        WorkUnit("X1", ("optee", 0)), *(WorkUnit("X1", (mode, 1)) for mode in (*TWO, "optee"))
    }  # fmt: skip
    assert ended(made).done == 6


def test_full_disk_keeps_what_was_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    append, calls = raw_data.append, list[bytes]()

    def full(path: Path, data: bytes, root: Path) -> None:
        calls.append(data)
        if len(calls) < 3:
            return append(path, data, root)
        append(path, data[: len(data) // 2], root)
        raise OSError(ENOSPC, "No space left on device", str(path))

    monkeypatch.setattr(raw_data, "append", full)
    refused = measure(asked(tmp_path), Silent(), Never(), here)
    assert isinstance(refused, Refusal)
    assert refused.code is ExitCode.FULL
    assert "no space left" in refused.text.lower()
    monkeypatch.undo()
    assert len(kept(tmp_path).units) == 2


def test_space_again_continues_after_a_full_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, tiny: dict[str, Experiment]
) -> None:
    ended(asked(tmp_path, runs=1))
    path = tmp_path / "X1.jsonl"
    path.write_bytes(path.read_bytes()[:-20])
    assert ended(asked(tmp_path)).done == 6
    assert len(kept(tmp_path).units) == 6


def test_failed_unit_is_reported_and_left_for_the_next_run(tmp_path: Path, tiny: dict[str, Experiment]) -> None:
    def failing(unit: WorkUnit) -> Sequence[Result]:
        if unit.key == ("none", 1):
            raise RuntimeError("the home does not start")
        return timing(unit)

    tiny["X1"] = Experiment(units, failing)
    outcome = ended(asked(tmp_path))
    assert (outcome.done, outcome.asked) == (5, 6)
    (failed,) = outcome.failed
    assert (failed.unit.key, failed.failed) == (("none", 1), "RuntimeError: the home does not start")
    assert [unit.key for unit in asked(tmp_path).left] == [("none", 1)]
    assert kept(tmp_path).failed == [(failed.unit, FailedAttempt(why=failed.failed))]


def test_report_counts_what_is_not_in_the_results(tmp_path: Path, tiny: dict[str, Experiment]) -> None:
    """Failed attempts and malformed lines stay visible, also after the unit was run successfully."""

    def failing(unit: WorkUnit) -> Sequence[Result]:
        raise RuntimeError(f"no {unit.key[0]}")

    tiny["X1"] = Experiment(units, failing)
    assert ended(asked(tmp_path, runs=1)).done == 0
    tiny["X1"] = Experiment(units, timing)
    ended(asked(tmp_path, runs=1, modes=("software",)))
    path = tmp_path / "X1.jsonl"
    path.write_bytes(path.read_bytes() + b"x\n")
    written = report(asked(tmp_path))
    assert isinstance(written, WrittenReport)
    assert [name for name, _ in written.not_counted] == ["X1", "X1"]
    text = " ".join(written.text.read_text().replace("\\", "").split())
    assert (
        "| X1, not counted | - | 1 lines that are cut off, malformed, not of the design or of incomplete units |"
        in text
    )
    assert "2 attempts at 2 units of work failed, 1 of which have no results yet; the first: none 0: Run" in text


def test_mode_that_became_available_is_measured(
    tmp_path: Path, tiny: dict[str, Experiment], monkeypatch: pytest.MonkeyPatch
) -> None:
    missing = Refusal("missing", "QEMU is missing", "install it")
    monkeypatch.setattr(evaluation, "unavailable", lambda mode: missing if mode == "software" else None)
    tiny["X1"] = Experiment(units, lambda unit: [UnavailableMode(mode=str(unit.key[0]), why="QEMU is missing")])
    ended(asked(tmp_path, runs=1, modes=("software",)))
    assert asked(tmp_path, runs=1, modes=("software",)).left == []
    monkeypatch.setattr(evaluation, "unavailable", lambda mode: None)
    tiny["X1"] = Experiment(units, timing)
    assert ended(asked(tmp_path, runs=1, modes=("software",))).done == 1
    assert asked(tmp_path, runs=1, modes=("software",)).left == []
    assert len(kept(tmp_path).results) == 3


@rows(
    "written",
    [
        b"", b"{}", b"\xff", b"[" * 200_000, b'{"mission":' + b"[" * 200_000,
        msgspec.json.encode(campaign()).replace(b'"flown_us":', b'"flown_us":' + b"9" * 400),
        re.sub(rb'"name":"[^"]*"', b'"name":"other_mm"', msgspec.json.encode(campaign())),
    ],
)  # fmt: skip
def test_report_of_a_campaign_by_others_is_refused(written: bytes, tmp_path: Path) -> None:
    (tmp_path / "report.json").write_bytes(written)
    refused = prepare(EvaluationRequest((), TWO, 1, 1, quick=False, output=tmp_path / "e", campaigns=(tmp_path,)))
    assert isinstance(refused, Refusal)
    assert (refused.code, "is not the report of a campaign" in refused.text) == (ExitCode.INPUT, True)


def test_folder_of_temporary_files_is_restored(tmp_path: Path, tiny: dict[str, Experiment]) -> None:
    """A measurement has one of its own, which is gone afterwards."""
    before, seen = gettempdir(), list[str]()

    def noting(unit: WorkUnit) -> Sequence[Result]:
        seen.append(gettempdir())
        return timing(unit)

    tiny["X1"] = Experiment(units, noting)
    ended(asked(tmp_path))
    assert {Path(each).parent for each in seen} == {tmp_path}
    assert gettempdir() == before


def test_units_that_belong_together_make_one_batch(tiny: dict[str, Experiment]) -> None:
    tiny["X1"] = Experiment(units, timing, lambda unit: unit.key[1])
    made = batches(units(EvaluationPlan(2, TWO)))
    assert [[unit.key for unit in batch.units] for batch in made] == [
        [("none", 0), ("software", 0)], [("none", 1), ("software", 1)],
    ]  # fmt: skip


def test_second_run_in_the_same_folder_is_refused(tmp_path: Path) -> None:
    made = asked(tmp_path)
    with RawFolder(tmp_path).held():
        refused = measure(made, Silent(), Never(), here)
    assert isinstance(refused, Refusal)
    assert refused.slug == "in-use"


@rows(
    "change, said",
    [
        ({"only": ("X9",)}, "no such experiment: `X9`"),
        ({"modes": ("tee",)}, "no such mode: `tee`"),
        ({"jobs": cores() + 1}, f"`--jobs {cores() + 1}` is more than the {cores()} cores"),
    ],
)
def test_wrong_request_is_refused(change: dict[str, object], said: str, tmp_path: Path) -> None:
    refused = prepare(EvaluationRequest((), (), 1, 1, quick=False, output=tmp_path)._replace(**change))
    assert isinstance(refused, Refusal)
    assert refused.text.startswith(said)


@rows("name", ["report.html", "report.md"])
def test_report_of_something_else_is_kept(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text("of a campaign")
    refused = prepare(EvaluationRequest((), (), 1, 1, quick=False, output=tmp_path))
    assert isinstance(refused, Refusal)
    assert (refused.slug, refused.text) == ("usage", f"`{tmp_path / name}` is there, but no raw data of an evaluation")
    assert (tmp_path / name).read_text() == "of a campaign"
    (tmp_path / name).unlink()


def test_own_report_is_replaced(tmp_path: Path) -> None:
    ended(asked(tmp_path))
    (tmp_path / "report.html").write_text("an earlier one")
    assert isinstance(report(asked(tmp_path)), WrittenReport)
    assert (tmp_path / "report.html").read_text().startswith("<!DOCTYPE html>")


def test_folder_that_cannot_be_made_keeps_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is kept is said only where something is."""

    def forbidden(path: Path) -> None:
        raise PermissionError(EACCES, "Permission denied", str(path))

    made = asked(tmp_path / "new")
    monkeypatch.setattr(raw_data, "make_folder", forbidden)
    refused = measure(made, Silent(), Never(), here)
    assert isinstance(refused, Refusal)
    assert (refused.code, refused.help) == (ExitCode.FULL, "name another folder with `-o`")
    monkeypatch.undo()


def test_file_in_place_of_the_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    refused = prepare(EvaluationRequest((), (), 1, 1, quick=False, output=tmp_path / "file"))
    assert isinstance(refused, Refusal)
    assert "is not a folder" in refused.text
