"""Files of the page, held in memory: each is read and compressed once, with a tag of its content.

A browser keeps what it has and asks whether the tag still holds, so that a reload sends no file.
"""

from __future__ import annotations

import gzip
import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

FOLDER = Path(__file__).with_name("page")
_TYPES = {
    ".html": "text/html; charset=utf-8", ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8", ".svg": "image/svg+xml", ".woff": "font/woff",
    ".txt": "text/plain; charset=utf-8",
}  # fmt: skip
_COMPRESSED = (".html", ".js", ".css", ".svg", ".txt")  # a WOFF font is compressed already


@dataclass(frozen=True)
class PageFile:
    """One file and the headers that go with it."""

    content: bytes
    compressed: bytes  # empty: it is sent as it is
    media_type: str
    tag: str

    def answer(self, asked: Mapping[str, str]) -> tuple[int, bytes, dict[str, str]]:
        """Return status, body and headers for the headers of a request (names in lower case)."""
        headers = {"ETag": self.tag, "Vary": "Accept-Encoding"}
        if self.tag in [one.strip() for one in asked.get("if-none-match", "").split(",")]:
            return 304, b"", headers
        headers["Content-Type"] = self.media_type
        if self.compressed and "gzip" in asked.get("accept-encoding", ""):
            return 200, self.compressed, headers | {"Content-Encoding": "gzip"}
        return 200, self.content, headers


def page_files() -> dict[str, PageFile]:
    """Return the files by their path below the folder of the page, such as `console.js`."""
    return {
        path.relative_to(FOLDER).as_posix(): _read(path)
        for path in FOLDER.rglob("*")
        if path.suffix in _TYPES
    }


def _read(path: Path) -> PageFile:
    content = path.read_bytes()
    compressed = gzip.compress(content, mtime=0) if path.suffix in _COMPRESSED else b""
    tag = f'"{hashlib.sha256(content).hexdigest()[:16]}"'
    return PageFile(content, compressed, _TYPES[path.suffix], tag)
