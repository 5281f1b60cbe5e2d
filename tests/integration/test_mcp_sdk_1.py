"""A host of version 1 of the SDK, which knows the protocol of 2025-11-25 alone, checks, proposes, follows, replans and
cancels.
"""

import json
import os
import socket
import subprocess
import sys
import tempfile
from copy import deepcopy
from hashlib import sha256
from pathlib import Path
from typing import Any

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]
PROPOSAL = json.loads((CHECKOUT / "missions/proposal.json").read_text("utf-8"))
#: its packages, with version 1 of the SDK, in a folder of their own
PACKAGES = CHECKOUT / "build/gateway-clients"
PROGRAM = Path(__file__).parent / "gateway_programs/mcp_program.py"

pytestmark = [
    pytest.mark.clients,
    pytest.mark.long,
    pytest.mark.skipif(not PACKAGES.exists(), reason="`make clients` installs version 1 of the SDK"),
]


def until_ready(place: str) -> None:
    """Wait for a line of the waiting vehicle that says so."""
    with socket.socket(socket.AF_UNIX) as link:
        link.settimeout(60)
        link.connect(place)
        with link.makefile("rb") as lines:
            assert any(json.loads(line).get("ready") is True for line in lines)


def test_host_of_version_1_flies(ground: Any) -> None:
    (ground.folder / "base.json").write_text(json.dumps(PROPOSAL))
    policy = str(CHECKOUT / "policies/bridge_inspection.rts")
    assert ground.start("compile", "base.json", "--with", policy, "-o", "base.bundle").process.wait(60) == 0
    shorter = deepcopy(PROPOSAL)
    shorter["phases"][1]["steps"].pop()
    with tempfile.TemporaryDirectory(dir="/tmp") as folder:
        place = f"{folder}/s"
        run = ground.run("base.bundle", "--wait", "--agent-socket", place, speed=5)
        run.until("waiting")
        until_ready(place)
        first, second = (sha256(key.encode()).hexdigest()[:16] for key in ("one", "two"))
        actions = [
            ["describe_vehicle", {}],
            ["check_mission", {"mission": PROPOSAL}],
            ["propose_mission", {"mission": PROPOSAL, "idempotency_key": "one"}],
            ["mission_status", {"ticket": first, "wait_s": 20}],
            ["replan", {"mission": shorter, "from_step_number": 3, "idempotency_key": "two"}],
            ["mission_status", {"ticket": second, "wait_s": 20}],
            ["cancel", {}],
            ["mission_status", {"ticket": first, "wait_s": 60}],
            ["mission_status", {"ticket": first, "wait_s": 60}],
        ]
        server = ["env", "-u", "PYTHONPATH", f"RTSHCUA_DATA_DIR={ground.environment['RTSHCUA_DATA_DIR']}",
                  f"PYTHONPATH={CHECKOUT}", sys.executable, "-m", "rtshcua", "mcp", "base.bundle", "--to", place,
                  "--with", policy]  # fmt: skip
        host = subprocess.run(
            [sys.executable, PROGRAM, json.dumps(actions), *server], cwd=ground.folder, capture_output=True,
            text=True, timeout=200, check=False, env=os.environ | {"PYTHONPATH": str(PACKAGES)},
        )  # fmt: skip
        assert host.returncode == 0, host.stderr
        answers = [json.loads(json.loads(line)["reads"][0]) for line in host.stdout.splitlines()]
        assert answers[1]["accepted"]
        assert answers[2]["ticket"] == first
        assert answers[3]["state"] == "admitted", answers[3]
        assert answers[4]["accepted"], answers[4]
        assert answers[5]["state"] == "admitted", answers[5]
        assert answers[6]["accepted"], answers[6]
        assert run.end().code == 6, run.stderr
    verified = ground.start("verify-log", "--audit", str(run.folder), "--json").end()
    assert verified.code == 0, verified.events
