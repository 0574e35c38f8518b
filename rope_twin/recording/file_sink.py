"""A file that is only ever appended to, and that outlives a full disk.

What the disk does not take waits in memory and is tried again at the next flush, so a disk that was
full for a moment leaves no hole and no broken record.
"""

from __future__ import annotations

import os
from pathlib import Path

WAITING_LIMIT_BYTES = 64 * 2**20


class FileSink:
    """The stream that an MCAP writer writes to: `write`, `tell`, `flush`.

    Unbuffered below: once `flush` has returned and nothing waits, the bytes are with the operating
    system and survive the death of this process.
    """

    def __init__(self, path: Path) -> None:
        """Raises OSError if the file exists or cannot be made."""
        self._path = path
        self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
        self._waiting = bytearray()
        self._written = 0
        self._trouble = ""

    @property
    def trouble(self) -> str:
        """Why bytes are waiting, in the words of the operating system; '' if all is well."""
        return self._trouble

    @property
    def waiting_bytes(self) -> int:
        """Bytes not yet taken by the file."""
        return len(self._waiting)

    @property
    def written_bytes(self) -> int:
        """Bytes taken by the file."""
        return self._written

    @property
    def displaced(self) -> bool:
        """Whether the path no longer leads to this file: it or a folder was deleted or moved."""
        if self._descriptor < 0:
            return False
        own = os.fstat(self._descriptor)
        try:
            there = os.stat(self._path)
        except OSError:
            return True
        return (there.st_dev, there.st_ino) != (own.st_dev, own.st_ino)

    def write(self, data: bytes) -> int:
        """Append, in memory until the next flush."""
        self._waiting += data
        return len(data)

    def tell(self) -> int:
        """Where the next byte will stand in the file."""
        return self._written + len(self._waiting)

    def flush(self) -> None:
        """Hand what waits to the file; a refusal is kept in `trouble`, nothing is dropped."""
        done = 0
        try:
            while done < len(self._waiting):
                done += os.write(self._descriptor, memoryview(self._waiting)[done:])
            self._trouble = ""
        except OSError as error:
            self._trouble = error.strerror or str(error)
        self._written += done
        del self._waiting[:done]

    def close(self) -> None:
        """Flush once more and let go of the file."""
        if self._descriptor >= 0:
            self.flush()
            os.close(self._descriptor)
            self._descriptor = -1
