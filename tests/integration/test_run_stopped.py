"""A run that is stopped (SIGSTOP) for longer than an epoch and continued, over UDP."""

import signal
import time
from typing import Any

import pytest

from virtual.sampling import each_once

SPEED = 10
#: so many seconds of flight: an epoch lasts 20 at most, and on a busy machine the vehicle flies slower than it is asked
STOPPED_S = 60


@pytest.mark.slow
@pytest.mark.parametrize(("flavour", "mode"), each_once(("px4", "ardupilot"), ("software", "process")))
def test_stopped_run_records_a_gap_in_a_valid_log(ground: Any, flavour: str, mode: str) -> None:
    """The case: stopped in flight; the seal comes late, and nobody is accused. What `run` calls whole verifies."""
    run = ground.run(ground.bundle(), "--mode", mode, "--flavour", flavour, speed=SPEED)
    run.until("dispatched", step=1)
    run.signal(signal.SIGSTOP)
    time.sleep(STOPPED_S / SPEED)  # that it stands still for so long is what is tried
    run.signal(signal.SIGCONT)
    run.end()
    log = run.log()
    (gap,) = [record for record in log if record.get("event") == "stalled"]
    silent_us = gap["at_us"] - log[gap["seq"] - 1]["at_us"]
    assert gap["detail"] == f"{silent_us} us"
    assert silent_us > 20_000_000
    assert run.summary["whole"]
    assert run.summary["gaps_us"] >= silent_us
    for words in ((), ("--fast",), ("--audit",)):
        verified = ground.start("verify-log", *words, str(run.folder), "--json").end()
        assert verified.code == 0, verified.events
        (said,) = verified.events
        (told,) = [each for each in said["gaps"] if each["us"] == silent_us]
        assert told["signed"] is not None
        assert told["boundary"] is not None or "--audit" not in words
        assert any(claim["slug"] == "gap" for claim in said["unproven"])


@pytest.mark.slow
def test_altered_log_is_reported(ground: Any) -> None:
    """The log was altered during the flight, as by a defective card. The run verifies it before it reports success."""
    run = ground.run(ground.bundle(), speed=SPEED)
    run.until("dispatched", step=1)
    log = run.folder / "log.jsonl"
    with log.open("r+b") as file:
        file.seek(log.stat().st_size - 100)
        file.write(b"#")
    run.end()
    assert run.code == 9, run.stderr
    assert not run.summary["whole"]
    (missing,) = run.summary["missing"]
    assert missing.startswith("`verify-log` refuses it: ")
    assert ground.start("verify-log", str(run.folder), "--json").end().code == 9
