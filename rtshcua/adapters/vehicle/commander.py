"""Commands and their acknowledgements: one outstanding at a time, retried, with "unknown" kept apart from "refused".

A missing acknowledgement means that it is not known whether the command was executed; only the effect tells.
"""

from rtshcua.adapters.vehicle.flavour import Message, Stage

RETRY_US = 1_000_000
RETRIES = 5
#: An answer may come this late; within it, a refusal may belong to an earlier sending of the same command.
LATE_US = 5_000_000

NEVER = (1 << 63) - 1  # us

_ACCEPTED, _IN_PROGRESS = 0, 5
#: MAV_RESULT as slugs
RESULTS = {
    1: "temporarily",
    2: "denied",
    3: "unsupported",
    4: "failed",
    6: "cancelled",
    7: "only-as-command-long",
    8: "only-as-command-int",
    9: "unsupported-frame",
}


class Commander:
    """Sends the message of one stage and follows its acknowledgement; it serves all manoeuvres of a vehicle in turn.

    `accepted` and `refused` (the result) tell what the vehicle answered. A refusal counts only while it can belong to
    nothing but the one sending of this stage: after a retry the first one may have been obeyed, and what is refused is
    its repetition. `slack` stretches every wait: see `Driver`.
    """

    def __init__(self, slack: int = 1) -> None:
        self.slack = slack
        self._stage: Stage | None = None
        self._sent_us = 0
        self._tries = 0
        self._doubtful = False
        self._last_us: dict[int, int] = {}
        self.accepted = False
        self.refused: int | None = None
        self.busy_us: int | None = None

    def start(self, stage: Stage | None, now_us: int) -> list[Message]:
        """Begin another stage (None: none)."""
        self._stage, self._sent_us, self._tries = stage, now_us, 0
        self.accepted, self.refused, self.busy_us = False, None, None
        if stage is None or stage.message is None:
            return []
        self._doubtful = False
        if stage.command is not None:
            last_us = self._last_us.get(stage.command)
            self._doubtful = last_us is not None and now_us - last_us < LATE_US
            self._last_us[stage.command] = now_us
        return [stage.message]

    @property
    def waits(self) -> bool:
        """Whether a command of the present stage was sent and not answered yet."""
        stage = self._stage
        return stage is not None and stage.command is not None and not self.accepted and self.refused is None

    @property
    def due_us(self) -> int:
        """When `due` may next have something to send, unless something is acknowledged before."""
        stage = self._stage
        if stage is None or stage.message is None:
            return NEVER
        if stage.command is None:
            return self._sent_us + stage.repeat_us if stage.repeat_us else NEVER
        return NEVER if self.accepted or self._tries >= RETRIES else self._sent_us + RETRY_US * self.slack

    def acknowledge(self, command: int, result: int, now_us: int) -> None:
        """Take in one COMMAND_ACK of the vehicle. PX4 answers some twice: accepted, and then what came of it."""
        if self._stage is None or command != self._stage.command:
            return
        if result == _IN_PROGRESS:
            self._sent_us = self.busy_us = now_us  # it is at it: wait on
        elif result == _ACCEPTED:
            self.accepted = True
        elif not self._doubtful:
            self.refused = result

    def due(self, now_us: int) -> list[Message]:
        """What must be sent again now: an unanswered command with `confirmation` raised, or a repeated target."""
        stage = self._stage
        if stage is None or stage.message is None:
            return []
        if stage.command is None:
            if not stage.repeat_us or now_us - self._sent_us < stage.repeat_us:
                return []
        else:
            if self.accepted or self._tries >= RETRIES or now_us - self._sent_us < RETRY_US * self.slack:
                return []
            if hasattr(stage.message, "confirmation"):
                stage.message.confirmation = self._tries + 1
            self._doubtful = True
            self._last_us[stage.command] = now_us
        self._tries += 1
        self._sent_us = now_us
        return [stage.message]
