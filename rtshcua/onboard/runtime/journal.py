"""The journal: turns what the runtime does into actions, each outcome as an evidence line before what it covers."""

from rtshcua.evidence.chain import Recorder
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.ports import Action, Append, Show


class Journal:
    """Collects the actions of one `Runtime.step`, in order. All lines carry the moment of that step."""

    def __init__(self, recorder: Recorder) -> None:
        self.recorder = recorder
        self._actions: list[Action] = []

    def add(self, action: Action) -> None:
        """Add an action."""
        self._actions.append(action)

    def line(self, line: bytes) -> None:
        """Add an evidence line."""
        self._actions.append(Append(line, durable=False))

    def effect(
        self, now: Now, event: str, *, kind: int = -1, step: int = -1, link: int = -1, token: int = -1, detail: str = ""
    ) -> None:
        """Record something that happened, and show it. `detail` may be the world's own text."""
        self.line(self.recorder.effect(now, event, kind=kind, step=step, link=link, token=token, detail=detail))
        self._actions.append(Show(event, detail, step))

    def take(self) -> list[Action]:
        """What was collected since the last call."""
        actions, self._actions = self._actions, []
        return actions
