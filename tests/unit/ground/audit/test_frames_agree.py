"""The auditor and the boundary, implemented independently, agree on the frames that belong to a command."""

from functools import cache
from struct import pack

import pytest
from hypothesis import given
from hypothesis import strategies as some

from reference.kinds_of_flight import recorded
from rtshcua.ground.audit.frame_meaning import AuditedFrame, FrameNature, HomeHeights, MotionTarget, is_part_of, nature
from rtshcua.ground.audit.frame_meaning import read_frame as read
from rtshcua.mavlink.layouts import LAYOUTS
from rtshcua.mavlink.modes import ARDUPILOT, PX4
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.mission import ALONG
from rtshcua.onboard.enforcement.allow_list import Frame as Shape
from rtshcua.onboard.enforcement.allow_list import carries_out, read_frame
from rtshcua.onboard.ports import Command

AUTOPILOTS = {"px4": PX4, "ardupilot": ARDUPILOT}
HOME = 488_000


@cache
def commands(kind: str) -> tuple[Shape, ...]:
    """The commands among the frames of a flight."""
    entries = recorded("none", kind).entries
    frames = [read_frame(octets) for _, octets in entries if nature_of(octets) is FrameNature.COMMAND]
    return tuple(dict.fromkeys(frame for frame in frames if frame is not None))


def nature_of(octets: bytes) -> FrameNature | None:
    frame = read(octets)
    return nature(frame) if frame is not None and frame.component == 191 else None


#: values with a meaning in some field of some frame
VALUES = (
    0, 1, -1, 2, 3, 4, 5, 6, 9, 12, 15.0, 17, 22, 21_196, 176, 178, 192, 400, float("nan"), float("inf"), 0x0DF8,
    0x09F8, 1.5707963705062866, -1.5707963705062866,
)  # fmt: skip
POINTS = ((473_978_000, 85_456_000), (473_979_000, 85_457_000))


@pytest.mark.slow
@pytest.mark.parametrize("kind", AUTOPILOTS)
@given(data=some.data())
def test_auditor_and_boundary_accept_the_same_frames(kind: str, data: some.DataObject) -> None:
    frame = data.draw(some.sampled_from(commands(kind)))
    fields = list(frame.fields)
    motion = data.draw(some.sampled_from(list(MotionKind)))
    there = (473_978_000, 85_456_000)
    if frame.message == 75:
        there = (fields[4], fields[5])
    elif frame.message == 86:
        there = (fields[1], fields[2])
    for _ in range(data.draw(some.integers(0, 2))):
        at = data.draw(some.integers(0, len(fields) - 1))
        fields[at] = data.draw(some.sampled_from((*VALUES, *there, fields[at] + 1, 515.0)))
    altitude, speed = data.draw(some.sampled_from((15_000, 20_000))), data.draw(some.sampled_from((0, 4_000, 5_000)))
    path = data.draw(some.sampled_from(((), there, (*POINTS[0], *there))))
    geo = tuple(int(each) for each in path)
    count = len(geo) // 2
    heights = data.draw(some.sampled_from(((), (15_000, 20_000)[:count])))
    headings = data.draw(some.sampled_from(((), (ALONG, 9_000)[:count], (9_000, 27_000)[:count])))
    command = Command(1, "x", int(motion), geo, geo, altitude, speed, heights=heights, headings=headings)
    points: dict[tuple[int, int], frozenset[tuple[int, int]]] = {}
    for at, place in enumerate(zip(geo[::2], geo[1::2], strict=True)):
        points[place] = points.get(place, frozenset()) | {(command.height_at(at), command.heading_at(at))}
    target = MotionTarget(int(motion), points, altitude, speed)
    shape = frame._replace(fields=tuple(fields))
    mine = AuditedFrame(frame.system, frame.component, frame.message, tuple(fields))
    home = data.draw(some.sampled_from((None, HOME, HOME + 1_500)))
    autopilot = data.draw(some.sampled_from((PX4, ARDUPILOT)))
    said = is_part_of(mine, target, autopilot, None if home is None else HomeHeights(home, home))
    assert said == carries_out(shape, command, autopilot, home)


@pytest.mark.parametrize("kind", AUTOPILOTS)
def test_sample_flight_has_many_kinds_of_commands(kind: str) -> None:
    assert len({(frame.message, frame.fields[7]) for frame in commands(kind)}) >= 3


@given(some.binary(max_size=120), some.integers(0, 1 << 24))
def test_reading_arbitrary_octets_does_not_raise(payload: bytes, message: int) -> None:
    octets = pack("<BBBBBBB", 0xFD, len(payload), 0, 0, 0, 1, 191) + message.to_bytes(4, "little")[:3] + payload
    for data in (octets, octets + b"\0\0", octets[:-3], payload):
        frame = read(data)
        if frame is not None:
            nature(frame)
            for autopilot in (PX4, ARDUPILOT):
                for motion in MotionKind:
                    is_part_of(frame, MotionTarget(int(motion), {}, 10_000, 1_000), autopilot, HomeHeights(0, 0))


@given(some.sampled_from(sorted(LAYOUTS)), some.binary(min_size=60, max_size=60))
def test_auditor_and_boundary_read_the_same_fields(message: int, payload: bytes) -> None:
    size = LAYOUTS[message].fields.size
    octets = pack("<BBBBBBB", 0xFD, size, 0, 0, 0, 1, 191) + message.to_bytes(3, "little") + payload[:size] + b"\0\0"
    mine, theirs = read(octets), read_frame(octets)
    assert mine is not None
    if mine.fields and theirs is not None:
        assert repr(mine.fields) == repr(theirs.fields)
