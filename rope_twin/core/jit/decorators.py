"""One compiler for all kernels, and a cache that edits can trust.

numba's own cache does not see edits in files that a kernel calls into, so the cache folder is named
by a digest of all kernel sources. It has to be set before numba compiles anything, and so has the
vectoriser's option: with its default, LLVM gives up on loops over many arrays because the run-time
overlap checks exceed a limit (5 times slower node loops in a prototype; a test reads the assembly
of this version).

**Folder.** Compiled code is kept as pickles, and unpickling executes what it reads. So the folder
must belong to this user and be writable by nobody else, and each file begins with an HMAC-SHA256
under a key that only this user can read: what was not written here is never unpickled. There is no
fallback to a place whose name others can predict.

**Files.** numba numbers an entry's files, and keeps in an index which number is whose. Two
processes that compile for two scenes at once then choose the same number, and one of them finds the
other's code there later; and a file that a crash of the machine cut short ends every start from
then on. Here an entry has a file for each set of types it was compiled for, named by it: none is
shared, numba's index is neither read nor written, and a file that is not as this user wrote it
(`CodeFolder.unseal`) is reported and compiled again, never unpickled.
"""

from __future__ import annotations

import atexit
import hashlib
import hmac
import inspect
import logging
import os
import pickle
import secrets
import shutil
import stat
import tempfile
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from uuid import uuid4

import llvmlite.binding
import numba
from numba.core import config
from numba.core.caching import FunctionCache, UserProvidedCacheLocator
from numba.core.registry import cpu_target
from numba.core.serialize import dumps

from rope_twin.core.jit.compiler import EntryCompiler, LinkedCompiler
from rope_twin.errors import phrase

_PACKAGE = Path(__file__).resolve().parents[2]
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


class KeptCode(FunctionCache):  # type: ignore[misc]
    """numba's cache of one entry's code, for all types of arguments."""

    def __init__(self, function: Any, folder: CodeFolder) -> None:
        place = UserProvidedCacheLocator.get_suitable_cache_subpath(inspect.getfile(function))
        # numba would make it with whatever mode the process's mask leaves
        with suppress(OSError):  # then nothing can be kept, which is said when it is tried
            (folder.path / place).mkdir(mode=0o700, exist_ok=True)
        super().__init__(function)
        self._cache_path = str(folder.path / place)
        self._cache_file = None  # numba's own index and data, which it unpickles unchecked
        self._folder = folder

    def flush(self) -> None:
        """Keep what is there: a file is named by what it was compiled for, so none is stale."""

    def _load_overload(self, sig: Any, target_context: Any) -> Any:
        """The code for a signature; None: there is none, or none that is whole."""
        if not self._enabled:
            return None
        key = self._index_key(sig, target_context.codegen())
        path = self._path_of(key)
        try:
            data = path.read_bytes()
        except FileNotFoundError:
            return None
        except OSError as error:
            _log.warning("compiled code cannot be read, it is compiled again: %s", error)
            return None
        content = self._folder.unseal(data)
        if content is None:
            _log.warning("compiled code is damaged, it is compiled again: %s", path)
            return None
        compiled_for, reduced = pickle.loads(content)
        return self._impl.rebuild(target_context, reduced) if compiled_for == key else None

    def _save_overload(self, sig: Any, data: Any) -> None:
        """Write the code for a signature, whole or not at all."""
        if not self._enabled or not self._impl.check_cachable(data):
            return
        key = self._index_key(sig, data.codegen)
        content = dumps((key, self._impl.reduce(data)))
        path = self._path_of(key)
        part = path.with_suffix(f".{uuid4().hex}")
        try:
            part.write_bytes(self._folder.seal(content))
            os.replace(part, path)
        except OSError as error:
            with suppress(OSError):
                part.unlink()
            _log.warning("compiled code is not kept, the next start compiles it again: %s", error)

    def _path_of(self, key: Any) -> Path:
        """The file of a key: signature, processor, and what the entry itself is."""
        words = "; ".join(map(str, (numba.__version__, *key)))
        digest = hashlib.sha256(words.encode()).hexdigest()[:32]
        return Path(self._cache_path) / f"{self._impl.filename_base}.{digest}.nbc"


