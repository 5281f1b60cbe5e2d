"""Questions about the whole workspace, in a thread of their own, so that findings do not wait for them.

One at a time, on a copy of the session's texts, in steps of one program each; between steps the thread looks whether
the editor has taken its question back. The answer is true of the texts as they were when it was asked: a renaming names
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
"""Is told how many steps are done, of how many."""


class Search:
    """One question: its steps, and whether anybody still wants to know."""

    def __init__(self, tell: Tell | None = None) -> None:
        self._gone = Event()
        self._tell = tell

    def give_up(self) -> None:
        """Nobody wants to know any more."""
        self._gone.set()

    def steps(self, each: Iterable[T], *, told: bool = True) -> Iterator[T]:
        """The same, one after the other. Raises JsonRpcRequestCancelled as soon as nobody wants to know any more."""
        every = list(each)
        for done, one in enumerate(every):
            if self._gone.is_set():
                raise JsonRpcRequestCancelled
            if told and self._tell is not None:
                self._tell(done, len(every))
            yield one


class Searching:
    """The thread, and what runs in it. `end` has it stop."""

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1, "search")
        self._running: set[Search] = set()

    async def answer(
        self, texts: Texts, work: Callable[[Texts, Search, Any], T], params: Any, tell: Tell | None = None
    ) -> T:
        """What `work` says of the texts as they are now. Raises what it raises."""
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
        """Gives up all that runs and waits."""
        for search in tuple(self._running):
            search.give_up()
        self._thread.shutdown(wait=False, cancel_futures=True)


class Shown:
    """Progress that the editor shows: begun with the first step, ended with `end`."""

    def __init__(self, notify: Callable[[lsp.ProgressParams], None], token: int | str | None, title: str) -> None:
        self._notify = notify
        self._token = token
        self._title = title
        self._last = -1  # per cent

    def tell(self, done: int, of: int) -> None:
        """So many steps are done; each whole per cent is told once."""
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
        """It is over."""
        if self._token is not None and self._last >= 0:
            self._notify(lsp.ProgressParams(self._token, lsp.WorkDoneProgressEnd()))
            self._token = None
