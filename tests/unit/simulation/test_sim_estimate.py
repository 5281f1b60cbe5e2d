"""The realistic position estimate: late, with a drifting error of about a metre."""

from collections.abc import Callable
from math import hypot
from statistics import fmean
from typing import Any

import pytest

from rtshcua.simulation.config import AutopilotKind, Estimate, SimulationConfig
from rtshcua.simulation.sensors import FIX_LATE_S, LATE_S, WANDER_M
from rtshcua.simulation.world import Simulation


def flying(pilot: Callable[..., Any], flavour: str, **config: Any) -> Any:
    p = pilot(flavour, **config)
    for number in (24, 33, 74):
        p.long(511, number, 100_000)
    p.take_off(20)
    return p


def behind(p: Any, name: str) -> float:
    """Return the lag of reports behind the true position on a northward flight, in metres."""
    north, _ = p.config.home.local(p.last(name).lat, p.last(name).lon)
    return float(p.truth.north_mm / 1_000 - north)


def test_real_position_estimate_lags(pilot: Callable[..., Any], flavour: str) -> None:
    p = flying(pilot, flavour, noise=False, estimate=Estimate.REAL)
    p.go_to(300, 0, 20)
    p.wait(8)
    speed = p.truth.speed_mm_s / 1_000
    assert speed > 4
    assert behind(p, "GLOBAL_POSITION_INT") == pytest.approx(speed * LATE_S, abs=0.05)
    p.until(lambda: p.last("GPS_RAW_INT").time_usec == p.simulation.now_us, 2)
    assert behind(p, "GPS_RAW_INT") == pytest.approx(speed * FIX_LATE_S, abs=0.05)


def test_real_velocity_estimate_lags(pilot: Callable[..., Any], flavour: str) -> None:
    def told(estimate: Estimate) -> tuple[float, float]:
        p = flying(pilot, flavour, noise=False, estimate=estimate)
        p.go_to(300, 0, 20)
        p.wait(8)
        before = p.last("VFR_HUD").groundspeed
        p.pause() if p.px4 else p.long(176, 1, 17)
        p.wait(1.6)
        return before, p.last("GLOBAL_POSITION_INT").vx / 100

    close, real = told(Estimate.CLOSE), told(Estimate.REAL)
    assert real[0] == pytest.approx(close[0], abs=0.05)
    assert 0.1 < real[1] - close[1] < 0.5


def test_real_receiver_error_wanders_by_about_a_metre() -> None:
    found, steps = [], []
    for seed in range(12):
        simulation = Simulation(SimulationConfig(AutopilotKind.PX4, seed=seed, estimate=Estimate.REAL))
        sensors = simulation._autopilot.sensors
        last = (0.0, 0.0)
        for second in range(1, 301):
            for _ in range(50):
                sensors.step(0.02)
            here = sensors.error
            steps.append(hypot(here[0] - last[0], here[1] - last[1]))
            last = here
            if second > 100:
                found.append(hypot(*here) ** 2)
    assert fmean(found) ** 0.5 == pytest.approx(WANDER_M * 2**0.5, rel=0.25)
    assert max(steps) < 1.0
    assert 0.05 < fmean(steps) < 0.3


def test_vehicle_steers_by_its_estimate(pilot: Callable[..., Any], flavour: str) -> None:
    p = flying(pilot, flavour, estimate=Estimate.REAL)
    off = []
    for _ in range(60):
        p.wait(2)
        place = p.last("GLOBAL_POSITION_INT")
        north, east = p.config.home.local(place.lat, place.lon)
        assert hypot(north, east) < 0.9, "it stays where it believes to stay"
        off.append(hypot(p.truth.north_mm, p.truth.east_mm) / 1_000)
    assert 0.3 < max(off) < 4


def test_estimate_does_not_wander_without_noise(pilot: Callable[..., Any], flavour: str) -> None:
    p = flying(pilot, flavour, noise=False, estimate=Estimate.REAL)
    p.wait(30)
    assert hypot(p.truth.north_mm, p.truth.east_mm) < 50
