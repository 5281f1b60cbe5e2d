"""Whether the link to the autopilot is up, in both directions, and a clock that only runs while it is.

Nothing that we send arrives on a link that is cut, and nothing that we see is the present. So what waits for an effect
or an answer waits in *link time*: a manoeuvre does not fail because nobody could hear of its success.
"""

from typing import Final

#: Nothing at all came from the autopilot for this long: the link is silent. Its streams come several times a second.
SILENT_US: Final = 1_000_000
#: Nothing that was asked was answered for this long, though the autopilot is heard: it does not hear us.
UNANSWERED_US: Final = 3_000_000

SILENT: Final = "silent"
UNANSWERED: Final = "heard, but it answers nothing"


class LinkWatch:
    """Told of every frame, question and answer; `slack` stretches its limits, see `Driver`. Times in us."""

    def __init__(self, slack: int = 1) -> None:
        self._slack = slack
        #: when it was last heard
        self.heard_us: int | None = None
        self._unanswered_us: int | None = None  # since when a question stands open
        self._seen_us: int | None = None
        self._up_us = 0
        #: whether it ever answered anything: one that never did cannot be held to it
        self.answers = False
        #: why the link is down; None while it is up
        self.down: str | None = None

    @property
    def up_us(self) -> int:
        """Link time: how long the link was up in sum, as of the last call."""
        return self._up_us

    def heard(self, now_us: int) -> None:
        """A frame of the autopilot came."""
        self.heard_us = now_us

    def asked(self, now_us: int) -> None:
        """Something was asked that the autopilot answers."""
        if self._unanswered_us is None:
            self._unanswered_us = now_us

    def answered(self) -> None:
        """It answered."""
        self._unanswered_us, self.answers = None, True

    def look(self, now_us: int) -> bool:
        """Let time pass; True when the link went down, or came up again, since the last look."""
        if self.heard_us is None:
            return False
        if self._seen_us is not None and self.down is None:
            self._up_us += min(now_us - self._seen_us, SILENT_US * self._slack)  # we may have been held up ourselves
        self._seen_us = now_us
        was, self.down = self.down, self._why(now_us)
        return (was is None) != (self.down is None)

    def _why(self, now_us: int) -> str | None:
        if self.heard_us is not None and now_us - self.heard_us > SILENT_US * self._slack:
            # What was asked meanwhile could not be answered; the question is put anew when it is heard again.
            self._unanswered_us = None
            return SILENT
        asked_us = self._unanswered_us
        if self.answers and asked_us is not None and now_us - asked_us > UNANSWERED_US * self._slack:
            return UNANSWERED
        return None
