"""Logs of a small fleet, and the expected answers of an archive, computed from the lines by hand."""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from reference import generated_logs
from rtshcua.adapters.archive.adding import VerificationOptions
from rtshcua.adapters.archive.entry import RECORDS
from rtshcua.adapters.archive.examine import VerifierProcesses

NOW_US = 1_760_000_000_000_000
CHECK = VerificationOptions(generated_logs.ROOT_KEY, RECORDS, NOW_US, VerifierProcesses(1))
SKILLS = ("takeoff", "goto", "return_home")  # of the steps of the short mission


def write_fleet(folder: Path) -> None:
    """Logs of two vehicles, three flights each, the last under version 8; the last of `quad-08` was never closed."""
    for vehicle in ("quad-07", "quad-08"):
        before = None
        for flight in range(3):
            before = generated_logs.write(
                folder / f"{vehicle}-{flight}.jsonl", vehicle, flight, records=300, before=before,
                version=8 if flight == 2 else 7, ending=None if (vehicle, flight) == ("quad-08", 2) else "completed",
            )  # fmt: skip


def records(log: Path) -> list[dict[str, Any]]:
    """Return the records that are covered by a signature: all of a closed log, else those up to the last one."""
    found = [json.loads(line) for line in log.read_bytes().splitlines()]
    last = max(number for number, record in enumerate(found) if "checkpoint" in record)
    return found[: last + 1]


def refused(logs: Iterable[Path]) -> list[tuple[object, ...]]:
    """(UTC, vehicle, skill, outcome, reason, clause, version, record) of every decision that was not `allow`."""
    return sorted(
        (
            record["utc_us"], record["context"]["vehicle"], SKILLS[record["step"]], record["outcome"],
            record["reason"], record["clause"], record["context"]["policy_version"], record["seq"],
        )
        for log in logs
        for record in records(log)
        if record["type"] == "decision" and record["outcome"] != "allow"
    )  # fmt: skip
