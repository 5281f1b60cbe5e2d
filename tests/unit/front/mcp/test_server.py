"""The server with the SDK's client in one process, in both generations of the protocol."""

import json
import os
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

pytest.importorskip("mcp", reason="the extra `mcp` is not installed: `make setup` installs it")
import anyio
import mcp_types as types
from mcp import Client
from mcp_types.version import HANDSHAKE_PROTOCOL_VERSIONS, MODERN_PROTOCOL_VERSIONS

from rtshcua.app.propose import NoPolicy
from rtshcua.front.mcp.greeting import HANDSHAKE_VERSIONS, STATELESS_VERSIONS, Greeted, answer_to, greet
from rtshcua.front.mcp.server import Opening, made
from rtshcua.front.mcp.stdio import streams
from rtshcua.front.mcp.tools import Tools
from unit.front.mcp.test_flight_progress import LOW, awaited, own
from unit.front.mcp.test_stdio import pipes
from unit.front.mcp.test_tools import flying, status

BOTH = pytest.mark.parametrize("mode", ["legacy", "2026-07-28"])


def served(tools: Any, mode: Any, work: Callable[[Client], Awaitable[None]], **options: Any) -> None:
    async def run() -> None:
        async with anyio.create_task_group() as others:
            server = made(Opening(lambda: tools), others, anyio.Event())
            async with Client(server, mode=mode, **options) as client:
                await work(client)
            others.cancel_scope.cancel()

    anyio.run(run)


def answered(tools: Any, *requests: dict[str, Any], begun: Greeted | None = None) -> list[dict[str, Any]]:
    """What the SDK answers to a host that sends these and ends; or to one that was greeted already."""

    async def run(ours_in: int, ours_out: int) -> None:
        async with (
            streams(ours_in, ours_out, begun or Greeted()) as (incoming, outgoing, leaving),
            anyio.create_task_group() as others,
        ):
            server = made(Opening(tools if callable(tools) else lambda: tools), others, leaving)
            await server.run(incoming, outgoing, server.create_initialization_options())
            others.cancel_scope.cancel()

    with pipes() as (says, hears, ours_in, ours_out):
        os.write(says, b"".join(json.dumps(each).encode() + b"\n" for each in requests))
        os.close(says)
        anyio.run(run, ours_in, ours_out)
        os.close(ours_out)
        return [json.loads(line) for line in iter(lambda: hears_line(hears), b"")]


def hears_line(hears: int) -> bytes:
    line = b""
    while not line.endswith(b"\n") and (more := os.read(hears, 1)):
        line += more
    return line


def waiting(desk: Tools) -> str:
    """Have a step of a flight wait for an approval; the ticket of its mission."""
    ticket: str = desk.propose_mission(LOW, "one")["ticket"]
    assert status(desk, ticket) == "admitted"
    flying(desk)
    desk.following.records.append(own(desk, awaited(7)))
    return ticket


@pytest.mark.parametrize("action", ["accept", "decline", "cancel"])
def test_a_question_is_shown_and_its_answer_is_no_approval(desk: Tools, handed: list[bytes], action: Any) -> None:
    ticket, shown = waiting(desk), list[str]()

    async def asked(_: Any, question: types.ElicitRequestParams) -> types.ElicitResult:
        shown.append(question.message)
        return types.ElicitResult(action=action, content={} if action == "accept" else None)

    async def work(client: Client) -> None:
        for _ in range(2):
            found = await client.call_tool("mission_status", {"ticket": ticket})
            assert found.structured_content["approval"]["step_number"] == 3, "it waits as before"

    served(desk, "2026-07-28", work, elicitation_callback=asked)
    assert len(shown) == 1
    assert "inspect_area(area = bridge_b" in shown[0]
    assert len(handed) == 1, "the mission, and nothing that a host said"


def test_a_host_that_shows_no_questions_reads_the_status(desk: Tools, handed: list[bytes]) -> None:
    ticket = waiting(desk)

    async def work(client: Client) -> None:
        found = await client.call_tool("mission_status", {"ticket": ticket, "wait_s": 0})
        assert found.structured_content["approval"]["roles"] == ["supervisor"]

    for mode in ("2026-07-28", "legacy"):
        served(desk, mode, work)


