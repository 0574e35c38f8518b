"""Tables of numbers in text files: a header of names, one row per line, `#` begins a comment."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rope_twin.errors import InputError, did_you_mean, phrase
from rope_twin.sea.spectrum import Vector
from rope_twin.share import share_dir


def find_table(name_or_path: str, folder: str) -> Path:
    """Return the file of a name in config/FOLDER (without its suffix), or of a path.

    Raises:
        InputError: there is no such file.
    """
    if is_path(name_or_path):
        path = Path(name_or_path)
        if path.is_file():
            return path
        raise InputError(phrase(str(path), "there is no such file", "give the path of a table"))
    known = {path.stem: path for path in (share_dir() / "config" / folder).glob("*.csv")}
    if name_or_path in known:
        return known[name_or_path]
    right = did_you_mean(name_or_path, known)
    raise InputError(phrase(f"'{name_or_path}'", f"no table of config/{folder}/", right))


def is_path(name_or_path: str) -> bool:
    """Return whether a table is given by a path instead of a name."""
    return "/" in name_or_path or name_or_path.startswith(".") or name_or_path.endswith(".csv")


def read_columns(path: Path, names: Sequence[str]) -> dict[str, Vector]:
    """Return the columns of these names, (rows,) each, in any order of the file.

    Raises:
        InputError: a column is missing, or a value is not a finite number; with the line.
    """
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(
            phrase(str(path), f"it cannot be read ({error})", "give a text file")
        ) from None
    told = [(k, line) for k, line in enumerate(lines, 1) if line.strip() and line.strip()[0] != "#"]
    head = [name.strip() for name in next(csv.reader([told[0][1]]))] if told else []
    for name in names:
        if name not in head:
            right = f"the header must name {', '.join(names)}"
            raise InputError(phrase(str(path), f"there is no column {name}", right))
    table = np.array([_numbers(path, k, line, len(head)) for k, line in told[1:]])
    if not len(table):
        raise InputError(phrase(str(path), "it has a header and no rows", "give rows of numbers"))
    return {name: table[:, head.index(name)].copy() for name in names}


def _numbers(path: Path, number: int, line: str, count: int) -> list[float]:
    """Return the numbers of one line. Raises InputError."""
    where = f"{path}, line {number}"
    cells = next(csv.reader([line]))
    if len(cells) != count:
        raise InputError(phrase(where, f"{len(cells)} values", f"the header names {count}"))
    try:
        values = [float(cell) for cell in cells]
    except ValueError as error:
        raise InputError(phrase(where, str(error), "give a number")) from None
    if not np.isfinite(values).all():
        raise InputError(phrase(where, "a value that is not finite", "give finite numbers"))
    return values
