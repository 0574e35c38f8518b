"""Compile options of all kernels, and the compile cache on disk.

numba's own cache does not notice edits in files that a kernel calls into, so the cache folder is
named by a digest of all kernel sources. It has to be set before numba compiles anything, and so has
the option of LLVM's vectoriser: by default LLVM does not vectorise loops over many arrays, because
the run-time overlap checks exceed a limit.

**Security.** Compiled code is stored as pickles, and unpickling executes code. So the folder must
belong to this user and be writable by nobody else, and each file begins with an HMAC-SHA256 under a
key that only this user can read: a file of other origin is never unpickled. There is no fallback to
a predictable path.

**Files.** numba numbers the files of an entry and maintains an index of them. Two concurrent
processes may choose the same number for different types, and a truncated file breaks every later
start. Here an entry has one file for each set of argument types, named by their hash: numba's index
is not used, and a file that fails the HMAC check (`CodeFolder.unseal`) is reported and recompiled.
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
_SEAL_BYTES = hashlib.sha256().digest_size  # at the start of a file
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
        """Return the content of a file, or None if its HMAC does not match."""
        content = data[_SEAL_BYTES:]
        sealed = hmac.digest(self.key, content, "sha256")
        return content if hmac.compare_digest(sealed, data[:_SEAL_BYTES]) else None


def open_folder(digest: str) -> CodeFolder | None:
    """Open the folder for kernels of these sources: in $ROPE_TWIN_CACHE or the user's cache.

    If that folder is not private or cannot be written, log one warning and use a new private folder
    for this process and its forks. Return None if that fails too; nothing is then cached.
    """
    configured = os.environ.get("ROPE_TWIN_CACHE")
    home = configured or os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    root = Path(home) / "rope_twin"
    try:
        root.parent.mkdir(parents=True, exist_ok=True)
        return _open(root, digest)
    except OSError as error:
        reason = str(error.strerror or error)
    remedy = "remove it or name a place of your own in ROPE_TWIN_CACHE"
    consequence = f"{reason}, so the kernels compiled by this process are not kept"
    _log.warning(phrase(f"compiled code in {root}", consequence, remedy))
    return _temporary(digest)


def _open(root: Path, digest: str) -> CodeFolder:
    """Make and check the folder and its parent. Raises OSError with the reason."""
    for folder in (root, root / digest):
        with suppress(FileExistsError):
            folder.mkdir(mode=0o700)
        if fault := _fault(folder.lstat()):
            raise PermissionError(None, fault)
    if not os.access(root / digest, os.W_OK):
        raise PermissionError(None, "the folder cannot be written")
    return CodeFolder(root / digest, _read_key(root / "key"))


def _fault(status: os.stat_result) -> str:
    """Return why a folder is not private to this user, or ''."""
    if not stat.S_ISDIR(status.st_mode):
        return "a folder is wanted, not a link or a file"
    if status.st_uid != os.geteuid():
        return f"the folder belongs to another user (uid {status.st_uid})"
    if status.st_mode & _OTHERS_WRITE:
        return f"others may write to the folder (mode {stat.S_IMODE(status.st_mode):04o})"
    return ""


def _read_key(path: Path) -> bytes:
    """Return the key, made at first use. Raises OSError if its file is not private to this user."""
    if not os.path.lexists(path):
        _make_key(path)
    descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC)
    with os.fdopen(descriptor, "rb") as file:
        status = os.fstat(file.fileno())
        key = file.read(_KEY_BYTES + 1)
    owned = stat.S_ISREG(status.st_mode) and status.st_uid == os.geteuid()
    if not owned or status.st_mode & _OTHERS_AT_ALL or len(key) != _KEY_BYTES:
        raise PermissionError(None, "its file 'key' is not a secret of this user (mode 0600)")
    return key


def _make_key(path: Path) -> None:
    """Write a new key atomically; of two concurrent processes the first one's key is used."""
    temporary = path.with_name(f".key.{secrets.token_hex(8)}")
    descriptor = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(secrets.token_bytes(_KEY_BYTES))
            file.flush()
            os.fsync(file.fileno())
        with suppress(FileExistsError):
            os.link(temporary, path)
    finally:
        temporary.unlink()


