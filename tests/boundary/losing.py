"""Flights in virtual time with the boundary in C, which is lost during the flight."""

import ctypes
from collections.abc import Callable, Sequence
from typing import Any

import pytest
from msgspec.structs import replace

import rtshcua.virtual.flight
from boundary import both_boundaries
from rtshcua.mavlink.radio import UnsignedRadio
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.mission import Invocation, Plan
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement.isolated import Caller, IsolatedGate
from rtshcua.onboard.enforcement.load import EnforcementMode, Loaded, load
from rtshcua.onboard.ports import Event
from rtshcua.simulation.config import SimulationConfig
from rtshcua.virtual.flight import claimed
from rtshcua.virtual.vehicle import START, VirtualClock, VirtualVehicle
from rtshcua.wire.keys import Duty
from virtual import case
from virtual.flight import TICK_US, UTC_US, Flight

KEY = b"the key of a link, of 32 octets."
S, M = case.S, case.M


def to_and_fro(legs: int) -> tuple[Invocation, ...]:
    """A mission that climbs, flies a number of legs of about 40 m, and returns home."""
    up, _, back = case.short_steps()
    places = ((40 * M, 20 * M), (0, 0))
    steps = [up]
    for number in range(1, legs + 1):
        x, y = places[number % 2]
        plan = Plan(MotionKind.FLY, (x, y), 15 * M, 0)
        steps.append(case.step(number, 1, case.flat.GOTO, plan, x, y, 15 * M))
    return (*steps, replace(back, step=legs + 1))


class Apart:
    """A flight with a separate boundary, which answers until it is `dead`; `key` is the link's."""

    def __init__(
        self, boundary: ctypes.CDLL, monkeypatch: pytest.MonkeyPatch, bundle: bytes, config: SimulationConfig,
        key: bytes | None = KEY,
    ) -> None:  # fmt: skip
        self.dead = False
        policy, mission = claimed(bundle)
        clock = VirtualClock(Now(START.monotonic_us, UTC_US, START.utc_error_us))
        root, signed = case.root(boundary=True)
        held = both_boundaries.begin(
            boundary, signed, case.KEYS[Duty.ROOT].kid, policy.vehicle.identity, bytes(range(32)), clock.now(),
            link_key=key,
        )  # fmt: skip
        self._answer: Callable[[bytes], bytes] = held._call
        loaded = load(
            bundle, root=root, vehicle=policy.vehicle.identity, now=clock.now(), mode=EnforcementMode.PROCESS,
            session_key=bytes(32), flight=bytes(16), peer_is_own_simulator=True,
            caller=Caller(self.call, signs=key is not None),
        )  # fmt: skip
        assert isinstance(loaded, Loaded), loaded
        assert isinstance(loaded.executor.frames, IsolatedGate)
        self.gate = loaded.executor.frames
        self.vehicle = VirtualVehicle(
            policy, config, clock, self.gate, None if key is None else UnsignedRadio(self.gate), tick_us=TICK_US,
            steps=mission.invocations,
        )  # fmt: skip
        monkeypatch.setattr(rtshcua.virtual.flight, "load", lambda *_, **__: loaded)
        self.flight = Flight(bundle, config, vehicle=self.vehicle, mode=EnforcementMode.PROCESS)
        self.lost_us: int | None = None

    def call(self, octets: bytes) -> bytes:
        if self.dead:
            raise BrokenPipeError
        return self._answer(octets)

    def lose(self) -> None:
        self.dead, self.lost_us = True, self.flight.clock.elapsed_us

    def fly(self, dies: Callable[["Apart"], bool], most_s: int = 1_500) -> Any:
        """Fly to the end; the boundary dies at the first moment of which `dies` is true."""

        def each(_: object) -> Sequence[Event]:
            if not self.dead and dies(self):
                self.lose()
            return ()

        return self.flight.fly(each, most_s=most_s)
