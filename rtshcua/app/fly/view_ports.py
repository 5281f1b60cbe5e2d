"""How whoever started a flight is told of it and asked: the ports that a front end fills in."""

from collections.abc import Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Protocol

from rtshcua.app.fly.story import Message
from rtshcua.wire.keys import Duty, SigningKey


class LiveView(Protocol):
    """The view of one flight. It never makes the flight wait."""

    @property
    def shown(self) -> bool:
        """Whether all of it was shown, once the view has ended."""
        ...

    def post(self, message: Message, *, keep: bool = True) -> None:
        """Tell it something; unless `keep`, only if it can be told now."""
        ...

    def flush(self) -> None:
        """Tell it what waits, as far as it takes that now."""
        ...


class Console(Protocol):
    """Where a flight was started."""

    @property
    def as_json(self) -> bool:
        """A program reads what is told."""
        ...

    @property
    def live(self) -> bool:
        """The view is drawn anew all the time."""
        ...

    def say(self, text: str) -> None:
        """Tell a person, beside the view."""
        ...

    def emit(self, event: Mapping[str, object]) -> None:
        """Tell a program, beside the view."""
        ...

    def view(self) -> AbstractContextManager[LiveView]:
        """The view of a flight, until it is left: then all of it is shown, or whoever looked has gone."""
        ...

    def detail_of(self, event: str, detail: str) -> str:
        """An effect's detail in words, by its event."""
        ...

    def unlock(self, duty: Duty, path: Path | None) -> SigningKey:
        """The key of a duty, from a file or else the key store; a person may be asked for its passphrase. Raises
        `Untrusted` and OSError.
        """
        ...
