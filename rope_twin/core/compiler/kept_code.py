"""Compiled entries on disk: a file for each, named by what it was compiled for, with a check sum.

numba numbers an entry's files, and keeps in an index which number is whose. Two processes that
compile for two scenes at once then choose the same number, and one of them finds the other's code
there later; and a file that a crash of the machine cut short ends every start from then on. Here no
file is shared, and one that is not as it was written is told, compiled again and written anew.
"""

from __future__ import annotations

import hashlib
import logging
import os
import pickle
from contextlib import suppress
from pathlib import Path
from typing import Any
from uuid import uuid4

import numba
from numba.core.caching import FunctionCache
from numba.core.serialize import dumps

_log = logging.getLogger(__name__)
_SUM = hashlib.sha256().digest_size  # bytes of the check sum, before all else in a file


class KeptCode(FunctionCache):  # type: ignore[misc]
    """numba's cache of one entry's code, for all types of arguments."""

    def _load_overload(self, sig: Any, target_context: Any) -> Any:
        """The code for a signature; None: there is none, or none that is whole."""
        if not self._enabled:
            return None
        key = self._index_key(sig, target_context.codegen())
        path = self._path_of(key)
        try:
            content = path.read_bytes()
        except FileNotFoundError:
            return None
        except OSError as error:
            _log.warning("compiled code cannot be read, it is compiled again: %s", error)
            return None
        if content[:_SUM] != hashlib.sha256(content[_SUM:]).digest():
            _log.warning("compiled code is damaged, it is compiled again: %s", path)
            return None
        compiled_for, data = pickle.loads(content[_SUM:])
        return self._impl.rebuild(target_context, data) if compiled_for == key else None

    def _save_overload(self, sig: Any, data: Any) -> None:
        """Write the code for a signature, whole or not at all."""
        if not self._enabled or not self._impl.check_cachable(data):
            return
        key = self._index_key(sig, data.codegen)
        content = dumps((key, self._impl.reduce(data)))
        path = self._path_of(key)
        part = path.with_suffix(f".{uuid4().hex}")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            part.write_bytes(hashlib.sha256(content).digest() + content)
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
