"""`rtshcua archive add`, killed at random moments and repeated, adds every log exactly once."""

import subprocess
import sys
from pathlib import Path
from random import Random
from time import monotonic

import pytest

from reference import generated_logs
from reference.archived import refused
from rtshcua.adapters.archive.asking import ArchiveReader
from rtshcua.adapters.archive.folder import ArchiveFolder

KILLS = 20


@pytest.mark.soak
def test_killed_add_loses_and_duplicates_nothing(fleet: Path, tmp_path: Path) -> None:
    logs = sorted(fleet.glob("*.jsonl"))
    wanted, random = refused(logs), Random(5)

    def adding(folder: Path) -> list[str]:
        words = [sys.executable, "-m", "rtshcua", "archive", "add", *map(str, logs), "--jobs", "1"]
        return [*words, "--root", generated_logs.ROOT_KEY.hex(), "--archive", str(folder)]

    start = monotonic()
    subprocess.run(adding(tmp_path / "measured"), check=False, capture_output=True)
    whole = monotonic() - start
    for number in range(KILLS):
        folder = tmp_path / str(number)
        add = subprocess.Popen(adding(folder), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            add.wait(random.uniform(whole / 4, whole))  # the first quarter goes by before anything is written
        except subprocess.TimeoutExpired:
            add.kill()
            add.wait()
        done = subprocess.run(adding(folder), check=False, capture_output=True, text=True)
        assert "5 verified, 1 incomplete" in done.stdout, done.stderr
        asker = ArchiveReader(ArchiveFolder(folder))
        columns = "utc_us, vehicle, skill, outcome, reason, clause, policy_version, seq"
        found = asker.ask(f"SELECT {columns} FROM decided WHERE outcome <> 'allow' ORDER BY ALL").rows
        asker.close()
        assert found == wanted, number
