#!/bin/sh
# mcp 2.3.0: a tool's misspelt argument is dropped and its default taken, and a text or `true` counts as a number.
# Expected: an answer that says so, since the schema that the server publishes has `integer` and names each argument, and a model
# that misspells `height_m` should be told. The published schema does not say `additionalProperties: false`, so a client that
# validates accepts the call, too.
# Seen: `climb` with `{"hight_m": 50}` runs with its default 3; with `{"height_m": "7"}` and `{"height_m": true}` it runs with the
# whole numbers 7 and 1; no answer is an error.
. "$(dirname "$0")/run.inc"
packages mcp==2.3.0
python - <<'END'
import asyncio

from mcp import Client
from mcp.server import MCPServer

server = MCPServer("finding")


@server.tool()
def climb(height_m: int = 3) -> str:
    """Climb."""
    return repr(height_m)


async def main() -> None:
    async with Client(server) as client:
        (tool,) = (await client.list_tools()).tools
        found = []
        for arguments in ({"hight_m": 50}, {"height_m": "7"}, {"height_m": True}):
            answer = await client.call_tool("climb", arguments)
            found.append((arguments, answer.is_error, answer.content[0].text))
            print("mcp 2.3.0:", *found[-1])
        print("additionalProperties:", tool.input_schema.get("additionalProperties"))
        assert [each[1:] for each in found] == [(False, "3"), (False, "7"), (False, "1")], "it has changed"
        assert "additionalProperties" not in tool.input_schema, "it has changed"


asyncio.run(main())
END
