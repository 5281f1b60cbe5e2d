"""The Model Context Protocol over standard streams and HTTP: tools, resources, progress and subscriptions.

Both generations are served: 2025-11-25 and older, which begin with `initialize`, and 2026-07-28, in which each request
stands for itself. Only this module and `stdio` use the SDK.
"""

import logging
import socket
import threading
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any, Final

import anyio
import mcp_types as types
import uvicorn
from anyio.abc import TaskGroup
from anyio.to_thread import run_sync
from mcp.server.context import ServerRequestContext
from mcp.server.lowlevel import Server
from mcp.server.streamable_http_manager import StreamableHTTPSessionManager
from mcp.server.subscriptions import InMemorySubscriptionBus, ListenHandler, ResourceUpdated
from mcp.shared.exceptions import MCPError
from mcp_types.version import MODERN_PROTOCOL_VERSIONS

from rtshcua import __version__
from rtshcua.front.mcp.access import refusal
from rtshcua.front.mcp.arguments import Unfit, fitted
from rtshcua.front.mcp.connections import CONNECTION, MOST, Connection
from rtshcua.front.mcp.greeting import INSTRUCTIONS, Greeted
from rtshcua.front.mcp.http_bodies import Bodies
from rtshcua.front.mcp.messages import writable
from rtshcua.front.mcp.stdio import streams

#: interval of progress reports of a waiting `mission_status`, s
_TOLD_S: Final = 0.25
_MISSION: Final = {
    "type": "object",
    "description": "A mission specification. Its JSON Schema is the resource rtshcua://schema.",
}
_KEY: Final = {
    "type": "string",
    "description": "Unique for each proposal; a call with a used key does not propose again.",
}
_READS: Final = types.ToolAnnotations(read_only_hint=True, open_world_hint=False)
_ACTS: Final = types.ToolAnnotations(
    read_only_hint=False, destructive_hint=False, idempotent_hint=True, open_world_hint=False
)
_ENDS: Final = types.ToolAnnotations(
    read_only_hint=False, destructive_hint=True, idempotent_hint=True, open_world_hint=False
)
_RESOURCES: Final = {"policy": "describe_policy", "schema": "schema", "log": "read_evidence", "flight": "flight"}
#: resources that change, to which a host can subscribe
_CHANGING: Final = frozenset({"log", "flight"})
#: the header of a session of 2025-11-25
_SESSION: Final = "mcp-session-id"
_Context = ServerRequestContext[Any, Any]
#: maximum number of HTTP sessions, and their idle time, s
_MOST_SESSIONS: Final = 8
_IDLE_S: Final = 1_800.0
#: maximum number of subscriptions of all hosts; a new one replaces the oldest
_MOST_FOLLOWED: Final = 32


def _tool(
    name: str, what: str, acts: types.ToolAnnotations = _READS, required: tuple[str, ...] = (), **fields: Any
) -> types.Tool:
    schema = {"type": "object", "properties": fields, "required": list(required), "additionalProperties": False}
    return types.Tool(name=name, description=what, input_schema=schema, annotations=acts)


TOOLS: Final = (
    _tool("describe_vehicle", "Get the vehicle's stage (waiting, flying, ended, unreachable) and its state."),
    _tool("describe_policy", "Get what the policy permits: skills with their ranges, zones, roles and rules."),
    _tool(
        "check_mission", "Check a mission against the policy. Nothing is signed or sent.",
        required=("mission",), mission=_MISSION,
    ),
    _tool(
        "propose_mission", "Check a mission, sign it as an agent's, and send it to the vehicle. Returns a ticket.",
        _ACTS, ("mission", "idempotency_key"), mission=_MISSION, idempotency_key=_KEY,
    ),
    _tool(
        "mission_status",
        "Get how a proposal and its flight stand, and what changed since the last call, in few words. With wait_s, "
        "wait at most that long for a change.",
        required=("ticket",), ticket={"type": "string"}, wait_s={"type": "integer", "minimum": 0, "maximum": 60},
        since={"type": "integer", "minimum": -1, "description": "Tell changes after this record instead."},
        more={"type": "boolean", "description": "Tell everything: all events, the rule, the clause."},
    ),
    _tool(
        "explain_decision", "Explain the decision on a step: its inputs, their ages, and values that would pass.",
        record={"type": "integer", "description": "Number of the record; default: the last that was not `allow`."},
    ),
    _tool(
        "replan", "Replace the steps that have not been released. Pass the whole new mission.",
        _ACTS, ("mission", "from_step_number", "idempotency_key"), mission=_MISSION,
        from_step_number={
            "type": "integer", "minimum": 1,
            "description": "Number of the first replaced step. Steps are numbered from 1.",
        },
        idempotency_key=_KEY,
    ),
    _tool("cancel", "Cancel the flying mission: no further step begins; the contingency flies.", _ENDS),
    _tool(
        "read_evidence", "Read unverified records of the flight's log. Each has an added `step_number`, from 1.",
        first={"type": "integer", "minimum": 0}, count={"type": "integer", "minimum": 1, "maximum": 100},
    ),
)  # fmt: skip


