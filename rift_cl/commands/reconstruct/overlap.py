"""Reading ahead and writing behind, so that disk, processor and device work at the same time.

While one slab is reconstructed, the next is read in one thread and the last is written in another;
the device is spoken to by the main thread alone, since drivers differ in what they allow others
(NVIDIA's was seen to crash). Every slab still goes through the same steps in the same order, so
that the result does not depend on who was faster.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from types import TracebackType
from typing import Any, TypeVar

Item = TypeVar("Item")
Value = TypeVar("Value")


def ahead(
    items: Iterable[Item], work: Callable[[Item], Value]
) -> closing[Generator[tuple[Item, Value], None, None]]:
    """Do work on items in another thread, one item ahead of whoever takes the results.

    Args:
        items: what to work on, in order.
        work: what to do; an exception of its is raised where its result would be taken.

    Returns:
        A context manager around a generator of (item, result); its end waits for the work that
        was begun.
    """
    return closing(_ahead(items, work))


def _ahead(
    items: Iterable[Item], work: Callable[[Item], Value]
) -> Generator[tuple[Item, Value], None, None]:
    with ThreadPoolExecutor(1, "read") as pool:
        begun: tuple[Item, Future[Value]] | None = None
        for item in items:
            following = item, pool.submit(work, item)
            if begun is not None:
                yield begun[0], begun[1].result()
            begun = following
        if begun is not None:
            yield begun[0], begun[1].result()


class Behind:
    """Does work in another thread, one piece at a time, and says later what went wrong.

    Use it in a ``with`` statement; its end waits for the last piece.
    """

    def __init__(self) -> None:
        self._pool = ThreadPoolExecutor(1, "write")
        self._begun: Future[Any] | None = None

    def __enter__(self) -> Behind:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            if kind is None:
                self.wait()
        finally:
            self._pool.shutdown(wait=True)

    def do(self, work: Callable[..., Any], *arguments: Any) -> None:
        """Begin a piece of work once the one before is done; what that one raised is raised."""
        self.wait()
        self._begun = self._pool.submit(work, *arguments)

    def offer(self, work: Callable[..., Any], *arguments: Any) -> None:
        """Begin a piece of work unless one is under way; what the one before raised is raised."""
        if self._begun is None or self._begun.done():
            self.do(work, *arguments)

    def wait(self) -> None:
        """Wait for the piece that was begun; what it raised is raised here."""
        begun, self._begun = self._begun, None
        if begun is not None:
            begun.result()
