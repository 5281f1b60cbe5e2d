"""`python -m rtshcua.adapters.gateway`: the relay's process. Its setup is JSON on the standard input (`messages.py`).

It ends with 0 with its starter and at SIGTERM, and with 8 for an address that cannot be opened, after `FAILED`.
A malformed setup is a fault of the starter.
"""

import signal
import socket
import sys
from contextlib import suppress

import msgspec

from rtshcua.adapters.gateway.messages import RelayKind, RelaySetup, encoded
from rtshcua.adapters.gateway.relay import Relay, SetupError
from rtshcua.diagnostics.exits import ExitCode


def main() -> int:
    """Run the relay; return its exit code."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(ExitCode.OK))
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # of a terminal: the starter ends the relay when it is done
    setup = msgspec.json.decode(sys.stdin.buffer.read(), type=RelaySetup)
    control, telemetry = (socket.socket(fileno=descriptor) for descriptor in (setup.control, setup.telemetry))
    try:
        relay = Relay(setup, control, telemetry)
    except SetupError as error:
        with suppress(OSError):
            control.send(encoded(RelayKind.FAILED, 0, msgspec.json.encode(error.failure)))
        return ExitCode.LINK
    try:
        relay.run()
    finally:
        relay.close()
    return ExitCode.OK


if __name__ == "__main__":
    sys.exit(main())
