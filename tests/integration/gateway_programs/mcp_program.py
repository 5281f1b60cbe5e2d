"""An MCP host: `mcp_program.py ACTIONS COMMAND...` starts the server COMMAND and calls its tools one after the other.

ACTIONS is a JSON list, such as [["takeoff", {"altitude_m": 8}]]. With a tool as third item, that one is called each
second while the first one runs, until its answer has the text in it that is the fourth, as by an agent that asks
meanwhile. For each action it prints one JSON line with the texts of the answers. It imports no code of the project.
"""

import asyncio
import json
import os
import sys
from contextlib import suppress
from typing import Any

from mcp import ClientSession, StdioServerParameters
from mcp.client.stdio import stdio_client

LIMIT_S = 150.0


async def call(session: ClientSession, tool: str, arguments: dict[str, Any]) -> str:
    """The text that a tool answers."""
    answer = await session.call_tool(tool, arguments)
    return " ".join(part.text for part in answer.content if part.type == "text")


async def main() -> None:
    """Carry out the actions."""
    paths = {"PYTHONPATH": os.environ.get("PYTHONPATH", "")}  # what the server inherits is a short list
    server = StdioServerParameters(command=sys.argv[2], args=sys.argv[3:], env=paths)
    async with stdio_client(server) as streams, ClientSession(*streams) as session, asyncio.timeout(LIMIT_S):
        await session.initialize()
        for tool, arguments, *meanwhile in json.loads(sys.argv[1]):
            reads: list[str] = []
            running = asyncio.create_task(call(session, tool, arguments))
            while meanwhile and not running.done() and not any(meanwhile[1] in each for each in reads):
                await asyncio.sleep(1.0)
                reads.append(await call(session, meanwhile[0], {}))
            if not meanwhile:
                reads.append(await running)
            print(json.dumps({"action": tool, "reads": reads}), flush=True)
            running.cancel()
            with suppress(asyncio.CancelledError):
                await running


if __name__ == "__main__":
    asyncio.run(main())
