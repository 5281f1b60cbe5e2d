"""A host of an agent: from the start of `rtshcua mcp` to the answer to its greeting, its first call of a tool after a
while, and later ones, in both generations of the protocol; beside the import of the SDK alone, in turns.

Exits with 1 when a median is above its limit.
"""

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
POLICY = ROOT / "policies/bridge_inspection.rts"
MISSION = ROOT / "missions/proposal.json"
LIMITS_MS = {"answer to the greeting": 600, "first call": 60, "later call": 20, "later check of a mission": 20}
ROUNDS, CALLS = 7, 20
#: how long a model takes at least until it calls a tool, in s
THINKS_S = 2.5
ENVELOPE = {"io.modelcontextprotocol/protocolVersion": "2026-07-28", "io.modelcontextprotocol/clientCapabilities": {}}
OLD = {"protocolVersion": "2025-11-25", "capabilities": {}, "clientInfo": {"name": "bench", "version": "1"}}


class Host:
    """A server over its streams, with requests of one generation of the protocol."""

    def __init__(self, command: list[str], environment: dict[str, str], *, stateless: bool) -> None:
        self._more = {"_meta": ENVELOPE} if stateless else {}
        self._number = 0
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environment
        )
        if stateless:
            self.ask("server/discover")
            return
        self.ask("initialize", **OLD)
        self._say({"method": "notifications/initialized"})

    def _say(self, message: dict[str, Any]) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps({"jsonrpc": "2.0"} | message).encode() + b"\n")
        self.process.stdin.flush()

    def ask(self, method: str, **params: Any) -> Any:
        """Return the result of a request."""
        self._number += 1
        self._say({"id": self._number, "method": method, "params": params | self._more})
        assert self.process.stdout is not None
        return json.loads(self.process.stdout.readline())["result"]

    def call(self, tool: str, **arguments: Any) -> float:
        """Return how long a call of a tool takes, in ms."""
        begun = time.perf_counter()
        found = self.ask("tools/call", name=tool, arguments=arguments)
        assert not found.get("isError"), found
        return (time.perf_counter() - begun) * 1e3

    def end(self) -> None:
        """End the server by the end of its input."""
        self.process.communicate()


@contextmanager
def prepared() -> Iterator[tuple[list[str], dict[str, str]]]:
    """Make keys and a bundle; yield the server's command and environment."""
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"RTSHCUA_DATA_DIR": f"{folder}/data", "PYTHONPATH": str(ROOT)}
        ours, bundle = [sys.executable, "-m", "rtshcua"], f"{folder}/base.bundle"
        for words in (["keys", "init"], ["compile", str(MISSION), "--with", str(POLICY), "-o", bundle]):
            subprocess.run([*ours, *words], env=environment, check=True, capture_output=True)
        yield [*ours, "mcp", bundle, "--to", f"{folder}/none.sock", "--with", str(POLICY)], environment


def measured(command: list[str], environment: dict[str, str], *, stateless: bool) -> list[float]:
    """Return what is limited, in ms, of one server."""
    begun = time.perf_counter()
    host = Host(command, environment, stateless=stateless)
    greeted_ms = (time.perf_counter() - begun) * 1e3
    mission = json.loads(MISSION.read_text(encoding="utf-8"))
    time.sleep(THINKS_S)
    first_ms = host.call("describe_policy")
    later = statistics.median(host.call("describe_policy") for _ in range(CALLS))
    checks = statistics.median(host.call("check_mission", mission=mission) for _ in range(CALLS))
    host.end()
    return [greeted_ms, first_ms, later, checks]


def sdk_ms() -> float:
    """Return how long the import of the SDK's server alone takes, with the start of Python, in ms."""
    begun = time.perf_counter()
    subprocess.run([sys.executable, "-c", "import mcp.server.lowlevel"], check=True)
    return (time.perf_counter() - begun) * 1e3


def main() -> int:
    """Measure and print; return 1 if a limit is missed."""
    missed = False
    with prepared() as (command, environment):
        measured(command, environment, stateless=False)  # warm-up: byte code and file cache
        for stateless in (False, True):
            rounds = [(*measured(command, environment, stateless=stateless), sdk_ms()) for _ in range(ROUNDS)]
            *medians, sdk = (statistics.median(column) for column in zip(*rounds, strict=True))
            name = "2026-07-28" if stateless else "2025-11-25"
            print(f"agent_host: {name}: to import the SDK's server alone takes {sdk:.0f} ms")
            for (what, limit), median in zip(LIMITS_MS.items(), medians, strict=True):
                held = median <= limit
                missed = missed or not held
                ratio = f", {median / sdk:.2f} times that import" if limit > 100 else ""
                print(
                    f"{'held  ' if held else 'MISSED'} agent_host: {name}: {what} {median:.1f} ms, limit {limit}{ratio}"
                )
    return int(missed)


if __name__ == "__main__":
    sys.exit(main())
