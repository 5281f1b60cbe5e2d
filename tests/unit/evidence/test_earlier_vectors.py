"""A log of an earlier version is refused by name, never read as one of this version."""

import json
from pathlib import Path

import pytest

from rtshcua.evidence.verify import verify
from rtshcua.ground.audit.audit import audit

FOLDER = Path(__file__).parents[2] / "vectors"


@pytest.mark.parametrize("version", [1, 2, 3])
def test_a_log_of_an_earlier_version_is_refused_by_name(version: int) -> None:
    folder = FOLDER / f"log-{version}"
    lines = (folder / "closed.jsonl").read_bytes().splitlines(keepends=True)
    pinned = bytes.fromhex(json.loads((folder / "keys.json").read_text())["root"]["public"])
    for failure in (verify(lines).failure, audit(lines, pinned).report.failure):
        assert failure is not None
        assert (failure.slug, failure.found) == ("genesis/format", f"rtshcua/log version {version}")
