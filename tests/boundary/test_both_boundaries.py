"""Whole flights under both boundaries at once: the same answers to each request, document, permit and frame."""

import ctypes
from random import Random
from typing import Any

import pytest

import rtshcua.virtual.flight
from boundary.both_boundaries import Differs, Shadow
from reference import world
from reference.documents import approval, hand, low_mission, recall
from reference.world import ROOT, ROOT_KEY, SESSION_KEY, START, VEHICLE, sealed_again
from rtshcua.model.flat.mission import Mission
from rtshcua.onboard.enforcement.load import EnforcementMode, Loaded
from rtshcua.onboard.ports import Ending
from rtshcua.simulation.fault_syntax import parse_fault
from rtshcua.wire.trust import TrustRoot, open_root
from theorems import test_corollary_1_agent as agents
from virtual.flight import Flight, Flown
from virtual.shipped import NAMES, shipped, simulated

FLAVOURS = ("px4", "ardupilot")


def watched(boundary: ctypes.CDLL, monkeypatch: pytest.MonkeyPatch) -> Shadow:
    """Use both boundaries for all later flights."""
    made = Shadow(boundary)

    def spied(data: bytes, *, pinned: bytes | None, now_us: int) -> TrustRoot:
        root = open_root(data, pinned=pinned, now_us=now_us)
        made.know(root, data, pinned or b"")
        return root

    monkeypatch.setattr(rtshcua.virtual.flight, "open_root", spied)
    monkeypatch.setattr(rtshcua.virtual.flight, "load", made.load)
    return made


@pytest.fixture
def shadow(boundary: ctypes.CDLL, monkeypatch: pytest.MonkeyPatch) -> Shadow:
    """Use both boundaries for the flights of this test."""
    made = watched(boundary, monkeypatch)
    made.know(ROOT, ROOT.sign(ROOT_KEY), ROOT_KEY.verification().public)

    def both(mission: Mission) -> Loaded:
        loaded = made.load(
            sealed_again(world.loaded(mission=mission)), root=ROOT, vehicle=VEHICLE, now=START,
            mode=EnforcementMode.SOFTWARE,
            session_key=SESSION_KEY, flight=bytes(16), peer_is_own_simulator=True,
        )  # fmt: skip
        assert isinstance(loaded, Loaded), loaded
        return loaded

    monkeypatch.setattr(agents, "loaded", both)
    return made


def fly(name: str, flavour: str, *faults: str) -> Flown:
    config = simulated(flavour, faults=tuple(parse_fault(fault) for fault in faults))
    return Flight(shipped(name), config, attested=True).fly()


@pytest.mark.slow
@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_flight_is_the_same_under_both(flavour: str, shadow: Shadow) -> None:
    assert fly("short", flavour).ending is Ending.COMPLETED
    assert fly("short", flavour, "battery,at=15s,level=10%").ending is Ending.ABORTED
    assert min(shadow.counts[each] for each in ("requests", "frames", "dispatches", "ahead")) > 0


def meddled(seed: int) -> None:
    """A flight with a random agent, and people who answer and recall at random."""
    of = Random(seed)
    run = agents.meddled(of)
    run = world.Run(agents.loaded(low_mission()))
    for _ in range(400):
        if run.ending is not None:
            return
        run.tick()
        if of.random() < 0.04 and run.ending is None:
            made: Any = of.choice((approval, approval, approval, agents.paper_of, recall))
            flying = run.loaded
            paper = agents.paper_of(of, flying, []) if made is agents.paper_of else None
            granted = {"granted": of.randrange(2)} if made is approval else {}
            if paper is None and not (made is recall and of.random() < 0.7):
                paper = made(flying, **granted) if len(flying.bundle.mission.invocations) > 2 else b""
            hand(run, paper or b"")


@pytest.mark.slow
def test_documents_do_the_same_under_both(shadow: Shadow) -> None:
    for seed in range(12):
        meddled(seed)
    assert shadow.counts["documents"] > 20


def test_a_boundary_that_answers_otherwise_is_noticed(shadow: Shadow, monkeypatch: pytest.MonkeyPatch) -> None:
    import rtshcua.onboard.enforcement.boundary as here

    monkeypatch.setattr(here, "LINK_VALID_US", here.LINK_VALID_US + 1)
    monkeypatch.setattr("rtshcua.decision.session.LINK_VALID_US", here.LINK_VALID_US)
    with pytest.raises(Differs):
        fly("short", "px4", "battery,at=15s,level=10%")


@pytest.mark.soak
@pytest.mark.parametrize("flavour", FLAVOURS)
@pytest.mark.parametrize("name", NAMES)
def test_all_flights_are_the_same_under_both(name: str, flavour: str, shadow: Shadow) -> None:
    for faults in (
        (),
        ("gps-loss,at=60s",),
        ("battery,at=90s,level=15%",),
        ("wind,at=50s,speed=14m/s",),
        ("pilot,at=70s",),
    ):
        fly(name, flavour, *faults)


@pytest.mark.soak
@pytest.mark.parametrize("first", range(0, 4_000, 200))
def test_many_documents_do_the_same_under_both(first: int, shadow: Shadow) -> None:
    for seed in range(first, first + 200):
        meddled(seed)
