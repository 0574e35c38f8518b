"""Compiled entries on disk: a file for each, named by what it was compiled for, with a seal.

numba numbers an entry's files, and keeps in an index which number is whose. Two processes that
compile for two scenes at once then choose the same number, and one of them finds the other's code
there later; and a file that a crash of the machine cut short ends every start from then on. Here no
file is shared, numba's index is neither read nor written, and a file that is not as this user
wrote it (`CodeFolder.unseal`) is reported and compiled again, never unpickled.
"""

from __future__ import annotations

import hashlib
import inspect
import logging
import os
import pickle
from contextlib import suppress
from pathlib import Path
from typing import Any
from uuid import uuid4

import numba
from numba.core.caching import FunctionCache, UserProvidedCacheLocator
from numba.core.serialize import dumps

from rope_twin.core.jit.code_folder import CodeFolder

_log = logging.getLogger(__name__)


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
