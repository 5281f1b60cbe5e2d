"""Fleet: ten vehicles on this machine at once, each in real time with a runtime, a simulation and a view.

A deadline is missed when a step is not admitted and sent within its deadline, when a fallback flies, or when the
heartbeat of a runtime, due every second, is late. Exits with 1 when a deadline is missed.
"""

import json
import os
import subprocess
import sys
import tempfile
from itertools import pairwise
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage

from rtshcua.mavlink import tlog
from rtshcua.mavlink.framing import message_id
from rtshcua.onboard.enforcement.frames import OURS

VEHICLES = 10
SPEED = 1
LATE_US = 1_200_000  # between two heartbeats; they are due every second
ROOT = Path(__file__).resolve().parents[1]
RTSHCUA = [sys.executable, "-m", "rtshcua"]
_SYSTEM, _COMPONENT = 5, 6  # bytes of a frame's header


def fly(folder: Path) -> tuple[list[Path], list[int]]:
    """The folders of ten runs, and their exit codes."""
    env = os.environ | {"RTSHCUA_DATA_DIR": str(folder / "data")}
    bundle = folder / "short.bundle"
    for words in (["keys", "init"], ["compile", str(ROOT / "missions" / "short.rts"), "-o", str(bundle)]):
        subprocess.run([*RTSHCUA, *words], env=env, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    runs = []
    for number in range(VEHICLES):
        words = ["run", str(bundle), "--plain", "--fresh-state", "--runs", str(folder / str(number))]
        words += ["--flavour", ("px4", "ardupilot")[number % 2], "--seed", str(number + 1), "--speed", str(SPEED)]
        runs.append(subprocess.Popen([*RTSHCUA, *words], env=env, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))
    codes = [run.wait() for run in runs]
    return [next((folder / str(number)).iterdir()) for number in range(VEHICLES)], codes


def slack(log: Path) -> tuple[list[float], list[str]]:
    """Return the greatest time from release to sending of a step, in ms, and the missed deadlines."""
    records = [json.loads(line) for line in log.read_bytes().splitlines()]
    steps = [record for record in records if record["type"] == "decision" and record["kind"] == 0]
    wrong = [f"{record['outcome']} {record['reason']}" for record in steps if record["outcome"] != "allow"]
    effects = [record for record in records if record["type"] == "effect"]
    wrong += [f"{each['event']} {each['detail']}" for each in effects if each["event"] in ("failed", "violated")]
    used = [record["at_us"] - record["context"]["released_us"] + record["context"]["remaining_us"] for record in steps]
    return [taken / 1e3 for taken in used], wrong


def gaps(frames: Path) -> list[int]:
    """Return the intervals between heartbeats of the runtime, in us."""
    beats = [
        entry.at_us
        for entry in tlog.read(frames.read_bytes())
        if entry.frame[_COMPONENT] == OURS and message_id(entry.frame, 0) == 0
    ]
    return [later - earlier for earlier, later in pairwise(beats)]


def main() -> int:
    """Fly and print; return 1 if a deadline is missed."""
    with tempfile.TemporaryDirectory() as name:
        runs, codes = fly(Path(name))
        used, beats, wrong = [], [], [f"exit code {code}" for code in codes if code]
        for run in runs:
            taken, problems = slack(run / "log.jsonl")
            used += taken
            wrong += problems
            beats += gaps(run / "telemetry.tlog")
    usage = getrusage(RUSAGE_CHILDREN)
    late = sum(gap > LATE_US for gap in beats)
    print(
        f"fleet: {VEHICLES} vehicles in real time: {len(used)} steps admitted at most {max(used):.1f} ms after their "
        f"release, what dispatch takes included; deadlines missed: {len(wrong)} {sorted(set(wrong))[:3] or ''}"
    )
    print(
        f"fleet: {len(beats)} heartbeats, at most {max(beats) / 1e6:.2f} s apart, late: {late}; "
        f"{usage.ru_utime + usage.ru_stime:.0f} s of the processor in all"
    )
    return int(bool(wrong or late))


if __name__ == "__main__":
    sys.exit(main())
