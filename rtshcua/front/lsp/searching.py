"""Requests about the whole workspace, answered in a separate thread, so that findings are not delayed.

They run one at a time, on a copy of the session's texts, in steps of one program; between steps the thread checks
whether the editor has cancelled the request. The answer is for the texts at the time of the request: a renaming names
their versions, and an editor does not apply it to others.
"""

import asyncio
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from threading import Event
from typing import Any, TypeVar

from lsprotocol import types as lsp
from pygls.exceptions import JsonRpcRequestCancelled

from rtshcua.front.lsp.texts import Texts

T = TypeVar("T")
Tell = Callable[[int, int], None]
"""Receives the number of finished steps, and of all steps."""


class Search:
    """One request: its steps, and whether it was cancelled."""

    def __init__(self, tell: Tell | None = None) -> None:
        self._gone = Event()
        self._tell = tell

    def give_up(self) -> None:
        """Cancel the request."""
        self._gone.set()

    def steps(self, each: Iterable[T], *, told: bool = True) -> Iterator[T]:
        """Yield the items, and report progress if `told`. Raises JsonRpcRequestCancelled once cancelled."""
        every = list(each)
        for done, one in enumerate(every):
            if self._gone.is_set():
                raise JsonRpcRequestCancelled
            if told and self._tell is not None:
                self._tell(done, len(every))
            yield one


class Searching:
    """The thread and its running requests."""

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1, "search")
        self._running: set[Search] = set()

    async def answer(
        self, texts: Texts, work: Callable[[Texts, Search, Any], T], params: Any, tell: Tell | None = None
    ) -> T:
        """Run `work` on a copy of the present texts, and return its result. Raises its exceptions."""
        loop = asyncio.get_running_loop()

        def told(done: int, of: int) -> None:
            if tell is not None:
                loop.call_soon_threadsafe(tell, done, of)

        search = Search(told)
        self._running.add(search)
        copied = texts.copied()
        try:
            found = await loop.run_in_executor(self._thread, work, copied, search, params)
            texts.desk.learn(copied.desk)
            return found
        finally:
            search.give_up()
            self._running.discard(search)

    def end(self) -> None:
        """Cancel all running and waiting requests."""
        for search in tuple(self._running):
            search.give_up()
        self._thread.shutdown(wait=False, cancel_futures=True)


class Shown:
    """The progress display of the editor, from the first step until `end`."""

    def __init__(self, notify: Callable[[lsp.ProgressParams], None], token: int | str | None, title: str) -> None:
        self._notify = notify
        self._token = token
        self._title = title
        self._last = -1  # per cent

    def tell(self, done: int, of: int) -> None:
        """Report the number of finished steps; each whole per cent once."""
        percent = 100 * done // max(of, 1)
        if self._token is None or percent == self._last:
            return
        value: lsp.WorkDoneProgressBegin | lsp.WorkDoneProgressReport = (
            lsp.WorkDoneProgressBegin(self._title, cancellable=True, percentage=percent)
            if self._last < 0
            else lsp.WorkDoneProgressReport(message=f"{done} of {of} sources", percentage=percent)
        )
        self._last = percent
        self._notify(lsp.ProgressParams(self._token, value))

    def end(self) -> None:
        """End the progress display."""
        if self._token is not None and self._last >= 0:
            self._notify(lsp.ProgressParams(self._token, lsp.WorkDoneProgressEnd()))
            self._token = None
