"""X4 in flight: from the telemetry frame that reveals trouble to the first frame of the fallback's command, behind the
real driver, loop and runtime, as X1 measures.

The `short` mission is flown until its `hover`. There one frame of the vehicle is changed, so that it reports the
trouble, and the time counts from its arrival. Expired slack is no report: its time counts from the frame that releases
the step, whose request is then refused. The other conditions are not revealed by a frame: the trouble is in the
request, or reports are missing, which is answered at the deadline.
"""

import socket
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter_ns
from typing import Any, Final

from msgspec.structs import replace

from rtshcua.codec.frames import Codec, ReceivedFrame, kind_of
from rtshcua.evaluation.cases import BY_NAME, EXPIRED_SLACK, EvaluationCase, struck_step
from rtshcua.evaluation.design import EvaluationPoint
from rtshcua.evaluation.flights import TimedVehicle, compiled, fly, issued_us
from rtshcua.evaluation.results import FallbackReaction
from rtshcua.mavlink.framing import HEADER, octets_of_checksum
from rtshcua.model.outcome import Outcome
from rtshcua.onboard.ports import Event, Sent
from rtshcua.virtual.vehicle import SECOND, TICK_US

#: by case: the message that reveals it, and what its fields then have, in the message's units
REVEALING: Final[Mapping[str, tuple[str, Mapping[str, float]]]] = {
    "low battery": ("BATTERY_STATUS", {"battery_remaining": 30}),
    "degraded link": ("RADIO_STATUS", {"txbuf": 10}),
    "obstacle near": ("DISTANCE_SENSOR", {"current_distance": 200}),
    "wind over limit": ("WIND_COV", {"wind_x": 12.0, "wind_y": 0.0}),
}
#: what a case is that no frame reveals
_MISSING, _REQUESTED = "no frame: reports are missing", "no frame: the request itself is refused"
#: the cases that are flown
FLOWN: Final = (EXPIRED_SLACK.name, *REVEALING)
_POINT: Final = EvaluationPoint("short", 1_000_000)
#: us for which the step is flown before the frame comes, and by which the command before it seems to be sent too late
_FLOWN_US: Final = SECOND
_LATER_US: Final = _POINT.deadline_us + 10_000


def revealed_by(case: str) -> tuple[str, str]:
    """Which frame reveals a case, in words; or "", and why none does."""
    if case in REVEALING:
        return f"`{REVEALING[case][0]}`", ""
    if case == EXPIRED_SLACK.name:
        return "the frame that releases the step, which is refused", ""
    return "", _MISSING if BY_NAME[case].outcome is Outcome.DEFER else _REQUESTED


def reactions(case: str, mode: str, runs: int) -> list[FallbackReaction]:
    """One flight for each repetition. Raises RuntimeError where no fallback follows, BoundaryError and OSError."""
    return [_reaction(BY_NAME[case], mode, repetition) for repetition in range(1, runs + 1)]


def _reaction(case: EvaluationCase, mode: str, repetition: int) -> FallbackReaction:
    point = compiled(*_POINT, issued_us(repetition, mode))
    making = partial(_StruckVehicle, case, struck_step(point.mission))
    with (
        TemporaryDirectory(prefix="reaction-") as folder,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link,
    ):
        link.bind(("127.0.0.1", 0))
        begun = fly(point, mode, repetition, link, Path(folder), making).begun
    if not begun or begun[-1].command.needs_record:
        raise RuntimeError(f"{case.name}: no fallback was dispatched")
    return FallbackReaction(case=case.name, mode=mode, repetition=repetition, took_ns=begun[-1].took_ns)


class _StruckVehicle(TimedVehicle):
    """A vehicle whose flight is over when a link is dispatched, and in which a case strikes at a step."""

    def __init__(self, case: EvaluationCase, step: int, *given: Any, **chosen: Any) -> None:
        super().__init__(*given, **chosen)
        self._case, self._step = case, step
        self._message, self._fields = REVEALING.get(case.name, ("", {}))
        self._flown_from_us = -1  # when the step was first seen flying, in us since the start of the flight
        self._struck = False

    @property
    def over(self) -> bool:
        """Whether a link was dispatched."""
        return bool(self.begun) and not self.begun[-1].command.needs_record

    def poll(self, now_us: int, timeout_us: int) -> Sequence[Event]:
        """Wait no longer than a tick, as a real link returns at once when a frame came."""
        if self._flown_from_us < 0 and len(self.begun) > self._step:
            self._flown_from_us = self.clock.elapsed_us
        events = super().poll(now_us, min(timeout_us, TICK_US))
        if self._case is EXPIRED_SLACK and len(self.begun) == self._step:
            return [replace(each, at_us=each.at_us + _LATER_US) if isinstance(each, Sent) else each for each in events]
        return events

    def _take(self, datagrams: Iterable[bytes], events: list[Event]) -> None:
        waiting = list(datagrams)
        at, changed = self._revealing(waiting)
        super()._take(waiting[:at], events)
        if changed:
            self._struck = True
            self._waiting[:0] = waiting[at + 1 :]  # a socket still has them when this frame is read
            self._released = self.clock.elapsed_us, perf_counter_ns()
            super()._take([changed], events)

    def _revealing(self, datagrams: Sequence[bytes]) -> tuple[int, bytes]:
        """The place of the frame that is to reveal the trouble, and that frame, changed; behind all where none is."""
        flown_us = self.clock.elapsed_us - self._flown_from_us
        if self._message and not self._struck and self._flown_from_us >= 0 and flown_us >= _FLOWN_US:
            for at, datagram in enumerate(datagrams):
                for received in Codec(1, 1).parse(datagram):
                    if received.name == self._message and getattr(received.message, "orientation", 0) == 0:
                        return at, _changed(received, self._fields)
        return len(datagrams), b""


def _changed(received: ReceivedFrame, fields: Mapping[str, float]) -> bytes:
    """A frame with other values in fields of its message, which has no texts."""
    kind = kind_of(type(received.message).id)
    assert kind is not None
    assert kind.payload is not None
    for name, value in fields.items():
        setattr(received.message, name, value)
    payload = kind.payload(received.message).rstrip(b"\0") or b"\0"
    covered = bytes([len(payload)]) + received.frame[2:HEADER] + payload
    return received.frame[:1] + covered + octets_of_checksum(covered + kind.extra)
