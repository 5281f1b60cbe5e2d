"""The in-process stand-in of the boundary process decides like mode `software`."""

from random import Random

import pytest

from reference.world import ROOT, VEHICLE
from rtshcua.onboard.enforcement import isolated as calls
from rtshcua.onboard.enforcement.load import EnforcementMode
from rtshcua.onboard.ports import Ending
from rtshcua.virtual.boundary_in_process import Served
from virtual.flight import Flight
from virtual.shipped import shipped, simulated

FLAVOURS = ("px4", "ardupilot")


@pytest.mark.slow
@pytest.mark.parametrize("flavour", FLAVOURS)
def test_flight_in_mode_process_equals_mode_software(flavour: str) -> None:
    one, other = (
        Flight(shipped("short"), simulated(flavour), attested=True, mode=mode).fly()
        for mode in (EnforcementMode.SOFTWARE, EnforcementMode.PROCESS)
    )
    assert one.ending is other.ending is Ending.COMPLETED
    apart = {
        "mode",
        "bytes",
        "_prev",
        "checkpoint",
        "digest",
    }  # fields with the mode, its length, and hashes over it
    for here, there in zip(one.records, other.records, strict=True):
        assert {name for name in here if here[name] != there[name]} <= apart
    assert other.audit().report.failure is None


def test_malformed_calls_are_answered() -> None:
    served, of = Served(ROOT, VEHICLE), Random(7)
    assert served(b"") == b"\1malformed"
    for _ in range(2_000):
        assert served(of.randbytes(of.randrange(1, 60)))[0] in (0, 1)
    served(bytes([calls.PART, calls.LOAD]) + bytes(4) + b"no bundle")
    assert served(bytes([calls.LOAD]) + bytes(28))[0] == 1
    for kind in (calls.ENFORCE, calls.DISPATCH, calls.AHEAD, calls.STATEMENT, calls.PERMIT):
        assert served(bytes([kind]) + bytes(80)) == b"\1not-loaded"


def test_dead_boundary_does_not_answer() -> None:
    served = Served(ROOT, VEHICLE)
    served.dead = True
    with pytest.raises(ConnectionResetError):
        served(bytes([calls.DIGEST]))
