"""The airspace becomes the vehicle's fence: uploaded, read back, switched on; begun anew when that failed."""

from math import isfinite
from typing import Any, Final

from rtshcua.adapters.vehicle.fence import Fence, fence_of
from rtshcua.adapters.vehicle.flavour import Flavour, Message
from rtshcua.adapters.vehicle.messages import FENCE
from rtshcua.adapters.vehicle.parameters import Parameters
from rtshcua.adapters.vehicle.upload import Step, Upload
from rtshcua.model.flat.policy import Policy

#: After a failure it waits so long before it begins again.
AGAIN_US: Final = 10_000_000

#: The messages of the mission protocol that `take` looks at.
HEEDED: Final = ("MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_ACK", "MISSION_COUNT", "MISSION_ITEM_INT")


class Fencing:
    """`unready` says what is not settled; `note` what an operator should know once it is."""

    def __init__(self, policy: Policy, flavour: Flavour, parameters: Parameters, *, wanted: bool, slack: int) -> None:
        self._fence = fence_of(policy, flavour.fence) if wanted else None
        self._habits = flavour.fence
        self._parameters = parameters
        self._slack = slack
        self._upload = self._begin()
        self._failed_us: int | None = None
        self._problem: str | None = None

    def due(self, system: int, now_us: int) -> list[Message]:
        """What to send now."""
        if self._upload is None:
            return []
        if self._failure() is None:
            self._failed_us = None
        elif self._failed_us is None:
            self._failed_us, self._problem = now_us, self._failure()
        elif now_us - self._failed_us >= AGAIN_US * self._slack:
            self._failed_us, self._upload = None, self._begin()
            for name, _ in self._habits.switches:
                self._parameters.forget(name)
        out = [] if self._upload is None else self._upload.due(system, now_us)
        if self._is_there:
            self._switch()
        return out

    def take(self, name: str, message: Any, system: int, now_us: int) -> list[Message]:
        """A message of the mission protocol; what answers it."""
        if self._upload is None or name not in HEEDED or message.mission_type != FENCE:
            return []
        return self._upload.take(name, message, system, now_us)

    @property
    def unready(self) -> str | None:
        """Why the fence is not there yet; None where none is wanted, or possible."""
        if self._upload is None or self._upload.step is Step.UNSUPPORTED:
            return None
        if self._is_there and all(self._is_on(name, bits) for name, bits in self._habits.switches):
            return None
        return self._failure() or self._problem or "its fence is being set"

    @property
    def note(self) -> str:
        """What became of it, once nothing is outstanding."""
        if self._fence is None:
            return "its own fence was left as it is"
        if self._upload is not None and self._upload.step is Step.UNSUPPORTED:
            return "it takes no fence: the policy's airspace is watched by this program alone"
        return _told(self._fence)

    @property
    def _is_there(self) -> bool:
        return self._upload is not None and self._upload.step is Step.DONE

    def _begin(self) -> Upload | None:
        if self._fence is None or not self._fence.items:
            return None
        return Upload(self._fence.items, self._habits.frame, self._slack)

    def _failure(self) -> str | None:
        if self._upload is not None and self._upload.step is Step.FAILED:
            return f"its fence could not be set: it {self._upload.problem}; `--no-fence` flies without"
        for name, _ in self._habits.switches if self._is_there else ():
            if self._parameters.is_absent(name):
                return f"its fence could not be switched on: no answer about `{name}`; `--no-fence` flies without"
        return None

    def _switch(self) -> None:
        """Read each switch, and set the bits that it lacks."""
        for name, bits in self._habits.switches:
            if name not in self._parameters.values:
                if not self._parameters.is_absent(name):
                    self._parameters.read(name)
            elif not self._is_on(name, bits) and self._parameters.is_settled(name):
                self._parameters.write(name, float(self._set_bits(name) | bits))

    def _is_on(self, name: str, bits: int) -> bool:
        return self._set_bits(name) & bits == bits

    def _set_bits(self, name: str) -> int:
        value = self._parameters.values.get(name, 0.0)
        return int(value) if isfinite(value) else 0


def _told(fence: Fence) -> str:
    if not fence.items:
        return f"no fence was set, for none can say this airspace: {'; '.join(fence.left_out)}"
    many = f"{len(fence.items)} item{'' if len(fence.items) == 1 else 's'}"
    text = f"its fence was set to the policy's airspace ({many}), and read back"
    return f"{text}; not in it: {'; '.join(fence.left_out)}" if fence.left_out else text
