"""Stalls of the computer in flight, of any length and at any point: swap storms, frozen process groups, hypervisors,
debuggers. The log verifies, and records the gaps.
"""

from functools import cache
from itertools import pairwise
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as some

from rtshcua.evidence.report import LogVerdict
from rtshcua.model.faults import FlightMode as FlightMode
from rtshcua.model.faults import MessageSilence
from rtshcua.onboard.enforcement.load import EnforcementMode
from rtshcua.onboard.ports import Ending
from virtual import case, shipped
from virtual.flight import Flight
from virtual.sampling import each_once
from virtual.stalling import TOLD_US, StallingFlight, silences

#: how often a short flight looks at its clock, at least, and some more for what follows of a stall
LOOKS = 1_300
STALLS = some.dictionaries(some.integers(0, LOOKS), some.integers(1, 60 * case.S), min_size=1, max_size=3)


@cache
def bundle() -> bytes:
    return case.seal(case.mission(case.short_steps()))


@pytest.mark.claim("T3")
@pytest.mark.slow
@given(
    stalls=STALLS,
    mode=some.sampled_from((EnforcementMode.SOFTWARE, EnforcementMode.PROCESS)),
    flavour=some.sampled_from(("px4", "ardupilot")),
    attested=some.booleans(),
    lost=some.none() | some.integers(0, LOOKS),
)
def test_log_verifies_and_records_every_stall(
    stalls: dict[int, int], mode: EnforcementMode, flavour: str, attested: bool, lost: int | None
) -> None:
    """Two verifiers, written apart, agree (`audit`); no decision is derived otherwise, nothing is called forged. That
    its boundary is lost, if it is, is told as that alone. Nothing is called crashed, or taken over, that is not.
    """
    flight = StallingFlight(bundle(), flavour, stalls, mode=mode, attested=attested, lost=lost)
    flown = flight.fly()
    report = flown.audit().report
    assert report.failure is None, report.failure
    truth, told = flown.vehicle.simulation.truth(), {record.get("event") for record in flown.records}
    assert truth.crashed or "crashed" not in told
    assert truth.taken_over_us is not None or "taken-over" not in told
    gone = any(record.get("event") == "boundary-lost" for record in flown.records)
    assert (report.verdict is LogVerdict.VERIFIED) or (gone and attested), report
    assert {(gap.record, gap.us) for gap in report.gaps if gap.us > TOLD_US} == set(silences(flown))
    assert all(gap.signed is not None for gap in report.gaps)
    shown = [claim.text for claim in report.unproven if claim.slug == "gap"]
    assert len(shown) == len(report.gaps)
    assert all("vouched for by the key that signed record" in text for text in shown)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("for_s", "height", "flavour"), each_once((28, 44, 60), (16 * case.M, 4 * case.M), ("px4", "ardupilot"))
)
def test_landing_during_a_stall_is_detected(for_s: int, height: int, flavour: str) -> None:
    """Waiting frames report flight, later ones stopped motors and, for PX4, another mode: neither a crash nor a
    takeover.
    """
    flight = StallingFlight(bundle(), flavour, {})
    stood = False

    def stall(of: Flight) -> tuple[()]:
        nonlocal stood
        truth = of.vehicle.simulation.truth()
        if not stood and truth.in_air and truth.mode is FlightMode.RETURN and truth.up_mm <= height:
            stood = True
            of.vehicle.stand_still(for_s * case.S)
        return ()

    flown = flight.fly(stall)
    truth = flown.vehicle.simulation.truth()
    assert (stood, truth.crashed, truth.armed) == (True, False, False)
    assert [record["event"] for record in flown.records if record.get("event") in ("crashed", "taken-over")] == []
    assert flown.ending is Ending.COMPLETED


@pytest.mark.slow
@pytest.mark.parametrize(("flavour", "at", "for_us"), [("px4", 464, 14_297_001), ("ardupilot", 427, 20_466_187)])
def test_fresh_state_is_awaited_after_a_stall(flavour: str, at: int, for_us: int) -> None:
    """The socket keeps the oldest datagrams: even the newest of them is old after the stall."""
    flown = StallingFlight(bundle(), flavour, {at: for_us}).fly()
    (stood,) = flown.effects("stood-still")
    (fresh,) = flown.effects("fresh")
    told_us = int(stood["detail"].removeprefix("for ").removesuffix(" ms")) * 1_000
    assert for_us - 1_000 <= told_us <= for_us + 200_000, "from one step of the loop to the next"
    assert fresh["at_us"] > stood["at_us"], "else nothing is shown here"
    assert (flown.ending, flown.effects("violated")) == (Ending.COMPLETED, [])
    assert flown.audit().report.failure is None


def test_stall_is_recorded_first_and_sealed_at_once() -> None:
    flight = StallingFlight(bundle(), "px4", {600: 30 * case.S})
    flown = flight.fly()
    (gap,) = flown.effects("stalled")
    number = gap["seq"]
    before, *behind = flown.records[number - 1 : number + 3]
    assert gap["detail"] == f"{gap['at_us'] - before['at_us']} us"
    assert [record.get("event", record["type"]) for record in behind] == ["stalled", "boundary", "seal"]
    assert len({record["at_us"] for record in behind}) == 1
    report = flown.audit().report
    (told,) = report.gaps
    assert (told.record, told.signed, told.boundary) == (number, number + 2, number + 1)
    (claim,) = [claim for claim in report.unproven if claim.slug == "gap"]
    assert f"vouched for by the key that signed record {number + 2} and by the boundary" in claim.text


@pytest.mark.slow
def test_flight_without_stalls_records_no_gap() -> None:
    flown = StallingFlight(bundle(), "px4", {}).fly()
    assert not flown.effects("stalled")
    assert not flown.audit().report.gaps
    times = [record["at_us"] for record in flown.records]
    assert max(after - before for before, after in pairwise(times)) < TOLD_US


def test_wait_for_parameters_is_sealed() -> None:
    """What is set before a flight is waited for outside of the loop, and longer than an epoch lasts."""
    silent = MessageSilence(at_us=0, message="EXTENDED_SYS_STATE", for_us=120 * case.S)
    flown = Flight(bundle(), case.simulated("px4", faults=(silent,)), settings={"GF_ACTION": 3}).fly()
    assert flown.records[-1]["at_us"] - flown.records[0]["at_us"] > TOLD_US, "else nothing is shown here"
    assert not flown.effects("stalled")
    report = flown.audit().report
    assert (report.failure, report.gaps) == (None, ())


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(1_000, 1_060))
def test_stall_is_not_a_takeover(seed: int) -> None:
    """The standard mission, with stalls of 1 to 20 s, in each third flight one soon after the other."""
    chance, flavour = Random(seed), ("px4", "ardupilot")[seed % 2]
    at, apart = chance.randrange(4_800), 60 if seed % 3 == 0 else 4_800
    stalls = {
        (at + chance.randrange(apart)) % 4_800: chance.randint(case.S, 20 * case.S) for _ in range(chance.randint(1, 6))
    }
    mode = (EnforcementMode.SOFTWARE, EnforcementMode.PROCESS)[seed // 2 % 2]
    config = shipped.simulated(flavour)
    flown = StallingFlight(shipped.shipped("standard"), flavour, stalls, mode=mode, config=config).fly(most_s=7_200)
    truth = flown.vehicle.simulation.truth()
    assert [record["event"] for record in flown.records if record.get("event") in ("crashed", "taken-over")] == []
    assert (truth.crashed, truth.in_air) == (False, False)
    assert flown.audit().report.failure is None
