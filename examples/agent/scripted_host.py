"""A host without a model: starts the server of a plug-in, proposes one mission, follows it, and says what it is told.

    python examples/agent/scripted_host.py PLUGIN MISSION.json

For trying a set-up out, and as a pattern for a host of your own. It ends with 0 where the mission was completed.
"""

import asyncio
import json
import sys
from pathlib import Path
from typing import Any
from uuid import uuid4

from mcp import Client, StdioServerParameters
from mcp_types import ElicitRequestParams, ElicitResult

#: how long a vehicle is waited for until it is ready, in tries of half a second
TRIES = 240


def say(text: str) -> None:
    """One line, at once."""
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


async def asked(session: Client, tool: str, **arguments: Any) -> dict[str, Any]:
    """What a tool answers."""
    return (await session.call_tool(tool, arguments)).structured_content or {}


async def shown(_: Any, question: ElicitRequestParams) -> ElicitResult:
    """Show its person a question of the server: what is answered here is no approval."""
    say(question.message)
    return ElicitResult(action="accept", content={})


async def fly(session: Client, mission: Any) -> int:
    """Propose a mission once the vehicle is ready, and follow it to its end."""
    for _ in range(TRIES):
        vehicle = await asked(session, "describe_vehicle")
        if (vehicle["untrusted"]["state"] or {}).get("ready"):
            break
        await asyncio.sleep(0.5)
    else:
        say(f"the vehicle is not ready: {vehicle['stage']}")
        return 1
    proposed = await asked(session, "propose_mission", mission=mission, idempotency_key=uuid4().hex)
    for wrong in proposed.get("rejections", ()):
        say(f"{wrong['field']}: {wrong['message']}; nearest: {wrong['nearest']}")
    if not proposed.get("accepted"):
        return 1
    told = proposed
    while not told.get("over"):
        told = await asked(session, "mission_status", ticket=proposed["ticket"], wait_s=20)
        say(f"{told['state']}, {told['stage']}, {told.get('step', 'no step')}: {', '.join(told.get('changed', ()))}")
    say(f"it ended as {told['ending']}")
    return 0 if told["ending"] == "completed" else 1


async def main(plugin: str, mission: str) -> int:
    """Start the server that the plug-in names."""
    (server,) = json.loads((Path(plugin) / ".mcp.json").read_text("utf-8"))["mcpServers"].values()
    proposal = json.loads(Path(mission).read_text("utf-8"))
    async with Client(StdioServerParameters(**server), elicitation_callback=shown) as session:
        return await fly(session, proposal)


if __name__ == "__main__":
    sys.exit(asyncio.run(main(*sys.argv[1:3])))
