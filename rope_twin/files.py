"""Files that come with the package, and files that are written as a whole or not at all."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rope_twin.errors import InputError, RopeTwinError, did_you_mean, phrase

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


def shipped_file(
    name_or_path: str | Path, folder: str, noun: str, error: type[RopeTwinError] = InputError
) -> Path:
    """Return the file of a path, or of a name in config/FOLDER (without its suffix).

    Raises:
        RopeTwinError: of the type `error`; there is none of this name.
    """
    path = Path(name_or_path)
    if isinstance(name_or_path, Path) or len(path.parts) > 1 or path.suffix in (".yaml", ".yml"):
        return path
    known = {file.stem: file for file in (share_dir() / "config" / folder).glob("*.yaml")}
    if name_or_path in known:
        return known[name_or_path]
    if name_or_path and path.exists():
        return path
    remedy = f"{did_you_mean(name_or_path, known)} (or give the path of a YAML file)"
    raise error(phrase(f"{noun} '{name_or_path}'", f"there is no such {noun}", remedy))


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """Yield the path of a temporary file in the same folder, which becomes the file at the end.

    An error or an interruption in between removes it and leaves an old file unchanged.

    Raises:
        OSError: the disk rejects it.
    """
    part = path.with_name(f".{path.name}.part")
    try:
        yield part
        part.replace(path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise
    _sync_folder(path.parent)


def write_whole(path: Path, data: bytes) -> None:
    """Write a temporary file in the same folder, sync it to disk, rename it, and sync the folder.

    Raises:
        OSError: the disk rejects it; the old file is unchanged and the temporary one removed.
    """
    with written_whole(path) as part, part.open("wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


def _sync_folder(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
