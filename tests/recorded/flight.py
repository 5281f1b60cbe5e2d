"""Repeat a recorded flight of the runtime on the simulated vehicle, with its frames and the presumed pilot actions."""

from collections.abc import Sequence

from recorded.trace import CLIENT, SECOND, Heard, Trace
from rtshcua.codec.frames import Codec
from rtshcua.model.faults import Fault
from rtshcua.simulation.config import SimulationConfig
from rtshcua.simulation.world import Simulation

LEAD_US = 3 * SECOND
"""The age of the simulated vehicle at the start of the recording: booted, with heartbeats in phase."""
_LOOK_US = 20_000
_ITEM, _REQUESTS = "MISSION_ITEM_INT", ("MISSION_REQUEST", "MISSION_REQUEST_INT")


class Flight:
    """`real` and `own` hold the frames of either vehicle, at microseconds from the first frame of the recording.

    `pilot` holds frames of a ground station, and `faults` the faults, with their times.
    """

    def __init__(
        self,
        trace: Trace,
        config: SimulationConfig,
        pilot: Sequence[tuple[float, bytes]] = (),
        faults: Sequence[Fault] = (),
    ) -> None:
        start_us = trace.heard[0].at_us
        heard = [Heard(h.at_us - start_us, h.received) for h in trace.heard]
        self.real = [h for h in heard if h.received.component == 1]
        self.own: list[Heard] = []
        self.home = config.home
        self.simulation = Simulation(config)
        for fault in faults:
            self.simulation.inject(fault)
        self._codec = Codec(0, 0)
        ours = [h for h in heard if h.received.component == CLIENT]
        self._items = [h for h in ours if h.name == _ITEM]
        frames = [(h.at_us, h.received.frame) for h in ours if h.name != _ITEM]
        frames += [(round(at * SECOND), frame) for at, frame in pilot]
        for at_us, frame in sorted(frames, key=lambda entry: entry[0]):
            self._wait(at_us)
            self._take(self.simulation.receive(frame, self.simulation.now_us))
        self._wait(heard[-1].at_us)

    def _wait(self, until_us: int) -> None:
        simulation = self.simulation
        while simulation.now_us < until_us + LEAD_US:
            self._take(simulation.advance(min(simulation.now_us + _LOOK_US, until_us + LEAD_US)))

    def _take(self, datagrams: list[bytes]) -> None:
        for datagram in datagrams:
            for received in self._codec.parse(datagram):
                if received.component == 1:
                    self.own.append(Heard(self.simulation.now_us - LEAD_US, received))
                    self._upload(self.own[-1])

    def _upload(self, heard: Heard) -> None:
        """Answer a mission item request, as the runtime did."""
        if heard.name not in _REQUESTS or heard.at_us < 0:
            return
        m = heard.message
        wanted = [i for i in self._items if (i.message.seq, i.message.mission_type) == (m.seq, m.mission_type)]
        if wanted:
            self._take(self.simulation.receive(wanted[0].received.frame, self.simulation.now_us))