def _temporary(digest: str) -> CodeFolder | None:
    """Return a new private folder, removed when the process ends, or None."""
    try:
        root = Path(tempfile.mkdtemp(prefix="rope_twin_"))
    except OSError:
        return None
    owner = os.getpid()

    def remove() -> None:
        if os.getpid() == owner:  # not in forks, which use it too
            shutil.rmtree(root, ignore_errors=True)

    atexit.register(remove)
    try:
        return _open(root, digest)
    except OSError:
        return None


class CompileCache(FunctionCache):  # type: ignore[misc]
    """Compile cache of one entry, for all argument types."""

    def __init__(self, function: Any, folder: CodeFolder) -> None:
        subfolder = UserProvidedCacheLocator.get_suitable_cache_subpath(inspect.getfile(function))
        # numba would make it with the mode of the process's umask
        with suppress(OSError):  # reported when code is saved
            (folder.path / subfolder).mkdir(mode=0o700, exist_ok=True)
        super().__init__(function)
        self._cache_path = str(folder.path / subfolder)
        self._cache_file = None  # numba's own index and data, which it unpickles unchecked
        self._folder = folder

    def flush(self) -> None:
        """Do nothing: files are named by what they were compiled for, so none is stale."""

    def _load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the code for a signature, or None if there is none or it is damaged."""
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
        """Write the code for a signature atomically."""
        if not self._enabled or not self._impl.check_cachable(data):
            return
        key = self._index_key(sig, data.codegen)
        content = dumps((key, self._impl.reduce(data)))
        path = self._path_of(key)
        temporary = path.with_suffix(f".{uuid4().hex}")
        try:
            temporary.write_bytes(self._folder.seal(content))
            os.replace(temporary, path)
        except OSError as error:
            with suppress(OSError):
                temporary.unlink()
            _log.warning("compiled code is not kept, the next start compiles it again: %s", error)

    def _path_of(self, key: Any) -> Path:
        """Return the file for a key: signature, processor and bytecode of the entry."""
        text = "; ".join(map(str, (numba.__version__, *key)))
        digest = hashlib.sha256(text.encode()).hexdigest()[:32]
        return Path(self._cache_path) / f"{self._impl.filename_base}.{digest}.nbc"


def source_digest() -> str:
    """Return the SHA-256 (first 16 digits) of all files that kernels are compiled from."""
    digest = hashlib.sha256()
    for folder in ("core", "effects", "vortex"):
        for path in sorted((_PACKAGE / folder).rglob("*.py")):
            digest.update(path.name.encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


llvmlite.binding.set_option("numba", "-vectorize-memory-check-threshold=2000")
FOLDER = open_folder(source_digest())  # None without a cache
if FOLDER is not None:
    os.environ["NUMBA_CACHE_DIR"] = config.CACHE_DIR = str(FOLDER.path)

# No nnan and ninf: tests for NaN and infinity would be compiled away. No reassoc: the order of sums
# would depend on the surrounding code and differ between a single rope and lanes (core/lanes).
_FAST = {"contract", "nsz", "arcp", "afn"}
# Elimination preserves the order of its sums, for accuracy at stiffness over mass up to 1e6.
_ORDERED = {"contract", "nsz"}
# Which products LLVM contracts with sums depends on the surrounding code, which for a branching
# kernel differs between a single rope and lanes. Here each operation is rounded individually, and
# multiply-adds are explicit: `fused` (core/jit/functions).
_EXACT = {"nsz"}

# Without numba's run-time (NRT) a kernel cannot allocate, and arrays are passed without reference
# counting.
OPTIONS: dict[str, Any] = {
    "nogil": True,
    "error_model": "numpy",
    "fastmath": _FAST,
    "_nrt": False,
    "no_cfunc_wrapper": True,
    "pipeline_class": EntryCompiler,
}


# Kernels that are called by kernels only need no Python wrapper.
LINKED: dict[str, Any] = {
    **OPTIONS,
    "no_cpython_wrapper": True,
    "pipeline_class": LinkedCompiler,
}
INLINED: dict[str, Any] = {**LINKED, "forceinline": True}


def make_ready() -> None:
    """Load numba's target registries, which takes half a second at the first compilation."""
    cpu_target.target_context.refresh()


