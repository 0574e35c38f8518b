"""Location of the files that come with the package: scenes, rope presets, sea states, bags."""

from __future__ import annotations

import os
import sys
from pathlib import Path

_PACKAGE = "rope_twin"


def share_dir() -> Path:
    """Return the folder that holds config/, bags/ and launch/.

    A source tree first (so that edits count), then the prefixes of a sourced ROS workspace, then
    the Python environment's own prefix.

    Raises:
        FileNotFoundError: if none of them holds the package's files.
    """
    source = Path(__file__).resolve().parent.parent
    if (source / "config" / "scenes").is_dir() and (source / "package.xml").is_file():
        return source
    prefixes = [*os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep), sys.prefix]
    for prefix in prefixes:
        folder = Path(prefix) / "share" / _PACKAGE
        if prefix and (folder / "config" / "scenes").is_dir():
            return folder
    raise FileNotFoundError(
        f"the files of {_PACKAGE} (config/, bags/) are in none of {prefixes}; reinstall the package"
    )
