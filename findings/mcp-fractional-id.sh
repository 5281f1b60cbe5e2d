#!/bin/sh
# mcp 1.30.0: a request whose id is 1.5 is never answered, with a result or with an error.
# Expected: an answer with that id, or the error -32600. The schema of the Model Context Protocol has `RequestId = string |
# number`, and JSON-RPC 2.0 says of fractions that they should not be used. The server takes the request for a notification,
# which needs no answer, so the client waits for ever.
# Seen: ids 1 and 2 are answered, id 1.5 is not.
. "$(dirname "$0")/run.inc"
packages mcp==1.30.0
cat >"$folder/server.py" <<'END'
from mcp.server.fastmcp import FastMCP

FastMCP("finding").run("stdio")
END
python - "$folder/venv/bin/python" "$folder/server.py" <<'END'
import json
import subprocess
import sys

opening = {"protocolVersion": "2025-06-18", "capabilities": {}, "clientInfo": {"name": "finding", "version": "1"}}
lines = [
    {"jsonrpc": "2.0", "id": 1, "method": "initialize", "params": opening},
    {"jsonrpc": "2.0", "method": "notifications/initialized"},
    {"jsonrpc": "2.0", "id": 1.5, "method": "ping"},
    {"jsonrpc": "2.0", "id": 2, "method": "ping"},
]
server = subprocess.Popen(sys.argv[1:], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
server.stdin.write("".join(json.dumps(line) + "\n" for line in lines))
server.stdin.flush()
answered = [json.loads(server.stdout.readline())["id"] for _ in range(2)]
server.stdin.close()
answered += [json.loads(line).get("id") for line in server.stdout]
server.wait(30)
print("mcp 1.30.0 answered ids", answered)
assert sorted(answered) == [1, 2], "it has changed"
END
