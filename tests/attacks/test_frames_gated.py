"""Threat: an attacker who controls the runtime, with every key on board except the boundary's, alters the raw frames
beside a log: the commands that passed the gate are changed, added, removed or reordered.
"""

from collections.abc import Iterable, Sequence
from functools import cache

import pytest

from reference.forgery import read
from reference.kept_frames import kept
from reference.verifiers import ROOT_KEY
from rtshcua.evidence.finding import Finding
from rtshcua.ground.audit.audit import Auditor
from rtshcua.ground.audit.frame_meaning import FrameNature, nature, read_frame
from rtshcua.ground.audit.frames import OURS, FrameAudit
from virtual import case
from virtual.flight import Flight

Entries = Sequence[tuple[int, bytes]]


@cache
def flown() -> tuple[tuple[bytes, ...], Entries]:
    """A short flight: its lines, and its frames."""
    flight = Flight(case.seal(case.mission(case.low_steps())), case.simulated("ardupilot"))
    entries = kept(flight)
    return tuple(flight.fly().lines), tuple(entries)


def found(entries: Iterable[tuple[int, bytes]]) -> Finding | None:
    """The audit's findings for the flight with these frames."""
    frames = FrameAudit(iter(entries))
    auditor = Auditor(ROOT_KEY, frames=frames)
    for line in flown()[0]:
        auditor.take(line)
    return auditor.audit().report.failure or frames.over()


def commands() -> list[int]:
    """The numbers of the frames that passed the gate as commands."""
    numbers = []
    for number, (_, octets) in enumerate(flown()[1]):
        frame = read_frame(octets)
        if frame is not None and frame.component == OURS and nature(frame) is FrameNature.COMMAND:
            numbers.append(number)
    return numbers


def statement(at_us: int) -> int:
    """The first statement of the boundary after a moment."""
    records = [read(line) for line in flown()[0]]
    return next(r["seq"] for r in records if r.get("event") == "boundary" and r["utc_us"] >= at_us)


def test_genuine_frames_match_gate_digest() -> None:
    assert len(commands()) > 3
    assert found(flown()[1]) is None


@pytest.mark.parametrize("which", [0, 1, -1])
def test_omitted_command_frame_is_detected(which: int) -> None:
    lines, entries = flown()
    number = commands()[which]
    finding = found([*entries[:number], *entries[number + 1 :]])
    assert finding is not None
    assert finding.slug == "boundary/frames"
    assert finding.record >= statement(entries[number][0])
    assert finding.record < len(lines)


def test_duplicated_command_frame_is_detected() -> None:
    entries = flown()[1]
    number = commands()[1]
    finding = found([*entries[: number + 1], entries[number], *entries[number + 1 :]])
    assert finding is not None
    assert (finding.slug, finding.record) == ("boundary/frames", statement(entries[number][0]))


def test_repeated_command_frame_at_end_is_detected() -> None:
    entries = flown()[1]
    number = commands()[-1]
    finding = found([*entries[: number + 1], entries[number], *entries[number + 1 :]])
    assert finding is not None
    assert finding.slug == "boundary/frames"


def test_harmless_alteration_of_frame_is_detected() -> None:
    """Its sequence number, which nothing else covers."""
    entries = list(flown()[1])
    number = commands()[0]
    at_us, octets = entries[number]
    entries[number] = at_us, octets[:4] + bytes([octets[4] ^ 1]) + octets[5:]
    finding = found(entries)
    assert finding is not None
    assert (finding.slug, finding.record) == ("boundary/frames", statement(at_us))


def test_omission_of_all_command_frames_is_detected() -> None:
    entries = flown()[1]
    gone = set(commands())
    finding = found(entry for number, entry in enumerate(entries) if number not in gone)
    assert finding is not None
    assert finding.slug == "boundary/frames"
