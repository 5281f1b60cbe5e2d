"""Faults of the link and of the autopilot's loop: delay, loss, reordering, stale values, and bursts."""

from collections.abc import Callable
from itertools import pairwise
from random import Random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtshcua.model import faults
from rtshcua.model.faults import Direction, FlightMode
from rtshcua.simulation.link import OVERTAKEN_US, FaultyLink

S = 1_000_000


@pytest.fixture
def flying(pilot: Callable[..., Any], flavour: str) -> Any:
    p = pilot(flavour)
    for number in (33, 24, 30, 245):
        p.long(511, number, 100_000)
    p.take_off(20)
    return p


def inject(p: Any, kind: Callable[..., faults.Fault], *args: Any) -> None:
    p.simulation.inject(kind(p.simulation.now_us, *args))


def of_autopilot(received: list[Any]) -> list[Any]:
    return [frame for frame in received if frame.component == 1]


def lag_us(p: Any) -> list[int]:
    """Return the age of each received position, in ticks."""
    return [
        p.simulation.now_us - frame.message.time_boot_ms * 1000
        for _ in range(250)
        for frame in p.wait(0.02)
        if frame.name == "GLOBAL_POSITION_INT"
    ]


def test_delay_affects_one_direction(flying: Any) -> None:
    inject(flying, faults.LinkDelay, 300_000, 8 * S, Direction.DOWN)
    flying.wait(1)
    assert set(lag_us(flying)) == {300_000}
    flying.mode(FlightMode.LAND)
    assert flying.truth.mode is FlightMode.LAND, "upwards nothing is late"
    flying.wait(3)
    assert set(lag_us(flying)) == {0}
    inject(flying, faults.LinkDelay, 300_000, None, Direction.UP)
    flying.wait(0.1)
    assert set(lag_us(flying)) == {0}
    flying.mode(FlightMode.LOITER)
    flying.wait(0.28)
    assert flying.truth.mode is FlightMode.LAND
    flying.wait(0.04)
    assert flying.truth.mode is FlightMode.LOITER


def test_jitter_varies_the_delay_and_keeps_the_order(flying: Any) -> None:
    inject(flying, faults.LinkJitter, 200_000)
    flying.wait(1)
    times = [f.message.time_boot_ms for f in flying.seen if f.name == "GLOBAL_POSITION_INT"]
    lags = lag_us(flying)
    assert times == sorted(times)
    assert len(set(lags)) > 5
    assert 0 <= min(lags) < 100_000 < max(lags) <= 220_000


def test_reordered_datagrams_arrive_out_of_order(flying: Any) -> None:
    inject(flying, faults.LinkReorder, 2_000)
    flying.wait(0.1)
    numbers = [frame.sequence for frame in of_autopilot(flying.wait(10))]
    turned = sum((after - before) % 256 > 128 for before, after in pairwise(numbers))
    assert turned > len(numbers) / 20


@pytest.mark.parametrize("way", list(Direction))
def test_silence_affects_the_named_direction(flying: Any, way: Direction) -> None:
    inject(flying, faults.LinkSilence, 5 * S, way)
    flying.wait(0.1)
    flying.mode(FlightMode.LAND)
    assert (flying.truth.mode is FlightMode.LAND) is (way is Direction.DOWN)
    assert bool(of_autopilot(flying.wait(4.8))) is (way is Direction.UP)
    assert of_autopilot(flying.wait(1))
    assert (flying.truth.mode is FlightMode.LAND) is (way is Direction.DOWN), "what was lost stays lost"


def test_held_datagrams_arrive_in_a_burst(flying: Any) -> None:
    inject(flying, faults.LinkSilence, 5 * S, Direction.BOTH, True)
    flying.wait(0.1)
    flying.mode(FlightMode.LAND)
    assert not flying.wait(4.8)
    assert flying.truth.mode is not FlightMode.LAND
    burst = [f.message for f in flying.wait(0.12) if f.name == "GLOBAL_POSITION_INT"]
    assert 45 <= len(burst) <= 52
    assert burst[-1].time_boot_ms - burst[0].time_boot_ms > 4_500
    assert flying.truth.mode is FlightMode.LAND


def test_loss_in_one_direction_ends(flying: Any) -> None:
    inject(flying, faults.LinkLoss, 10_000, 2 * S, Direction.UP)
    flying.wait(0.1)
    assert of_autopilot(flying.wait(1))
    flying.mode(FlightMode.LAND)
    assert flying.truth.mode is not FlightMode.LAND
    flying.wait(1.1)
    assert flying.last("RADIO_STATUS").txbuf in (0, 100)
    flying.mode(FlightMode.LAND)
    assert flying.truth.mode is FlightMode.LAND


