"""The result does not depend on the workers: this process, several processes, or a cluster."""

import subprocess
import sys
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path

import pytest

from reference.archived import CHECK
from rtshcua.adapters.archive import examine
from rtshcua.adapters.archive.adding import Done, add, verify
from rtshcua.adapters.archive.entry import ArchiveEntry
from rtshcua.adapters.archive.examine import VerifierProcesses
from rtshcua.adapters.archive.folder import ArchiveFolder, LogSource

Add = Callable[..., list[Done]]


def entries(done: Sequence[Done]) -> list[ArchiveEntry]:
    return [each.entry for each in done]


@pytest.mark.slow
def test_processes_come_to_the_same(take: Add, fleet: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(examine, "_LITTLE", 0)
    logs = sorted(fleet.glob("*.jsonl"))
    other = ArchiveFolder(tmp_path / "other", make=True)
    with closing(VerifierProcesses(2)) as two:
        found = list(add(other, map(LogSource, logs), CHECK._replace(workers=two)))
        again = list(verify(other, CHECK._replace(workers=two)))
    assert entries(found) == entries(take(logs))
    assert sorted(each.entry.log for each in again) == sorted(each.entry.log for each in found)
    assert {each.entry.status for each in again} == {"verified", "incomplete"}


CLUSTER = """
import sys
from pathlib import Path
from distributed import LocalCluster
from rtshcua.adapters.archive.adding import add, verify
from rtshcua.adapters.archive.examine import SchedulerWorkers
from rtshcua.adapters.archive.folder import ArchiveFolder, LogSource
from reference.archived import CHECK

if __name__ == "__main__":
    folder, logs = ArchiveFolder(Path(sys.argv[1]), make=True), sorted(Path(sys.argv[2]).glob("*.jsonl"))
    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as local:
        cluster = SchedulerWorkers(local.scheduler_address)
        check = CHECK._replace(workers=cluster)
        for work in (add(folder, map(LogSource, logs), check), verify(folder, check)):
            for done in work:
                print(done.entry.log, done.entry.status, done.entry.records, done.entry.indexed)
        ran = len(local.scheduler_info["workers"])
        cluster.close()
    assert ran == 2, ran
"""


@pytest.mark.clients
def test_a_cluster_comes_to_the_same(take: Add, fleet: Path, tmp_path: Path, checkout: Path) -> None:
    """A scheduler and two workers run as separate processes on this machine."""
    script = tmp_path / "on_cluster.py"
    script.write_text(CLUSTER)
    run = subprocess.run(
        [sys.executable, str(script), str(tmp_path / "other"), str(fleet)],
        cwd=tmp_path, env={"PYTHONPATH": str(checkout / "tests"), "HOME": str(tmp_path), "PATH": "/usr/bin:/bin"},
        capture_output=True, text=True, check=False, timeout=300,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr
    here = entries(take(sorted(fleet.glob("*.jsonl"))))
    told = [f"{e.log} {e.status} {e.records} {e.indexed}" for e in here]
    lines = run.stdout.splitlines()
    assert lines[: len(told)] == told
    assert sorted(lines[len(told) :]) == sorted(told)
