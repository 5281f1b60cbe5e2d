"""A frame repeated at another time is found, unless a record permits it then, according to a naive implementation."""

from bisect import insort
from functools import cache
from typing import NamedTuple

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as some

from reference.forgery import ROOT_KEY
from reference.kept_frames import Entries
from reference.kinds_of_flight import fallen_back
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import Effect, Genesis
from rtshcua.ground.audit.frame_meaning import FrameNature, nature, read_frame
from rtshcua.ground.audit.frames import OURS, FrameAudit
from rtshcua.ground.audit.trust import Basis, establish
from rtshcua.mavlink.layouts import GLOBAL_POSITION_INT
from rtshcua.mavlink.modes import ARDUPILOT, PX4
from rtshcua.onboard.enforcement.allow_list import carries_out
from rtshcua.onboard.enforcement.allow_list import read_frame as read_shape
from rtshcua.onboard.enforcement.executor import Commands
from rtshcua.onboard.ports import Command
from virtual import case

AUTOPILOTS = {"px4": PX4, "ardupilot": ARDUPILOT}


class Window(NamedTuple):
    """A command with its begin and end, UTC us."""

    command: Command
    begin: int
    end: int


class Case(NamedTuple):
    """A flight with a fallback, its frames, and the commands that a naive reading of its log gives."""

    basis: Basis
    effects: tuple[Effect, ...]
    entries: Entries
    commands: tuple[bytes, ...]
    windows: tuple[Window, ...]
    home_amsl: int


@cache
def flown(kind: str) -> Case:
    lines, entries = fallen_back(kind)
    records = [read(line) for line in lines]
    genesis = records[0]
    assert isinstance(genesis, Genesis)
    basis = establish(genesis, ROOT_KEY)
    assert isinstance(basis, Basis)
    effects = tuple(record for record in records if isinstance(record, Effect))
    bundle = basis.bundle
    made = Commands(bundle.policy, bundle.mission)
    windows = []
    for effect in effects:
        if effect.event == "dispatched":
            end = min(
                (each.utc_us for each in effects if each.token == effect.token and each.seq > effect.seq),
                default=1 << 60,
            )
            command = made.command(effect.kind, effect.step, effect.link, effect.token)
            windows.append(Window(command, effect.utc_us, end))
    ours = tuple(dict.fromkeys(octets for _, octets in entries if is_command(octets)))
    positions = [read_shape(octets) for _, octets in entries]
    heights = {each.fields[3] - each.fields[4] for each in positions if each and each.message == GLOBAL_POSITION_INT}
    assert len(windows) > 3
    told = entries[:400] + [entry for entry in entries[400:] if is_command(entry[1])]  # the rest tells nothing new
    return Case(basis, effects, told, ours, tuple(windows), max(heights))


def is_command(octets: bytes) -> bool:
    frame = read_frame(octets)
    return frame is not None and frame.component == OURS and nature(frame) is FrameNature.COMMAND


def covered(of: Case, octets: bytes, at_us: int, autopilot: int) -> bool:
    frame = read_shape(octets)
    assert frame is not None
    return any(
        window.begin <= at_us <= window.end and carries_out(frame, window.command, autopilot, of.home_amsl)
        for window in of.windows
    )


@pytest.mark.claim("T3")
@pytest.mark.slow
@pytest.mark.parametrize("kind", AUTOPILOTS)
@given(data=some.data())
def test_repeated_frame_is_found_like_in_the_naive_reading(kind: str, data: some.DataObject) -> None:
    of, autopilot = flown(kind), AUTOPILOTS[kind]
    edges = [edge + by for window in of.windows for edge in window[1:] if edge < 1 << 60 for by in (-1, 0, 1)]
    first, last = of.entries[0][0], of.entries[-1][0]
    at_us = data.draw(some.one_of(some.sampled_from(edges), some.integers(first, last + case.S)))
    octets = data.draw(some.sampled_from(of.commands))
    entries = list(of.entries)
    insort(entries, (at_us, octets), key=lambda entry: entry[0])
    frames = FrameAudit(iter(entries))
    frames.begin(of.basis)
    for effect in of.effects:
        frames.happened(effect)
    found = frames.over()
    heard = next(at for at, each in of.entries if (shape := read_shape(each)) and shape.message == GLOBAL_POSITION_INT)
    if at_us > heard:
        assert (found is None) == covered(of, octets, at_us, autopilot)
    if found is not None:
        assert str(at_us) in found.found


@pytest.mark.parametrize("kind", AUTOPILOTS)
@given(bits=some.integers(0, 40))
def test_flight_passes_if_the_clock_stands_still_for_a_while(kind: str, bits: int) -> None:
    """A paced clock stands still, so consecutive records and frames may have the same microsecond."""
    of = flown(kind)
    frames = FrameAudit((at_us >> bits << bits, octets) for at_us, octets in of.entries)
    frames.begin(of.basis)
    for effect in of.effects:
        frames.happened(msgspec.structs.replace(effect, utc_us=effect.utc_us >> bits << bits))
    assert frames.over() is None
