"""A folder for compiled kernels that is this user's alone, and the seal on every file in it.

Compiled code is kept as pickles, and unpickling executes what it reads. So the folder must belong
to this user and be writable by nobody else, and each file begins with an HMAC-SHA256 under a key
that only this user can read: what was not written here is never unpickled. There is no fallback to
a place whose name others can predict.
"""

from __future__ import annotations

import atexit
import hashlib
import hmac
import logging
import os
import secrets
import shutil
import stat
import tempfile
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from rope_twin.errors import phrase

_log = logging.getLogger(__name__)
_KEY_BYTES = 32
_SEAL_BYTES = hashlib.sha256().digest_size  # before all else in a file
_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH
_OTHERS_AT_ALL = stat.S_IRWXG | stat.S_IRWXO


@dataclass(frozen=True)
class CodeFolder:
    """A checked folder, and the key that seals its files."""

    path: Path
    key: bytes = field(repr=False)

    def seal(self, content: bytes) -> bytes:
        """Return the content with its HMAC in front, as it is written to a file."""
        return hmac.digest(self.key, content, "sha256") + content

    def unseal(self, data: bytes) -> bytes | None:
        """Return the content of a file; None: it is damaged, or was not sealed with this key."""
        content = data[_SEAL_BYTES:]
        sealed = hmac.digest(self.key, content, "sha256")
        return content if hmac.compare_digest(sealed, data[:_SEAL_BYTES]) else None


def open_folder(digest: str) -> CodeFolder | None:
    """Open the folder for kernels of these sources: in $ROPE_TWIN_CACHE or the user's cache.

    Where that is not this user's alone or cannot be written, one warning says so and a new private
    folder serves this process and its forks. None: there is none either; nothing is kept.
    """
    chosen = os.environ.get("ROPE_TWIN_CACHE")
    home = chosen or os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    root = Path(home) / "rope_twin"
    try:
        root.parent.mkdir(parents=True, exist_ok=True)
        return _open(root, digest)
    except OSError as error:
        reason = str(error.strerror or error)
    right = "remove it or name a place of your own in ROPE_TWIN_CACHE"
    what = f"{reason}, so the kernels compiled by this process are not kept"
    _log.warning(phrase(f"compiled code in {root}", what, right))
    return _temporary(digest)


def _open(root: Path, digest: str) -> CodeFolder:
    """Make and judge the folder and the one above it. Raises OSError with the reason."""
    for folder in (root, root / digest):
        with suppress(FileExistsError):
            folder.mkdir(mode=0o700)
        if fault := _fault(folder.lstat()):
            raise PermissionError(None, fault)
    if not os.access(root / digest, os.W_OK):
        raise PermissionError(None, "the folder cannot be written")
    return CodeFolder(root / digest, _read_key(root / "key"))


def _fault(about: os.stat_result) -> str:
    """Why a folder is not this user's alone, or ''."""
    if not stat.S_ISDIR(about.st_mode):
        return "a folder is wanted, not a link or a file"
    if about.st_uid != os.geteuid():
        return f"the folder belongs to another user (uid {about.st_uid})"
    if about.st_mode & _OTHERS_WRITE:
        return f"others may write to the folder (mode {stat.S_IMODE(about.st_mode):04o})"
    return ""


def _read_key(path: Path) -> bytes:
    """The key, made at first use. Raises OSError if the file there is not this user's secret."""
    if not os.path.lexists(path):
        _make_key(path)
    descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC)
    with os.fdopen(descriptor, "rb") as file:
        about = os.fstat(file.fileno())
        key = file.read(_KEY_BYTES + 1)
    mine = stat.S_ISREG(about.st_mode) and about.st_uid == os.geteuid()
    if not mine or about.st_mode & _OTHERS_AT_ALL or len(key) != _KEY_BYTES:
        raise PermissionError(None, "its file 'key' is not a secret of this user (mode 0600)")
    return key


def _make_key(path: Path) -> None:
    """Write a new key, whole or not at all; of two processes at once the first one's holds."""
    part = path.with_name(f".key.{secrets.token_hex(8)}")
    descriptor = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(secrets.token_bytes(_KEY_BYTES))
            file.flush()
            os.fsync(file.fileno())
        with suppress(FileExistsError):
            os.link(part, path)
    finally:
        part.unlink()


def _temporary(digest: str) -> CodeFolder | None:
    """A new folder of an unpredictable name, removed when the process ends."""
    try:
        root = Path(tempfile.mkdtemp(prefix="rope_twin_"))
    except OSError:
        return None
    owner = os.getpid()

    def remove() -> None:
        if os.getpid() == owner:  # forks use it too, and leave it
            shutil.rmtree(root, ignore_errors=True)

    atexit.register(remove)
    try:
        return _open(root, digest)
    except OSError:
        return None
