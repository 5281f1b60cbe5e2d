"""The examination: a driver that also asks the doctor's questions and keeps what everybody says.

It sends what any driver sends before a flight, the fence apart, and questions: each is housekeeping, and passes the
frame session like all else. Nothing is armed, moved, set or uploaded.
"""

from typing import Any, Final

from rtshcua.adapters.doctor.facts import Facts
from rtshcua.adapters.doctor.settings import SETTINGS
from rtshcua.adapters.vehicle import messages
from rtshcua.adapters.vehicle.driver import Driver
from rtshcua.adapters.vehicle.link import Heard
from rtshcua.adapters.vehicle.parameters import Parameters
from rtshcua.adapters.vehicle.preflight import Preflight
from rtshcua.codec.frames import Codec
from rtshcua.mavlink.signing import Verifier
from rtshcua.model.flat.policy import Policy
from rtshcua.onboard.enforcement.frames import FrameSession
from rtshcua.onboard.ports import Clock, Event, Readings, Said

_ASK_US: Final = 1_000_000
_ONCE: Final = ("AUTOPILOT_VERSION", "HOME_POSITION", "SYSTEM_TIME")


class Examination(Driver):
    """Listens and asks. `facts` and `parameters` hold the answers."""

    def __init__(
        self, policy: Policy, clock: Clock, frames: FrameSession, verifier: Verifier | None = None,
        system: int | None = None,
    ) -> None:  # fmt: skip
        super().__init__(policy, frames, fence=False, verifier=verifier, system=system)
        self.facts = Facts()
        self.parameters: Parameters | None = None
        self._clock = clock
        self._ears = Codec(0, 0)
        self._asked_us: int | None = None

    def receive(self, datagram: bytes, now_us: int) -> Heard:
        """As any driver, and keep what was heard: who speaks, and of what is believed what it says."""
        heard = super().receive(datagram, now_us)
        self.facts.system = self._system
        utc_us = self._clock.now().utc_us
        for frame in self._ears.parse(datagram, now_us):
            self.facts.meet(frame)
        for frame in heard.frames:
            self.facts.hear(frame, now_us, utc_us)
            if frame.name == "PARAM_VALUE" and frame.system == self._system and self.parameters is not None:
                self.parameters.take(frame.message)
        clock = self.source.clock
        if clock.answered_us is not None:
            self.facts.answered = True
            self.facts.round_trip_us, self.facts.clock_error_us = clock.round_trip_us, clock.error_us
        self._note(heard.events)
        return heard

    def overhear(self, datagram: bytes, now_us: int) -> None:
        """Somebody else speaks at this port; under the vehicle's own id that is no talker to be counted."""
        super().overhear(datagram, now_us)
        for frame in self._ears.parse(datagram, now_us):
            if frame.system != self._system:
                self.facts.meet(frame)

    @property
    def settled(self) -> Preflight | None:
        """What is compared with the policy; None before a heartbeat."""
        return self._preflight

    def tick(self, now_us: int) -> tuple[list[Event], list[bytes]]:
        """As any driver, and ask what is due."""
        events, frames = super().tick(now_us)
        self._note(events)
        flavour = self.flavour
        if flavour is None:
            return events, frames
        if self.parameters is None:
            self.parameters = Parameters(bytewise=flavour.bytewise)
            for setting in SETTINGS[flavour.name]:
                self.parameters.read(setting.parameter)
        send: list[Any] = self.parameters.due(self._system, now_us)
        if self._asked_us is None or now_us - self._asked_us >= _ASK_US:
            self._asked_us = now_us
            send += [messages.request(self._system, name) for name in _ONCE if name not in self.facts.streams]
        return events, frames + self._pack(send, now_us, events)

    def _note(self, events: Any) -> None:
        for event in events:
            if isinstance(event, Readings):
                self.facts.values.update(event.values)
            elif isinstance(event, Said):
                self.facts.say(event.text)
