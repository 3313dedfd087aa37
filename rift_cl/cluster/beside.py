"""What takes a while to begin and to end does so in a thread of its own, while others go on."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import AbstractContextManager, ExitStack
from types import TracebackType
from typing import Generic, TypeVar

Value = TypeVar("Value")


class Beside(Generic[Value]):
    """Enters a context manager in another thread, and leaves it there.

    Use it in a ``with`` statement; its end waits until the context is left.

    Args:
        context: entered at once.
    """

    def __init__(self, context: AbstractContextManager[Value]) -> None:
        self._pool = ThreadPoolExecutor(1, "beside")
        self._stack = ExitStack()
        self._entered = self._pool.submit(self._stack.enter_context, context)
        self._left: Future[None] | None = None

    def get(self) -> Value:
        """Wait for what the context gives; what it raised is raised here."""
        return self._entered.result()

    def leave(self) -> None:
        """Leave the context; waits for nothing."""
        if self._left is None:
            self._left = self._pool.submit(self._stack.close)

    def __enter__(self) -> Beside[Value]:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.leave()
        self._pool.shutdown(wait=True)
        if kind is None and self._left is not None:
            self._left.result()
