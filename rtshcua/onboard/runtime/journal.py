"""The journal: turns what the runtime does into actions, each outcome as an evidence line before what it covers."""

from rtshcua.evidence.chain import Recorder
from rtshcua.evidence.durability import SYNCED_FIRST, WRITTEN
from rtshcua.evidence.witnessing.anchors import ANCHORED
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.ports import Action, Append, Dispatch, Show


class Journal:
    """Collects the actions of one `Runtime.step`, in order. All lines carry the moment of that step.

    An epoch that should have been sealed long ago is sealed before anything else is recorded.
    """

    def __init__(self, recorder: Recorder) -> None:
        self.recorder = recorder
        self._actions: list[Action] = []

    def add(self, action: Action) -> None:
        """Add an action."""
        self._actions.append(action)

    def ready(self, now: Now) -> Recorder:
        """The recorder, for one line that is then added."""
        if self.recorder.overdue(now):
            self.seal(now)
        return self.recorder

    def decision(self, line: bytes, durability: int) -> None:
        """Add the line of a decision; a command that follows waits for it as its class of durability demands."""
        self._actions.append(Append(line, durability))

    def seal(self, now: Now) -> None:
        """End an epoch. Nothing waits for a seal, but it is on the disk soon: its checkpoint may be shown around."""
        self._actions.append(Append(self.recorder.seal(now), SYNCED_FIRST, awaited=False))

    def effect(
        self, now: Now, event: str, *, kind: int = -1, step: int = -1, link: int = -1, token: int = -1,
        detail: str = "", durability: int = WRITTEN,
    ) -> None:  # fmt: skip
        """Record something that happened, and show it. `detail` may be the world's own text."""
        line = self.ready(now).effect(
            now, event, kind=kind, step=step, link=link, token=token, detail=detail, durability=durability
        )
        self._actions.append(Append(line, durability, awaited=False))
        self._actions.append(Show(event, detail, step))

    def anchor(self, now: Now, note: str) -> None:
        """Record what a witness cosigned. It is for verifiers, and shown to nobody."""
        line = self.ready(now).effect(now, ANCHORED, detail=note)
        self._actions.append(Append(line, WRITTEN, awaited=False))

    def seal_when_idle(self, now: Now) -> None:
        """Seal an epoch that is over, unless something is sent in this step."""
        if self.recorder.due(now) and not any(isinstance(action, Dispatch) for action in self._actions):
            self.seal(now)

    def take(self) -> list[Action]:
        """What was collected since the last call."""
        actions, self._actions = self._actions, []
        return actions