CLIENT = {"name": "a host", "version": "1"}
DISCOVER = "server/discover"
ENVELOPE = {"io.modelcontextprotocol/protocolVersion": "2026-07-28", "io.modelcontextprotocol/clientCapabilities": {}}


def initialize(version: Any = "2025-11-25", able: Any = None, client: Any = CLIENT, **more: Any) -> dict[str, Any]:
    params = {"protocolVersion": version, "capabilities": able or {}, "clientInfo": client} | more
    return {"jsonrpc": "2.0", "id": 0, "method": "initialize", "params": params}


def discover(**more: Any) -> dict[str, Any]:
    return {"jsonrpc": "2.0", "id": "d", "method": DISCOVER, "params": {"_meta": ENVELOPE | more}}


@pytest.mark.parametrize(
    "request_",
    [
        *(initialize(version) for version in (*HANDSHAKE_VERSIONS, "1999-01-01", "")),
        initialize(able={"roots": {"listChanged": True}, "sampling": {}, "elicitation": {}}),
        initialize(client=CLIENT | {"title": "A host"}),
        discover(),
        discover(**{"io.modelcontextprotocol/clientInfo": CLIENT}),
        discover(**{"io.modelcontextprotocol/clientCapabilities": {"elicitation": {}}}),
    ],
)
def test_a_greeting_is_answered_as_the_sdk_answers_it(desk: Tools, request_: dict[str, Any]) -> None:
    (told,) = answered(desk, request_)
    assert told == {"jsonrpc": "2.0", "id": request_["id"], "result": answer_to(request_)}


@pytest.mark.parametrize(
    "request_",
    [
        initialize(7), initialize(client={"name": 7, "version": "1"}), initialize(client={"name": "a"}),
        initialize(able={"roots": 5}), initialize(able={"elicitation": {"form": {}}}), initialize(_meta={"x": 1}),
        initialize() | {"params": {}}, discover(**{"io.modelcontextprotocol/protocolVersion": "2030-01-01"}),
        discover(**{"io.modelcontextprotocol/clientCapabilities": []}), discover(progressToken=1),
        {"id": 1, "method": "tools/list"}, {"id": 1, "method": DISCOVER, "params": []}, {"method": "initialize"}, {},
        {"id": 1, "result": {}},
    ],
)  # fmt: skip
def test_any_other_first_message_is_left_to_the_sdk(request_: dict[str, Any]) -> None:
    assert answer_to(request_) is None


def test_the_versions_are_those_of_the_sdk() -> None:
    assert (HANDSHAKE_VERSIONS, STATELESS_VERSIONS) == (HANDSHAKE_PROTOCOL_VERSIONS, MODERN_PROTOCOL_VERSIONS)


def greeted(said: bytes) -> tuple[Greeted, bytes]:
    with pipes() as (says, hears, ours_in, ours_out):
        os.write(says, said)
        os.close(says)
        begun = greet(ours_in, ours_out)
        os.close(ours_out)
        return begun, b"".join(iter(lambda: os.read(hears, 1 << 16), b""))


@pytest.mark.parametrize("request_", [initialize(), discover()])
def test_a_greeted_host_goes_on_as_if_the_sdk_had_answered(desk: Tools, request_: dict[str, Any]) -> None:
    listed = {"jsonrpc": "2.0", "id": 1, "method": "tools/list", "params": {"_meta": ENVELOPE}}
    if request_["method"] == "initialize":
        listed["params"] = {}
    notified = {"jsonrpc": "2.0", "method": "notifications/initialized"}
    lines = [json.dumps(each).encode() + b"\n" for each in (request_, notified, listed)]
    begun, told = greeted(lines[0] + lines[1][:9])
    assert json.loads(told)["id"] == request_["id"]
    assert begun.octets.endswith(lines[1][:9])
    begun = begun._replace(octets=begun.octets + lines[1][9:] + lines[2])
    (answer,) = answered(desk, begun=begun)
    assert (answer["id"], len(answer["result"]["tools"])) == (1, 9)


