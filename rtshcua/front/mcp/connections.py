"""Connections over HTTP: nobody without the token keeps one for long, or keeps others out by having many."""

import asyncio
from typing import Any, Final

from uvicorn.protocols.http.h11_impl import H11Protocol

#: connections at a time, and how long one is waited for until it has sent the token, in seconds
MOST: Final = 64
PATIENCE_S: Final = 3.0
#: under which name a request's state has its connection
CONNECTION: Final = "connection"


class Connection(H11Protocol):
    """One connection. Where there are too many, the oldest that has not sent the token gives way."""

    def __init__(self, config: Any, server_state: Any, app_state: dict[str, Any], **more: Any) -> None:
        super().__init__(config, server_state, app_state | {CONNECTION: self}, **more)
        self._deadline: asyncio.TimerHandle | None = None
        self._came = 0.0

    def admit(self) -> None:
        """It has sent the token: it may stay as long as it likes."""
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self._came = self.loop.time()
        self._deadline = self.loop.call_later(PATIENCE_S, transport.abort)
        if len(self.connections) > MOST:
            strangers = [each for each in self.connections if isinstance(each, Connection) and each._deadline]
            oldest = min(strangers, key=lambda each: each._came)  # this one, where all others were admitted
            oldest._hang_up()

    def connection_lost(self, exc: Exception | None) -> None:
        self.admit()
        super().connection_lost(exc)

    def _hang_up(self) -> None:
        self.connections.discard(self)  # at once: the transport says so only when the loop comes round
        self.transport.abort()
