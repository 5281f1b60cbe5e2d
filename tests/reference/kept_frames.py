"""The raw frames of a flight in virtual time, as they are stored next to its log."""

from collections.abc import Sequence
from typing import Any

from rtshcua.mavlink.framing import frame_length, unsigned
from rtshcua.onboard.ports import Event
from virtual.flight import Flight

Entries = list[tuple[int, bytes]]


def kept(flight: Flight) -> Entries:
    """A list that fills during the flight: (UTC us, frame), received and sent."""
    entries: Entries = []
    vehicle, clock = flight.vehicle, flight.clock
    send, receive = vehicle._send, vehicle.driver.receive

    def sending(frames: Sequence[bytes], events: list[Event]) -> None:
        for frame in frames:
            entries.append((clock.now().utc_us, unsigned(frame)))
            send([frame], events)

    def receiving(datagram: bytes, now_us: int) -> Any:
        at = 0
        while at < len(datagram):
            end = at + frame_length(datagram, at)
            entries.append((clock.now().utc_us, unsigned(datagram[at:end])))
            at = end
        return receive(datagram, now_us)

    vehicle._send = sending
    vehicle.driver.receive = receiving
    return entries
