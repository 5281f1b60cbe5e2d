"""`rtshcua run` and `doctor` on a port with two vehicles: neither is flown unless one is named."""

from collections.abc import Iterator
from contextlib import ExitStack
from typing import Any

import pytest

from rtshcua.adapters.simulator import Simulator
from virtual import case


@pytest.fixture
def both(port: int) -> Iterator[list[str]]:
    """What connects to a port that a PX4 (system 1) and an ArduCopter (system 2) send to."""
    with ExitStack() as stack:
        for system, flavour in ((1, "px4"), (2, "ardupilot")):
            words = ["--port", str(port), "--speed", "10", "--system", str(system), "--flavour", flavour]
            words += ["--return-at", str(case.LOW // case.M)]
            stack.enter_context(Simulator(words))
        yield ["--connect", f"udpin:127.0.0.1:{port}"]


@pytest.mark.slow
def test_two_vehicles_on_a_link_are_refused(ground: Any, both: list[str]) -> None:
    run = ground.run(ground.bundle(), *both, "--vehicle", case.policy().vehicle.identity, speed=10).end()
    assert run.code == 5, run.stderr
    assert run.events[-1]["slug"] == "two-vehicles"
    assert "`--system`" in run.stderr
    examined = ground.start("doctor", *both, "--seconds", "3", "--json").end()
    (said,) = examined.events
    verdicts = {each["slug"]: each["verdict"] for each in said["findings"]}
    assert verdicts["link/other-vehicle"] == "stop"


@pytest.mark.slow
def test_vehicle_named_by_system_id_is_chosen(ground: Any, both: list[str]) -> None:
    words = [*both, "--vehicle", case.policy().vehicle.identity, "--system", "2", "--dry-run"]
    run = ground.run(ground.bundle(), *words, speed=10).end()
    assert run.code == 0, run.stderr
    assert run.events[-1]["ready"]
