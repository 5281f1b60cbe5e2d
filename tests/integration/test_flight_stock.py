"""The shipped missions fly on a stock copter: GPS, barometer and battery only, with the recorded boot."""

from functools import cache
from itertools import product
from pathlib import Path

import pytest

from rtshcua.app.programs import compile_sources
from rtshcua.codec.frames import kind_of
from rtshcua.mavlink.framing import message_id
from rtshcua.onboard.ports import Ending
from rtshcua.simulation.config import STOCK, AutopilotKind, Boot
from rtshcua.virtual.fitting import fitting
from virtual import case
from virtual.flight import Flight, Flown
from virtual.shipped import NAMES, shipped

STARTER = Path(__file__).resolve().parents[2] / "examples/starter/missions/first_look.rts"
FLAVOURS = ("px4", "ardupilot")
#: flown each time; the long ones, and the other autopilot, are for soak
SOME = [
    pytest.param(*each, marks=() if each in (("starter", "px4"), ("short", "ardupilot")) else pytest.mark.soak)
    for each in product(("starter", *NAMES), FLAVOURS)
]
#: what no stock copter tells
NEVER = frozenset({"RADIO_STATUS", "DISTANCE_SENSOR", "OBSTACLE_DISTANCE", "WIND_COV"})


@cache
def bundle(name: str) -> bytes:
    if name != "starter":
        return shipped(name)
    compiled, _ = compile_sources([STARTER], mission=None, issued_at_us=case.flat.ISSUED)
    assert compiled.policy is not None, compiled.diagnostics
    assert compiled.mission is not None
    return case.seal(compiled.mission, compiled.policy)


def flown(name: str, flavour: str) -> tuple[Flown, set[str]]:
    """Fly on the stock vehicle; return the flight and the names of all its messages."""
    flight = Flight(
        bundle(name), lambda policy: fitting(policy, flavour=AutopilotKind(flavour), extras=STOCK, boot=Boot.RECORDED),
    )  # fmt: skip
    said = set[int]()

    def listen(datagram: bytes) -> list[bytes]:
        said.add(message_id(datagram, 0))  # one frame in each
        return [datagram]

    flight.vehicle.hurt = listen
    flew = flight.fly()
    kinds = [kind_of(number) for number in said]
    return flew, {kind.name for kind in kinds if kind is not None}


@pytest.mark.slow
@pytest.mark.parametrize(("name", "flavour"), SOME)
def test_shipped_missions_fly_on_a_stock_copter(name: str, flavour: str) -> None:
    flight, said = flown(name, flavour)
    assert flight.ending is Ending.COMPLETED, flight.decisions()
    assert {outcome for _, outcome, _ in flight.decisions()} == {"allow"}
    assert {"HEARTBEAT", "GLOBAL_POSITION_INT", "BATTERY_STATUS"} <= said
    assert not said & NEVER
    assert not flight.vehicle.simulation.truth().in_air
