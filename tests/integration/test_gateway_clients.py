"""Programs that others made, as they come, are clients of a gateway: each flies what the policy permits, and its user
reads why the rest is refused. Each has an address for each role of the policy.
"""

import json
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Final, NamedTuple

import pytest

from virtual.gateway_clients import INSIDE, OTHERS, OUTSIDE, PROGRAMS, REASONS, carried_out, flown, gateway, reads

pytestmark = [pytest.mark.clients, pytest.mark.long]


class Client(NamedTuple):
    """A program: its command before an address and its actions, the scheme of its addresses, and its packages."""

    command: Sequence[str]
    scheme: str
    packages: Path | None = None


CLIENTS: Final = {
    "mavsdk": Client((sys.executable, str(PROGRAMS / "mavsdk_program.py")), "udpout://127.0.0.1:", OTHERS),
    "mavsdk-grpc": Client((sys.executable, str(PROGRAMS / "mavsdk_grpc_program.py")), "udpout://127.0.0.1:"),
    "mavproxy": Client((sys.executable, str(PROGRAMS / "mavproxy_program.py")), "udpout:127.0.0.1:"),
}


@pytest.mark.parametrize(
    ("name", "flavour"), [("mavsdk", "px4"), ("mavsdk-grpc", "ardupilot"), ("mavproxy", "ardupilot")]
)
def test_program_flies_and_reads_why_it_is_refused(name: str, flavour: str, tmp_path: Path) -> None:
    client = CLIENTS[name]
    if client.packages is not None and not client.packages.exists():
        pytest.skip("`make clients` installs MAVSDK 4.1")

    def run(role: str, *actions: Sequence[object]) -> list[dict[str, Any]]:
        address = f"{client.scheme}{side.ports[role]}"
        return carried_out([*client.command, address, json.dumps(actions)], client.packages)

    with gateway(tmp_path, flavour) as side:
        with ThreadPoolExecutor() as pool:
            checks = {role: pool.submit(run, role, ["takeoff", 8]) for role in REASONS}
        for role, check in checks.items():
            (told,) = check.result()
            assert not told["succeeded"]
            assert REASONS[role] in reads(told), (role, told)
        # what a person must approve, and nobody does
        (told,) = run("operator", ["takeoff", 25])
        assert not told["succeeded"]
        assert "approval" in reads(told), told
        goto_in, goto_out = ["goto", *INSIDE, 8], ["goto", *OUTSIDE, 8]
        actions = (["takeoff", 80], ["takeoff", 8], goto_out, goto_in, ["land"])
        height, up, out, there, down = run("operator", *actions)
        assert not height["succeeded"]
        assert "altitude 80 m, accepted 30 m" in reads(height)
        assert up["succeeded"], up
        assert not out["succeeded"]
        assert "target outside field" in reads(out)
        assert there["succeeded"], there
        assert down["succeeded"], down
        flown(side.run, tmp_path, 2)