class Opening:
    """The tools, made in a separate thread; a call waits until they are ready."""

    def __init__(self, make: Callable[[], Any]) -> None:
        self._done = threading.Event()
        self._made: Any = None
        self._wrong: Exception | None = None
        self._thread = threading.Thread(target=self._run, args=(make,), daemon=True)
        self._lock = threading.Lock()

    def begin(self) -> None:
        """Start to make the tools, unless started."""
        with self._lock:
            if self._thread.ident is None:
                self._thread.start()

    def get(self) -> Any:
        """Return the tools, when they are ready. Raises the error that making them raised."""
        self.begin()
        self._done.wait()
        if self._wrong is not None:
            raise self._wrong
        return self._made

    def _run(self, make: Callable[[], Any]) -> None:
        try:
            self._made = make()
        except Exception as error:  # noqa: BLE001  reported to the caller of a tool
            self._wrong = error
        finally:
            self._done.set()


async def _tools(opening: Opening) -> Any:
    """Return the tools. Raises MCPError where they cannot be made: of other errors the SDK tells a host nothing."""
    try:
        return await run_sync(opening.get)
    except Exception as error:
        raise MCPError(code=types.INTERNAL_ERROR, message=f"the server has no tools: {error}") from error


def serve(make: Callable[[], Any], begun: Greeted) -> None:
    """Serve the standard streams until the host ends the session. `make` returns the tools (`tools.Tools`)."""
    _quieten()
    anyio.run(_speak, Opening(make), begun)


def _quieten() -> None:
    """Suppress the SDK's log of invalid messages on standard error, which the host may show."""
    logging.getLogger("mcp").setLevel(logging.CRITICAL)
    logging.getLogger().addFilter(lambda _: False)  # the SDK logs to the root logger itself


async def _speak(opening: Opening, begun: Greeted) -> None:
    opening.begin()
    async with streams(0, 1, begun) as (incoming, outgoing, leaving), anyio.create_task_group() as others:
        server = made(opening, others, leaving)
        await server.run(incoming, outgoing, server.create_initialization_options())
        others.cancel_scope.cancel()


def serve_http(make: Callable[[], Any], listener: socket.socket, token: bytes) -> None:
    """Serve streamable HTTP on a listening socket of this machine, until a signal ends it."""
    _quieten()
    logging.getLogger("uvicorn.error").setLevel(logging.ERROR)  # it warns about every malformed request
    anyio.run(_speak_http, Opening(make), listener, token)


async def _speak_http(opening: Opening, listener: socket.socket, token: bytes) -> None:
    opening.begin()
    port = listener.getsockname()[1]
    async with anyio.create_task_group() as others:
        manager = StreamableHTTPSessionManager(
            made(opening, others, anyio.Event()), max_sessions=_MOST_SESSIONS, session_idle_timeout=_IDLE_S
        )

        bodies = Bodies(manager.handle_request)

        async def answer(scope: dict[str, Any], receive: Any, send: Any) -> None:
            refused = refusal(scope["path"], scope["headers"], token, port)
            if refused is None:
                scope["state"][CONNECTION].admit()
                await bodies.answer(scope, receive, send)
                return
            headers = [(b"content-length", b"0"), *([(b"www-authenticate", b"Bearer")] if refused == 401 else [])]
            await send({"type": "http.response.start", "status": refused, "headers": headers})
            await send({"type": "http.response.body", "body": b""})

        settings = uvicorn.Config(
            answer, http=Connection, lifespan="off", ws="none", log_config=None, access_log=False, server_header=False,
            backlog=MOST, timeout_graceful_shutdown=1,
        )  # fmt: skip
        async with manager.run():
            await uvicorn.Server(settings).serve(sockets=[listener])
        others.cancel_scope.cancel()