def test_stall_halts_the_autopilot_and_then_answers_in_a_burst(flying: Any) -> None:
    flying.go_to(200, 0, 20)
    flying.wait(5)
    before, told = flying.truth, flying.last("GLOBAL_POSITION_INT").time_boot_ms
    inject(flying, faults.Stall, 5 * S)
    flying.wait(0.1)
    for number in (33, 24, 30):
        assert flying.long(511, number, 100_000) == []
    assert not of_autopilot(flying.wait(4.8))
    assert flying.last("RADIO_STATUS") is not None
    assert flying.truth.north_mm - before.north_mm < 1_000
    burst = flying.wait(0.12)
    assert sum(f.name == "COMMAND_ACK" for f in burst) == 3
    flying.wait(0.3)
    assert flying.last("GLOBAL_POSITION_INT").time_boot_ms - told < 700, "its clock stood still"
    assert flying.truth.speed_mm_s > 4_000, "it flies on as it flew"


def test_stall_can_shuffle_the_first_messages(pilot: Callable[..., Any], flavour: str) -> None:
    def first(shuffle: int) -> list[str]:
        p = pilot(flavour, faults=(faults.Stall(20 * S, 3 * S, shuffle),))
        for number in (33, 24, 30, 245, 147, 1):
            p.long(511, number, 100_000)
        p.wait(22.9)
        p.long(511, 33, 100_000)
        return [frame.name for frame in of_autopilot(p.wait(0.4))][:12]

    assert first(1) == first(1)
    assert len({tuple(first(seed)) for seed in range(4)}) == 4
    assert any(first(seed)[0] not in ("HEARTBEAT", "COMMAND_ACK") for seed in range(1, 6))


def test_frozen_measurements_keep_old_time_stamps(flying: Any) -> None:
    flying.go_to(200, 0, 20)
    flying.wait(5)
    inject(flying, faults.Freeze, 4 * S)
    flying.wait(0.1)
    seen = flying.wait(3)
    positions = [f.message for f in seen if f.name == "GLOBAL_POSITION_INT"]
    assert len(positions) >= 29
    assert len({(m.time_boot_ms, m.lat) for m in positions}) == 1
    assert len({f.message.time_boot_ms for f in seen if f.name == "ATTITUDE"}) == 1
    flying.mode(FlightMode.LAND)
    flying.wait(1.5)
    assert flying.last("HEARTBEAT").custom_mode == (100925440 if flying.px4 else 9), "the mode is still told"
    assert flying.simulation.now_us / 1000 - flying.last("GLOBAL_POSITION_INT").time_boot_ms < 200


def test_single_message_can_be_silenced(flying: Any) -> None:
    inject(flying, faults.MessageSilence, "GLOBAL_POSITION_INT", 3 * S)
    flying.wait(0.1)
    names = {frame.name for frame in flying.wait(2.8)}
    assert "GLOBAL_POSITION_INT" not in names
    assert {"GPS_RAW_INT", "HEARTBEAT"} <= names
    assert flying.long(512, 33) == [2 if flying.px4 else 0]
    assert "GLOBAL_POSITION_INT" in {frame.name for frame in flying.wait(1)}


@given(
    st.integers(0, 2**32),
    st.integers(0, 300_000),
    st.integers(0, 200_000),
    st.integers(0, 10_000),
    st.lists(st.integers(0, 100_000), max_size=60),
)
def test_link_delivers_in_time_and_deterministically(
    seed: int, delay_us: int, jitter_us: int, reordered: int, gaps: list[int]
) -> None:
    def run() -> list[tuple[int, bytes]]:
        link, now_us, came = FaultyLink(Random(seed)), 0, list[tuple[int, bytes]]()
        link.delay_us, link.jitter_us, link.reordered = delay_us, jitter_us, reordered
        for number, gap in enumerate(gaps):
            now_us += gap
            came += [(now_us, datagram) for datagram in link.due(now_us)]
            link.send([number.to_bytes(1, "big")], now_us)
        last_us = now_us + delay_us + jitter_us + OVERTAKEN_US
        return came + [(last_us, datagram) for datagram in link.due(last_us)]

    came = run()
    assert sorted(datagram for _, datagram in came) == [number.to_bytes(1, "big") for number in range(len(gaps))]
    assert came == run()
    if not reordered:
        assert [datagram for _, datagram in came] == sorted(datagram for _, datagram in came)
