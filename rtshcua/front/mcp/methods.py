"""The methods of the protocol: the SDK answers one that it does not know as if its parameters were wrong."""

from typing import Any, Final

from rtshcua.front.mcp.messages import NO_METHOD, Wrong

#: a name of a method that is told again is no longer than this
_MOST_TOLD: Final = 100

METHODS: Final = frozenset({
    "ping", "initialize", "completion/complete", "logging/setLevel", "prompts/get", "prompts/list", "resources/list",
    "resources/templates/list", "resources/read", "resources/subscribe", "resources/unsubscribe", "tools/call",
    "tools/list", "tasks/get", "tasks/result", "tasks/list", "tasks/cancel",
})  # fmt: skip


def unknown_method(request: dict[str, Any]) -> Wrong | None:
    """The answer to a request whose method the protocol does not have (JSON-RPC 2.0, section 5.1); None for others."""
    method = request.get("method")
    if "id" not in request or not isinstance(method, str) or method in METHODS:
        return None
    return Wrong(NO_METHOD, f"there is no method `{method[:_MOST_TOLD]}`", request["id"])
