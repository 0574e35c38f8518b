"""Append-only file that survives a full disk.

Bytes that the disk rejects are kept in memory and written again at the next flush, so that a
temporarily full disk leaves neither a gap nor a broken record.

What the disk does not take waits in memory and is tried again at the next flush, so a disk that was
full for a moment leaves no hole and no broken record.
"""

from __future__ import annotations

import os
from pathlib import Path

WAITING_LIMIT_BYTES = 64 * 2**20


class FileSink:
    """Stream for an MCAP writer: `write`, `tell`, `flush`.

    Unbuffered below: once `flush` has returned and nothing waits, the bytes are with the operating
    system and survive the death of this process.
    """

    def __init__(self, path: Path) -> None:
        """Create the file.

        Raises:
            OSError: the file exists or cannot be created.
        """
        self._path = path
        self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
        self._waiting = bytearray()
        self._written = 0
        self._trouble = ""

    @property
    def trouble(self) -> str:
        """Return why bytes are pending, in the words of the operating system, or ""."""
        return self._trouble

    @property
    def waiting_bytes(self) -> int:
        """Return the number of bytes not yet written to the file."""
        return len(self._waiting)

    @property
    def written_bytes(self) -> int:
        """Return the number of bytes written to the file."""
        return self._written

    @property
    def displaced(self) -> bool:
        """Return whether the file or one of its folders was deleted or moved."""
        if self._descriptor < 0:
            return False
        own = os.fstat(self._descriptor)
        try:
            there = os.stat(self._path)
        except OSError:
            return True
        return (there.st_dev, there.st_ino) != (own.st_dev, own.st_ino)

    def write(self, data: bytes) -> int:
        """Append bytes in memory until the next flush."""
        self._waiting += data
        return len(data)

    def tell(self) -> int:
        """Return the position in the file of the next byte."""
        return self._written + len(self._waiting)

    def flush(self) -> None:
        """Write the pending bytes; an error is kept in `trouble`, and no byte is dropped."""
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
        """Flush once more and close the file."""
        if self._descriptor >= 0:
            self.flush()
            os.close(self._descriptor)
            self._descriptor = -1
