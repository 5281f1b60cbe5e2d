"""Send the requests of a recorded session to the simulated vehicle, at the same times of its clock."""

from heapq import merge

from recorded.trace import Heard, Question, Trace
from rtshcua.codec.frames import Codec
from rtshcua.simulation.config import SimulationConfig
from rtshcua.simulation.world import Simulation

_AFTER_US = 3_000_000
_LOOK_US = 100_000


class Replay:
    """The simulated session; `heard` holds the received frames, like `Trace.of_vehicle`."""

    def __init__(self, trace: Trace, config: SimulationConfig) -> None:
        self.simulation = Simulation(config)
        self.heard: list[Heard] = []
        self._codec = Codec(0, 0)
        self._upload: Question | None = None
        beats: list[Heard | Question] = list(trace.heartbeats)
        asked: list[Heard | Question] = list(trace.questions)
        last_us = 0
        for next_ in merge(beats, asked, key=lambda e: e.at_us):
            self._wait(next_.at_us)
            if isinstance(next_, Question):
                self._upload = next_ if next_.items else self._upload
                self._send(next_.heard)
            else:
                self._send(next_)
            last_us = next_.at_us
        self._wait(last_us + _AFTER_US)

    def _wait(self, until_us: int) -> None:
        at_us = self.simulation.now_us
        while at_us < until_us:
            at_us = min(at_us + _LOOK_US, until_us)
            self._take(self.simulation.advance(at_us))

    def _send(self, heard: Heard) -> None:
        self._take(self.simulation.receive(heard.received.frame, self.simulation.now_us))

    def _take(self, datagrams: list[bytes]) -> None:
        for datagram in datagrams:
            for received in self._codec.parse(datagram):
                if received.component == 1:
                    self.heard.append(Heard(self.simulation.now_us, received))
                    self._answer(self.heard[-1])

    def _answer(self, heard: Heard) -> None:
        if heard.name in ("MISSION_REQUEST", "MISSION_REQUEST_INT") and self._upload is not None:
            wanted = [item for item in self._upload.items if item.message.seq == heard.message.seq]
            if wanted and wanted[0].message.mission_type == heard.message.mission_type:
                self._send(wanted[0])
