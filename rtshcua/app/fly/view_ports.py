"""The ports through which a flight shows its progress and unlocks keys; a front end implements them."""

from collections.abc import Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Protocol

from rtshcua.app.fly.story import Message
from rtshcua.wire.keys import Duty, SigningKey


class LiveView(Protocol):
    """The view of one flight. It never blocks the flight."""

    @property
    def shown(self) -> bool:
        """Whether all messages were shown, once the view has ended."""
        ...

    def post(self, message: Message, *, keep: bool = True) -> None:
        """Send a message to the view; without `keep`, drop it if it cannot be sent at once."""
        ...

    def flush(self) -> None:
        """Send waiting messages, as far as the view accepts them now."""
        ...


class Console(Protocol):
    """The console from which a flight was started."""

    @property
    def as_json(self) -> bool:
        """Whether output is JSON for a program."""
        ...

    @property
    def live(self) -> bool:
        """Whether the view is redrawn continuously."""
        ...

    def say(self, text: str) -> None:
        """Show a text outside of the view."""
        ...

    def emit(self, event: Mapping[str, object]) -> None:
        """Write a JSON event outside of the view."""
        ...

    def view(self) -> AbstractContextManager[LiveView]:
        """Open the view of a flight. It closes after all messages are shown, or its reader has gone."""
        ...

    def detail_of(self, event: str, detail: str) -> str:
        """The detail of an effect as text, by its event."""
        ...

    def unlock(self, duty: Duty, path: Path | None) -> SigningKey:
        """The key of a duty, from a file or else the key store; may ask the user for the passphrase. Raises `Untrusted`
        and OSError.
        """
        ...