def jit(function: Any) -> Any:
    """Compile a kernel that other kernels call."""
    return numba.njit(**LINKED)(function)


def jit_sum(function: Any) -> Any:
    """Compile a kernel that sums many numbers, in any order (reassociation)."""
    return numba.njit(**{**LINKED, "fastmath": _FAST | {"reassoc"}})(function)


def jit_ordered(function: Any) -> Any:
    """Compile a kernel whose sums must not be reordered."""
    return numba.njit(**{**LINKED, "fastmath": _ORDERED})(function)


def jit_exact(function: Any) -> Any:
    """Compile a kernel whose rounding does not depend on inlining: equal in lanes and alone."""
    return numba.njit(**{**LINKED, "fastmath": _EXACT})(function)


def jit_entry(function: Any) -> Any:
    """Compile a kernel that Python calls, and keep its code on disk."""
    return _entry(function, OPTIONS)


def jit_entry_exact(function: Any) -> Any:
    """Compile a kernel that Python calls and that rounds after each operation, as Python does."""
    return _entry(function, {**OPTIONS, "fastmath": False})


def _entry(function: Any, options: dict[str, Any]) -> Any:
    entry = numba.njit(**options)(function)
    if entry is not function and FOLDER is not None:  # plain Python: njit returns the function
        entry._cache = CompileCache(function, FOLDER)
    return entry


def jit_noinline(function: Any) -> Any:
    """Compile a large kernel that is not forced inline, nor are its callees.

    numba forces a kernel inline everywhere if it was first compiled for an inlined caller, unless
    the option is set explicitly; callees inherit the option.
    """
    return numba.njit(**{**LINKED, "forceinline": False})(function)


def jit_within(function: Any) -> Any:
    """Compile a small scalar function that is inlined into its callers' loops."""
    return numba.njit(**INLINED)(function)


def jit_exact_within(function: Any) -> Any:
    """Compile a small scalar function or recompile a kernel as `jit_exact` does, inlined."""
    python_function = getattr(function, "py_func", function)
    return numba.njit(**{**INLINED, "fastmath": _EXACT})(python_function)


def jit_ordered_within(function: Any) -> Any:
    """Compile a function or recompile a kernel, inlined, with sums that must not be reordered."""
    python_function = getattr(function, "py_func", function)
    return numba.njit(**{**INLINED, "fastmath": _ORDERED})(python_function)


def compiled(entry: Any, arguments: tuple[Any, ...]) -> Any:
    """Return the machine code of an entry for these argument types, bypassing numba's dispatcher.

    The caller must pass arguments of exactly these types. In plain Python return the entry itself.
    """
    if config.DISABLE_JIT:
        return entry
    signature = tuple(numba.typeof(argument) for argument in arguments)
    entry.compile(signature)
    return entry.overloads[signature].entry_point


def kind_of(values: Iterable[Any]) -> str:
    """Return the numba types of these values as text; equal texts share compiled code."""
    return "; ".join(str(numba.typeof(value)) for value in values)


def assembly(entry: Any, arguments: tuple[Any, ...]) -> str:
    """Return the assembly of an entry for arguments of these types.

    The entry is recompiled, about 10 s for a step, since cached code contains no assembly.
    """
    fresh = numba.njit(**OPTIONS)(entry.py_func)
    fresh.compile(tuple(numba.typeof(argument) for argument in arguments))
    (signature,) = fresh.signatures
    return str(fresh.inspect_asm(signature))
