"""`rtshcua bench paper`: its sample, its interruption, and its errors."""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from rtshcua.diagnostics.exits import ExitCode
from rtshcua.evaluation.design import MISSIONS, MODES
from rtshcua.evaluation.experiments import EXPERIMENTS
from rtshcua.evaluation.raw_data import RawExperiment, RawFolder
from rtshcua.evaluation.results import PointFlight, UnavailableMode
from rtshcua.front.cli import app

#: s: a busy computer
PATIENCE_S = 300


def ran(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, dict[str, Any]]:
    code = app.main(["bench", "paper", *words, "--json"])
    return code, json.loads(capsys.readouterr().out)


def flights(folder: Path) -> RawExperiment:
    read = RawFolder(folder).read("X1")
    assert isinstance(read, RawExperiment)
    return read


#: by marker: the modes of which a sample is measured
SAMPLES = [
    pytest.param(("none", "software", "process"), id="here"),
    pytest.param(MODES, id="all", marks=pytest.mark.slow),
]


@pytest.mark.parametrize("modes", SAMPLES)
def test_sample_measures_each_experiment_in_each_mode(
    modes: Sequence[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--quick", "--modes", ",".join(modes), "-o", str(tmp_path)]
    code, told = ran(capsys, *words)
    assert code in (ExitCode.OK, ExitCode.DIAGNOSTICS), told
    assert told["done"] == told["asked"] > 0
    assert told["not_measured"] == []
    assert {path.stem for path in tmp_path.glob("*.jsonl")} == set(EXPERIMENTS)
    results = flights(tmp_path).results
    assert {each.mode for each in results if isinstance(each, PointFlight | UnavailableMode)} == set(modes)
    flown = [each for each in results if isinstance(each, PointFlight)]
    assert {each.ending for each in flown} == {"completed"}
    assert {each.mission for each in flown} == {*MISSIONS}
    assert all(each.fallbacks == 0 and each.proposal_ns > 0 for each in flown)
    for flight in flown:
        assert [step.step for step in flight.invocations] == [*range(len(flight.invocations))]
        assert {step.outcome for step in flight.invocations} == {"allow"}
        for step in flight.invocations:
            assert step.end_to_end_ns is not None
            assert step.dispatch_ns is not None
            assert 0 < step.validation_ns + step.dispatch_ns < step.end_to_end_ns
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert all(mode in page for mode in MODES)
    assert (tmp_path / "report.md").stat().st_size > 1_000
    before = {path.name: path.read_bytes() for path in tmp_path.glob("*.jsonl")}
    again, repeated = ran(capsys, *words)
    assert (again, repeated["done"]) == (code, told["done"])
    assert {path.name: path.read_bytes() for path in tmp_path.glob("*.jsonl")} == before, "nothing is measured twice"


@pytest.mark.slow
@pytest.mark.parametrize("ends", [signal.SIGINT, signal.SIGKILL])
def test_results_outlive_the_process(ends: signal.Signals, tmp_path: Path) -> None:
    words = [sys.executable, "-m", "rtshcua", "bench", "paper", "--only", "X2", "--modes", "unenforced", "-j", "1"]
    words += ["-o", str(tmp_path)]
    with subprocess.Popen([*words, "--runs", "9"], stderr=subprocess.PIPE, text=True) as process:
        until_s = time.monotonic() + PATIENCE_S
        while not (tmp_path / "X1.jsonl").exists() or len((tmp_path / "X1.jsonl").read_bytes().splitlines()) < 2:
            assert time.monotonic() < until_s
            assert process.poll() is None
            time.sleep(0.1)
        process.send_signal(ends)
        _, said = process.communicate(timeout=PATIENCE_S)
    if ends is signal.SIGINT:
        assert process.returncode == ExitCode.INTERRUPTED
        assert "repeat the command to continue" in said
        assert [*tmp_path.glob(".work-*")] == []
        assert (tmp_path / "report.html").exists()
    kept = flights(tmp_path)
    assert kept.skipped == 0
    assert len(kept.units) >= 1
    with RawFolder(tmp_path).held():
        assert [*tmp_path.glob(".work-*/*")] == []


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--only", "X1,X8"], "no such experiment: `X8`"),
        (["--modes", "tee"], "no such mode: `tee`"),
        (["--jobs", "4096"], "`--jobs 4096` is more than the"),
    ],
)
def test_wrong_use_names_what_is_accepted(
    words: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, told = ran(capsys, *words, "-o", str(tmp_path / "out"))
    assert code == ExitCode.USAGE
    assert told["error"]["text"].startswith(said)
    assert told["error"]["help"].startswith("accepted: ")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--only", ""], "`--only` names nothing"),
        (["--only", " ,"], "`--only` names nothing"),
        (["--modes", ""], "`--modes` names nothing"),
        (["-o", ""], "`--output` has an empty value"),
        (["--output="], "`--output` has an empty value"),
    ],
)
def test_empty_value_is_wrong_use(
    words: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """An empty name of a folder would be the current folder, and no name of an experiment all of them."""
    monkeypatch.chdir(tmp_path)
    code, told = ran(capsys, *words)
    assert (code, told["error"]["text"]) == (ExitCode.USAGE, said)
    assert [*tmp_path.iterdir()] == []


@pytest.mark.parametrize(("words", "folder"), [([], "evaluation"), (["--quick"], "evaluation-quick")])
def test_sample_has_a_folder_of_its_own(
    words: list[str], folder: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "runs" / folder).mkdir(parents=True)
    (tmp_path / "runs" / folder / "report.md").touch()
    code, told = ran(capsys, *words)
    assert (code, told["error"]["slug"]) == (ExitCode.USAGE, "usage")
    assert f"runs/{folder}/report.md` is there" in told["error"]["text"]


def test_folder_of_something_else_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "X1.jsonl").write_text("{}\n")
    code, told = ran(capsys, "--only", "x1", "-o", str(tmp_path))
    assert code == ExitCode.INPUT, told
    assert "does not begin as raw data of an evaluation" in told["error"]["text"]
    assert (tmp_path / "X1.jsonl").read_text() == "{}\n"


def test_help_names_the_defaults_of_options(capsys: pytest.CaptureFixture[str]) -> None:
    """Rich takes what is in brackets for a style, and drops it."""
    assert app.main(["bench", "paper", "--help"]) == ExitCode.OK
    said = " ".join(capsys.readouterr().out.replace("│", " ").split())
    for default in ("all", "30; with --quick 1", "runs/evaluation; with --quick runs/evaluation-quick"):
        assert f"[default: {default}]" in said