class _Changes:
    """What hosts are told of resources that change: looked at once for all of them."""

    def __init__(self, opening: Opening, others: TaskGroup) -> None:
        self._opening = opening
        self._others = others
        self._watched = False
        self._bus = InMemorySubscriptionBus()
        self.listen = ListenHandler(self, max_subscriptions=_MOST_FOLLOWED)
        self._following: dict[tuple[str | None, str], anyio.CancelScope] = {}

    def subscribe(self, listener: Callable[[Any], None]) -> Callable[[], None]:
        """Have a listener told of each change; the answer ends it."""
        if not self._watched:
            self._watched = True
            self._others.start_soon(self._watch)
        return self._bus.subscribe(listener)

    async def publish(self, event: Any) -> None:
        """Tell all listeners of a change."""
        await self._bus.publish(event)

    async def begin(self, context: _Context, params: types.SubscribeRequestParams) -> types.EmptyResult:
        """Start a subscription of 2025-11-25. Raises MCPError for a resource that does not change, or without tools."""
        if _resource(params.uri) not in _CHANGING:
            text = "unknown resource, or a resource that does not change"
            raise MCPError(code=types.INVALID_PARAMS, message=text)
        await _tools(self._opening)
        about = self._about(context, params.uri)
        self._end(about)
        while len(self._following) >= _MOST_FOLLOWED:
            self._following.pop(next(iter(self._following))).cancel()
        scope = self._following[about] = anyio.CancelScope()
        await self._others.start(self._tell, context, params.uri, scope)
        return types.EmptyResult()

    async def end(self, context: _Context, params: types.UnsubscribeRequestParams) -> types.EmptyResult:
        """End a subscription of 2025-11-25."""
        self._end(self._about(context, params.uri))
        return types.EmptyResult()

    def _end(self, about: tuple[str | None, str]) -> None:
        scope = self._following.pop(about, None)
        if scope is not None:
            scope.cancel()

    def _about(self, context: _Context, uri: str) -> tuple[str | None, str]:
        """The session, which has no number over standard streams, and the resource."""
        return None if context.request is None else context.request.headers.get(_SESSION), _resource(uri)

    async def _tell(
        self, context: _Context, uri: str, scope: anyio.CancelScope, *, task_status: Any = anyio.TASK_STATUS_IGNORED
    ) -> None:
        """A slow host is told of the latest change only, and delays no other."""
        tells, told = anyio.create_memory_object_stream[None](1)

        def heard(event: Any) -> None:
            if isinstance(event, ResourceUpdated) and _resource(event.uri) == _resource(uri):
                with suppress(anyio.WouldBlock):
                    tells.send_nowait(None)

        end = self.subscribe(heard)
        try:
            with scope, tells, told:
                task_status.started()
                async for _ in told:
                    await context.session.send_resource_updated(uri)
        finally:
            end()

    async def _watch(self) -> None:
        try:
            desk = await _tools(self._opening)
        except MCPError:
            return  # who asks for anything else is told why; nothing changes here
        known = {name: _state(desk, name) for name in _CHANGING}
        while True:
            await anyio.sleep(_TOLD_S)
            for name in sorted(_CHANGING):
                now = _state(desk, name)
                if now != known[name]:
                    known[name] = now
                    await self.publish(ResourceUpdated(uri=f"rtshcua://{name}"))


def _resource(uri: str) -> str:
    return uri.removeprefix("rtshcua://").rstrip("/")


def _state(desk: Any, name: str) -> Any:
    """Return a value that changes whenever the resource changes."""
    records = desk.following.records
    latest = records[-1].get("seq") if records else None
    if name == "log":
        return desk.following.hello.get("flight"), latest
    return desk.following.hello.get("flight"), desk.following.stage, latest, desk.following.mission.get("digest")


