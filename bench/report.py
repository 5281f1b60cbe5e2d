"""The report of an hour's flight: its size, the time to make it beside `verify-log --audit`, its memory, and the
time to its first picture in a browser.

The flight is flown in virtual time, with all frames. Each command is a process of its own, `RUNS` times in turns; the
least time counts. `verify-log --audit` derives every decision again, as the report does. Exits with 1 when a limit is
missed. Without chromium the browser's time is not measured.
"""

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from reference.browser import CHROMIUM, opened, running
from virtual import run_folder
from virtual.flight_reports import PIN
from virtual.long_flight import legs

LEGS = 82
RUNS = 3
#: limits: octets of the page, seconds to make it, times `verify-log --audit`, octets of memory, seconds to the picture
PAGE, MADE_S, RATIO, MEMORY, PICTURE_S = 5_000_000, 3.0, 1.5, 250 << 20, 2.0


def run(*words: str) -> tuple[float, int]:
    """The time of a command in s, and its greatest memory in octets."""
    start = time.monotonic()
    process = subprocess.Popen([sys.executable, "-m", "rtshcua", *words], stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    took = time.monotonic() - start
    process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0, words
    return took, usage.ru_maxrss * 1_024


def picture_s(page: Path) -> float:
    """The time from the navigation to the first contentful paint, in s, by the browser's own clock."""
    with running() as browser, opened(browser, page) as shown:
        found = shown.page.wait_for_function("performance.getEntriesByName('first-contentful-paint')[0]?.startTime")
        return float(found.json_value()) / 1_000


def judged(text: str, *, held: bool) -> bool:
    """Print a limit; return whether it is missed."""
    print(f"{'held  ' if held else 'MISSED'} {text}")
    return not held


def main() -> int:
    """Measure and print; return 1 if a limit is missed."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        mission, policy, config = legs(LEGS, home=True)
        made = run_folder.folder(folder / "run", run_folder.fly(mission, config, policy), bound=False)
        page, root = folder / "page.html", PIN.key.hex()
        reports, audits = [], []
        for _ in range(RUNS):
            audits.append(run("verify-log", "--audit", "--root", root, str(made)))
            reports.append(run("report", str(made), "-o", str(page), "--root", root))
        quick = run("verify-log", "--root", root, str(made))[0]
        text = subprocess.run(
            [sys.executable, "-m", "rtshcua", "report", str(made), "--json", "--root", root],
            capture_output=True, text=True, check=True,
        ).stdout  # fmt: skip
        said = json.loads(text)
        log, telemetry = ((made / each).stat().st_size for each in ("log.jsonl", "telemetry.tlog"))
        print(
            f"{said['lasted_us'] / 60e6:.0f} min, {said['steps_done']} steps, {said['totals']['decision']} decisions; "
            f"log {log / 1e6:.1f} MB, telemetry {telemetry / 1e6:.1f} MB; `verify-log` without --audit {quick:.2f} s"
        )
        took, audited = min(each[0] for each in reports), min(each[0] for each in audits)
        memory, size = max(each[1] for each in reports), page.stat().st_size
        missed = judged(f"page {size / 1e6:.2f} MB, limit {PAGE / 1e6:.0f}", held=size <= PAGE)
        missed |= judged(f"made in {took:.2f} s, limit {MADE_S}", held=took <= MADE_S)
        ratio = took / audited
        missed |= judged(f"{ratio:.2f} times `verify-log --audit`, limit {RATIO}", held=ratio <= RATIO)
        missed |= judged(f"memory {memory >> 20} MiB, limit {MEMORY >> 20}", held=memory <= MEMORY)
        if CHROMIUM is not None:
            drawn = min(picture_s(page) for _ in range(RUNS))
            missed |= judged(
                f"first picture {drawn:.2f} s after the navigation, limit {PICTURE_S}", held=drawn <= PICTURE_S
            )
    return int(missed)


if __name__ == "__main__":
    sys.exit(main())