@pytest.mark.parametrize(
    "said", [b"", b"\n\n", b"{", b"[]\n", b'{"jsonrpc":"2.0","id":1,"method":"ping"}\n{}', b"x" * 40_000]
)
def test_what_is_no_greeting_is_read_again(said: bytes) -> None:
    begun, told = greeted(said)
    assert told == b""
    assert (begun.answered, said.startswith(begun.octets)) == (None, True)
    assert begun.octets or not said


class _Faulty:
    """Tools that fail."""

    misused = type("Misused", (Exception,), {})

    def describe_vehicle(self) -> Any:
        raise LookupError("a path /root/x")


@BOTH
def test_a_fault_is_told_as_that(mode: str) -> None:
    async def work(client: Client) -> None:
        found = await client.call_tool("describe_vehicle", {})
        assert found.is_error
        assert found.structured_content["code"] == "fault"
        assert "LookupError" in found.structured_content["text"]
        assert "/root" not in json.dumps(found.structured_content)

    served(_Faulty(), mode, work)


def test_a_server_without_tools_says_why_and_goes_on() -> None:
    """Regression: a subscription ended the server, and of a policy with errors a host was told nothing."""

    def none() -> Any:
        raise NoPolicy("the policy's sources have errors: E0101")

    notified = {"jsonrpc": "2.0", "method": "notifications/initialized"}
    asked = [
        {"method": "resources/subscribe", "params": {"uri": "rtshcua://flight"}},
        {"method": "resources/read", "params": {"uri": "rtshcua://policy"}},
        {"method": "tools/call", "params": {"name": "describe_policy", "arguments": {}}},
        {"method": "tools/list", "params": {}},
    ]
    requests = [{"jsonrpc": "2.0", "id": number, **each} for number, each in enumerate(asked, 1)]
    told = {each["id"]: each for each in answered(none, initialize(), notified, *requests)}
    for number in (1, 2):
        assert "the policy's sources have errors: E0101" in told[number]["error"]["message"]
    refused = told[3]["result"]
    assert refused["isError"]
    assert (refused["structuredContent"]["code"], "E0101" in refused["structuredContent"]["text"]) == ("no-tools", True)
    assert len(told[4]["result"]["tools"]) == 9


def test_a_listener_without_tools_hears_nothing_and_ends_nothing() -> None:
    def none() -> Any:
        raise NoPolicy("errors")

    listens = {"notifications": {"resourceSubscriptions": ["rtshcua://flight"]}, "_meta": ENVELOPE}
    asked = {"name": "describe_policy", "arguments": {}, "_meta": ENVELOPE}
    told = answered(
        none,
        {"jsonrpc": "2.0", "id": "l", "method": "subscriptions/listen", "params": listens},
        {"jsonrpc": "2.0", "id": 2, "method": "tools/call", "params": asked},
        {"jsonrpc": "2.0", "method": "notifications/cancelled", "params": {"requestId": "l", "_meta": ENVELOPE}},
    )
    assert [each["result"]["structuredContent"]["code"] for each in told if each.get("id") == 2] == ["no-tools"]


@BOTH
@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ({"ticket": "t", "wait": 5}, "unknown argument `wait`"),
        ({"ticket": "t", "wait_s": "7"}, "`wait_s` must be a whole number, not a text"),
        ({"ticket": "t", "wait_s": True}, "`wait_s` must be a whole number, not true or false"),
        ({"ticket": 7}, "`ticket` must be a text, not a number"),
        ({"ticket": "t", "more": 1}, "`more` must be true or false, not a number"),
        ({"ticket": "t", "more": "true"}, "`more` must be true or false, not a text"),
        ({}, "the argument `ticket` is missing"),
        (None, "the argument `ticket` is missing"),
    ],
)
def test_arguments_are_held_to_their_schema(desk: Tools, mode: str, arguments: Any, told: str) -> None:
    async def work(client: Client) -> None:
        found = await client.call_tool("mission_status", arguments)
        assert found.is_error
        assert (found.structured_content["code"], found.structured_content["text"]) == ("arguments", told)

    served(desk, mode, work)