def made(opening: Opening, others: TaskGroup, leaving: anyio.Event) -> "Server[Any]":
    """Return a server with the tools and resources; background tasks run in `others`. `leaving` is set when the host
    says nothing more: then a call that waits is answered.
    """
    changes = _Changes(opening, others)
    schemas = {each.name: each.input_schema for each in TOOLS}

    async def listed(_context: _Context, _params: Any) -> types.ListToolsResult:
        return types.ListToolsResult(tools=list(TOOLS))

    async def called(
        context: _Context, params: types.CallToolRequestParams
    ) -> types.CallToolResult | types.InputRequiredResult:
        if params.name not in schemas:
            return _answer({"code": "no-tool", "text": "unknown tool"}, wrong=True)
        try:
            desk = await _tools(opening)
        except MCPError as error:
            return _answer({"code": "no-tools", "text": error.error.message, "repair": "tell the operator"}, wrong=True)
        try:
            arguments = fitted(schemas[params.name], params.arguments or {})
            if params.name == "mission_status":
                return await _status(context, params, desk, leaving, **arguments)
            return _answer(await run_sync(partial(getattr(desk, params.name), **arguments)))
        except desk.misused as error:
            return _answer({"code": error.code, "text": str(error), "repair": error.repair}, wrong=True)
        except Unfit as error:
            return _answer({"code": "arguments", "text": str(error), "repair": error.repair}, wrong=True)
        except Exception as error:  # noqa: BLE001  the SDK would say nothing of it to the host
            text = f"the server has a fault: {type(error).__name__} in `{params.name}`"
            return _answer({"code": "fault", "text": text, "repair": "tell the operator"}, wrong=True)

    async def resources(_context: _Context, _params: Any) -> types.ListResourcesResult:
        return types.ListResourcesResult(
            resources=[
                types.Resource(uri=f"rtshcua://{name}", name=name, mime_type="application/json") for name in _RESOURCES
            ]
        )

    async def read(_context: _Context, params: types.ReadResourceRequestParams) -> types.ReadResourceResult:
        name = _RESOURCES.get(_resource(params.uri))
        if name is None:
            raise MCPError(code=types.INVALID_PARAMS, message="unknown resource")
        desk = await _tools(opening)
        text = writable(await run_sync(getattr(desk, name)))[1]
        contents = types.TextResourceContents(uri=params.uri, text=text, mime_type="application/json")
        return types.ReadResourceResult(contents=[contents])

    server: Server[Any] = Server(
        "rtshcua", version=__version__, instructions=INSTRUCTIONS, get_tool_input_schema=schemas.get,
        on_list_tools=listed, on_call_tool=called, on_list_resources=resources, on_read_resource=read,
        on_subscribe_resource=changes.begin, on_unsubscribe_resource=changes.end,
        on_subscriptions_listen=changes.listen,
    )  # fmt: skip
    server.middleware.clear()  # which passes what hosts say on to a tracer
    return server


async def _status(
    context: _Context, params: types.CallToolRequestParams, desk: Any, leaving: anyio.Event, ticket: str,
    wait_s: int = 0, **asked: Any,
) -> types.CallToolResult | types.InputRequiredResult:  # fmt: skip
    """Return the status at once, or when it changes; report progress meanwhile if the host requested it."""
    first = desk.gist(ticket)
    heard = desk.following.heard
    with anyio.move_on_after(wait_s):
        while desk.gist(ticket) == first and not first[-1] and not leaving.is_set():
            with anyio.move_on_after(_TOLD_S):
                await leaving.wait()
            if desk.following.heard != heard:
                heard = desk.following.heard
                await context.session.report_progress(heard, message=desk.following.stage)
    if context.protocol_version in MODERN_PROTOCOL_VERSIONS and _shows_questions(context):
        question = await run_sync(desk.question, ticket)
        if question is not None:
            return _required(question)
    return _answer(await run_sync(partial(desk.mission_status, ticket, **asked)))


def _shows_questions(context: _Context) -> bool:
    able = context.session.client_capabilities
    return able is not None and able.elicitation is not None


def _required(question: str) -> types.InputRequiredResult:
    """Have the host show its person a question; whatever they answer there, the call is made again, and goes on."""
    form = types.ElicitRequestFormParams(message=question, requested_schema={"type": "object", "properties": {}})
    return types.InputRequiredResult(input_requests={"approval": types.ElicitRequest(params=form)})


def _answer(told: dict[str, Any], *, wrong: bool = False) -> types.CallToolResult:
    told, text = writable(told)
    content: list[types.ContentBlock] = [types.TextContent(type="text", text=text)]
    return types.CallToolResult(content=content, structured_content=told, is_error=wrong)