def source_digest() -> str:
    """SHA-256 (first 16 digits) of every file that can change a compiled kernel."""
    digest = hashlib.sha256()
    for folder in ("core", "effects", "vortex"):
        for path in sorted((_PACKAGE / folder).rglob("*.py")):
            digest.update(path.name.encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


llvmlite.binding.set_option("numba", "-vectorize-memory-check-threshold=2000")
FOLDER = open_folder(source_digest())  # None: nothing is kept
if FOLDER is not None:
    os.environ["NUMBA_CACHE_DIR"] = config.CACHE_DIR = str(FOLDER.path)

# No nnan and ninf: with them, tests for NaN and infinity are compiled away. No reassoc: LLVM orders
# a sum by what stands around it, and a rope in lanes (core/lanes) would get other bits than alone.
_FAST = {"contract", "nsz", "arcp", "afn"}
# The elimination keeps the order of its sums: it stays exact for stiffness over mass up to 1e6.
_ORDERED = {"contract", "nsz"}
# Which products LLVM fuses with sums ("contract") depends on the code around them, which for a
# branching kernel differs between one rope and lanes. Here each operation rounds by itself, and
# `fused` (core/jit/functions) says where a product and a sum are one.
_EXACT = {"nsz"}

# Without numba's run-time a kernel cannot allocate: an allocation in the loop does not compile.
# Passing arrays then costs no reference counts either (they were a third of a short step).
OPTIONS: dict[str, Any] = {
    "nogil": True,
    "error_model": "numpy",
    "fastmath": _FAST,
    "_nrt": False,
    "no_cfunc_wrapper": True,
    "pipeline_class": EntryCompiler,
}


# Kernels are called by kernels, and need no wrapper for Python.
LINKED: dict[str, Any] = {
    **OPTIONS,
    "no_cpython_wrapper": True,
    "pipeline_class": LinkedCompiler,
}
INLINED: dict[str, Any] = {**LINKED, "forceinline": True}  # LLVM puts it into its callers


def make_ready() -> None:
    """Load what numba loads when it is first asked for compiled code; that takes half a second."""
    cpu_target.target_context.refresh()


def jit(function: Any) -> Any:
    """Compile a kernel that other kernels call."""
    return numba.njit(**LINKED)(function)


def jit_sum(function: Any) -> Any:
    """Compile a kernel that adds many numbers up, in whatever order is fastest."""
    return numba.njit(**{**LINKED, "fastmath": _FAST | {"reassoc"}})(function)


def jit_ordered(function: Any) -> Any:
    """Compile a kernel whose sums must not be reordered."""
    return numba.njit(**{**LINKED, "fastmath": _ORDERED})(function)


def jit_exact(function: Any) -> Any:
    """Compile a kernel that rounds alike for one rope and in lanes, whatever stands around it."""
    return numba.njit(**{**LINKED, "fastmath": _EXACT})(function)


def jit_entry(function: Any) -> Any:
    """Compile a kernel that Python calls, and keep its code on disk."""
    return _entry(function, OPTIONS)


def jit_entry_exact(function: Any) -> Any:
    """Compile a kernel that Python calls and that rounds after each operation, as Python does."""
    return _entry(function, {**OPTIONS, "fastmath": False})


def _entry(function: Any, options: dict[str, Any]) -> Any:
    entry = numba.njit(**options)(function)
    if entry is not function and FOLDER is not None:  # plain Python has nothing to keep
        entry._cache = KeptCode(function, FOLDER)
    return entry


def jit_apart(function: Any) -> Any:
    """Compile a large kernel that LLVM need not put into its callers, nor what it calls.

    numba inlines a kernel everywhere that was first compiled for an inlined one, unless it is said
    not to be; and so with all that this kernel calls.
    """
    return numba.njit(**{**LINKED, "forceinline": False})(function)


def jit_within(function: Any) -> Any:
    """Compile a small function of numbers that LLVM puts into its callers' loops."""
    return numba.njit(**INLINED)(function)


def jit_exact_within(function: Any) -> Any:
    """Compile a small function of numbers as `jit_exact` does, for LLVM to put into its callers."""
    return numba.njit(**{**INLINED, "fastmath": _EXACT})(function)


def jit_ordered_within(function: Any) -> Any:
    """Compile such a function, or a kernel once more, with sums that must not be reordered."""
    plain = getattr(function, "py_func", function)
    return numba.njit(**{**INLINED, "fastmath": _ORDERED})(plain)


def compiled(entry: Any, arguments: tuple[Any, ...]) -> Any:
    """The machine code of an entry for arguments of these types, called without numba's dispatch.

    The caller sees to it that the arguments are of these types. Plain Python: the entry itself.
    """
    if config.DISABLE_JIT:
        return entry
    signature = tuple(numba.typeof(argument) for argument in arguments)
    entry.compile(signature)
    return entry.overloads[signature].entry_point


def kind_of(values: Iterable[Any]) -> str:
    """Return what a step is compiled for: the types of these values; equal words, equal code."""
    return "; ".join(str(numba.typeof(value)) for value in values)


def assembly(entry: Any, arguments: tuple[Any, ...]) -> str:
    """The assembly of an entry for arguments of these types.

    It is compiled afresh, which takes some ten seconds for a step: cached code has none to read.
    """
    fresh = numba.njit(**OPTIONS)(entry.py_func)
    fresh.compile(tuple(numba.typeof(argument) for argument in arguments))
    (signature,) = fresh.signatures
    return str(fresh.inspect_asm(signature))
