"""The tlog format: round trips, and truncated files with the place of the cut."""

import itertools
from io import BytesIO
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Codec
from rtshcua.mavlink import tlog

DATA = Path(__file__).parent / "data"


@given(st.lists(st.tuples(st.integers(0, 2**64 - 1), st.integers(0, 2**32 - 1)), max_size=10))
def test_round_trip(stamps: list[tuple[int, int]]) -> None:
    codec = Codec(1, 1)
    entries = [
        tlog.TlogEntry(at_us, codec.pack(mavlink.MAVLink_system_time_message(value, 7))) for at_us, value in stamps
    ]
    data = b"".join(tlog.encode(entry.at_us, entry.frame) for entry in entries)
    assert list(tlog.read(data)) == list(tlog.stream(BytesIO(data))) == entries


@pytest.mark.parametrize("name", ["px4", "arducopter", "arducopter-signed"])
def test_recorded_flights_encode_to_their_own_bytes(name: str) -> None:
    data = (DATA / f"{name}.tlog").read_bytes()
    entries = list(tlog.read(data))
    assert b"".join(tlog.encode(entry.at_us, entry.frame) for entry in entries) == data
    assert all(a.at_us <= b.at_us for a, b in itertools.pairwise(entries))


def test_a_cut_file_gives_its_whole_entries_and_the_place() -> None:
    data = (DATA / "px4.tlog").read_bytes()
    first = next(tlog.read(data))
    size = len(tlog.encode(first.at_us, first.frame))
    for length in range(size + 1, size + 30):
        seen: list[tlog.TlogEntry] = []
        with pytest.raises(tlog.DamagedTlog) as caught:
            seen.extend(entry for entry in tlog.read(data[:length]))
        assert caught.value.offset == size
        assert seen == [first]
        with pytest.raises(tlog.DamagedTlog) as caught:
            seen.extend(tlog.stream(BytesIO(data[:length])))
        assert caught.value.offset == size
        assert seen == [first, first]


def test_invalid_tlog_is_refused() -> None:
    with pytest.raises(tlog.DamagedTlog):
        list(tlog.read(b"not a tlog at all, but long enough for one"))
    with pytest.raises(tlog.DamagedTlog):
        list(tlog.stream(BytesIO(b"not a tlog at all, but long enough for one")))
