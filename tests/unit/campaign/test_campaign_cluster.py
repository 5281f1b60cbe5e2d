"""A campaign on a Dask cluster gives the same results as in one process, even if a worker is killed."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = """
import os, signal, sys, threading, time
from pathlib import Path
from distributed import LocalCluster
from rtshcua.front.cli import app

if __name__ == "__main__":
    with LocalCluster(n_workers=3, threads_per_worker=1, processes=True, dashboard_address=None) as local:
        pids = [worker["nanny"] and local.workers[name].pid for name, worker in enumerate(
            local.scheduler_info["workers"].values())]
        results = Path(sys.argv[1]) / "results.jsonl"

        def kill():
            while not results.exists() or len(results.read_bytes().splitlines()) < 3:
                time.sleep(0.05)
            os.kill(pids[0], signal.SIGKILL)
            print("killed", flush=True)

        threading.Thread(target=kill, daemon=True).start()
        code = app.main(["campaign", *sys.argv[2:], "--cluster", local.scheduler_address, "-o", sys.argv[1]])
    sys.exit(code)
"""
WORDS = ["missions/short.rts", "--at", "2026-06-01T08:00:00Z", "--flights", "9", "--seed", "4"]


def results(folder: Path) -> dict[int, object]:
    lines = [json.loads(line) for line in (folder / "results.jsonl").read_text().splitlines()]
    return {line["number"]: {key: value for key, value in line.items() if key != "took_us"} for line in lines}


@pytest.mark.clients
def test_killed_worker_loses_no_flight(tmp_path: Path, checkout: Path) -> None:
    script = tmp_path / "on_cluster.py"
    script.write_text(SCRIPT)
    there = subprocess.run(
        [sys.executable, str(script), str(tmp_path / "there"), *WORDS],
        cwd=checkout, capture_output=True, text=True, check=False, timeout=600,
    )  # fmt: skip
    assert there.returncode in (0, 13), there.stderr
    assert "killed" in there.stdout
    here = subprocess.run(
        [sys.executable, "-m", "rtshcua", "campaign", *WORDS, "-j", "2", "-o", str(tmp_path / "here")],
        cwd=checkout, capture_output=True, text=True, check=False, timeout=600,
    )  # fmt: skip
    assert here.returncode == there.returncode, here.stderr
    assert results(tmp_path / "there") == results(tmp_path / "here")
    assert len(results(tmp_path / "here")) == 9
