"""Bags as context managers: closed at the end of the block, whatever ends it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from types import TracebackType
from typing import Self

from rope_twin.errors import BagError


class Closing(ABC):
    """What can be closed, for `with`."""

    @abstractmethod
    def close(self) -> None:
        """Close; harmless a second time. Raises BagError if what was written is not safe."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close in any case: what was written before an error is worth keeping."""
        try:
            self.close()
        except BagError as failure:
            if error is None:
                raise
            error.add_note(str(failure))
