"""`rtshcua approve --wait` at a simulated flight: a step is approved at the terminal, another on the page, by HTTP."""

import json
import os
import pty
import re
import select
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from http.client import HTTPConnection
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

from reference.low_source import INSPECTION, low_source
from rtshcua.adapters.agent_socket import hand_in

#: the approvals come within 30 s of flight
SPEED = 4
PATIENCE_S = 200
BOTH = f"{INSPECTION}\n    inspect_area(bridge_a, altitude = 8 m, pattern = perimeter)"


@pytest.fixture
def place() -> Iterator[Path]:
    with tempfile.TemporaryDirectory(dir="/tmp") as name:
        yield Path(name) / "s"


class Terminal:
    """A command at a terminal of its own."""

    def __init__(self, ground: Any, *words: str) -> None:
        self._ours, its = pty.openpty()
        environment = ground.environment | {"COLUMNS": "200"}
        self.process = subprocess.Popen(
            [sys.executable, "-m", "rtshcua", *words], stdin=its, stdout=its, stderr=its, cwd=ground.folder,
            env=environment, start_new_session=True,
        )  # fmt: skip
        os.close(its)
        self.text = ""

    def until(self, words: str) -> None:
        until_s = time.monotonic() + PATIENCE_S
        while words not in self.text:
            assert time.monotonic() < until_s, (words, self.text)
            if select.select([self._ours], [], [], 1)[0]:
                self.text += os.read(self._ours, 1 << 16).decode(errors="replace")

    def type(self, words: str) -> None:
        os.write(self._ours, words.encode())

    def end(self) -> int:
        return self.process.wait(PATIENCE_S)

    def close(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        os.close(self._ours)


def asked(address: str, path: str, body: dict[str, Any], session: str = "") -> tuple[int, dict[str, Any]]:
    """What the page asks of the command."""
    url = urlsplit(address)
    link = HTTPConnection(url.netloc, timeout=30)
    headers = {"Origin": f"http://{url.netloc}", "Content-Type": "application/json"}
    headers["Authorization"] = f"Bearer {session}"
    link.request("POST", path, json.dumps(body), headers)
    answer = link.getresponse()
    told: dict[str, Any] = json.loads(answer.read())
    link.close()
    return answer.status, told


@pytest.fixture
def flying(ground: Any, place: Path) -> Any:
    """A run of a mission with two steps that a supervisor must approve."""
    assert ground.start("keys", "approver", "ada", "--role", "supervisor").process.wait() == 0
    (ground.folder / "low.rts").write_text(low_source(BOTH))
    compiled = ground.start("compile", "low.rts").process
    assert compiled.wait() == 0, compiled.stderr.read()
    run = ground.run("low.bundle", "--operator-socket", str(place), speed=SPEED)
    while not place.exists():
        time.sleep(0.05)
    return run


@pytest.mark.slow
@pytest.mark.long
def test_one_step_is_approved_at_the_terminal_and_one_on_the_page(ground: Any, flying: Any, place: Path) -> None:
    terminal = Terminal(ground, "approve", "low.bundle", "--to", str(place), "--page", "0")
    try:
        terminal.until("type `yes 1`")
        assert "\a" in terminal.text
        found = re.search(r"http://127\.0\.0\.1:\d+/#\S+", terminal.text)
        assert found is not None, terminal.text
        status, opened = asked(found[0], "/open", {"secret": urlsplit(found[0]).fragment})
        assert status == 200
        _, state = asked(found[0], "/state", {"seen": 0}, opened["session"])
        assert (state["stage"], state["question"]["step_number"]) == ("following", 3)
        assert state["question"]["map"].startswith("data:image/svg+xml;base64,")
        terminal.type("yes 1\n")
        terminal.until("approved as supervisor: step 3")
        terminal.until("step 4 waits for supervisor")
        _, state = asked(found[0], "/state", {"seen": 0}, opened["session"])
        question = state["question"]
        assert (question["step_number"], question["number"]) == (4, 2)
        answer = {"nonce": question["nonce"], "granted": True, "other_path": False}
        assert asked(found[0], "/answer", answer, opened["session"])[1]["slug"] == "accepted"
        assert asked(found[0], "/answer", answer, opened["session"])[0] == 409
        assert flying.end().code == 0, flying.stderr
        assert terminal.end() == 0
    finally:
        terminal.close()
    steps = [each for each in flying.dispatched() if each != "hover"]  # while it waits
    assert steps == ["takeoff", "goto", "inspect_area", "inspect_area", "return_home"]
    verified = ground.start("verify-log", "--audit", str(flying.folder), "--json").end()
    assert verified.code == 0, verified.events
    assert [record["event"] for record in flying.log() if record.get("event") == "approval"] == ["approval"] * 2


@pytest.mark.slow
@pytest.mark.long
def test_unanswered_question_lapses_and_ctrl_c_ends_the_command(ground: Any, flying: Any, place: Path) -> None:
    terminal = Terminal(ground, "approve", "low.bundle", "--to", str(place), "--wait", "--json")
    try:
        terminal.until('"event": "question"')
        terminal.until("nobody answered in time")
        terminal.process.send_signal(signal.SIGINT)
        assert terminal.end() == 130
        assert "Traceback" not in terminal.text
    finally:
        terminal.close()
    assert flying.end().code == 6, flying.stderr


@pytest.mark.slow
@pytest.mark.long
def test_step_of_a_mission_that_an_agent_handed_in_is_approved(ground: Any, place: Path) -> None:
    """The approver has the bundle that the vehicle waits with; the mission that flies is in the log."""
    assert ground.start("keys", "approver", "ada", "--role", "supervisor").process.wait() == 0
    for name, work in (("base", "hover(5 s)"), ("low", INSPECTION)):
        (ground.folder / f"{name}.rts").write_text(low_source(work))
        assert ground.start("compile", f"{name}.rts").process.wait() == 0
    agents = place.with_name("a")
    words = ("--wait", "--agent-socket", str(agents), "--operator-socket", str(place))
    run = ground.run("base.bundle", *words, speed=SPEED)
    run.until("waiting")
    terminal = Terminal(ground, "approve", "base.bundle", "--to", str(place), "--wait")
    try:
        terminal.until("questions wait for ada as supervisor")
        assert hand_in(agents, (ground.folder / "low.bundle").read_bytes()).slug == "accepted"
        terminal.until("type `yes 1`")
        assert "inspect_area" in terminal.text
        terminal.type("yes 1\n")
        terminal.until("approved as supervisor: step 3")
        assert run.end().code == 0, run.stderr
        assert terminal.end() == 0
    finally:
        terminal.close()
    assert "inspect_area" in run.dispatched()
