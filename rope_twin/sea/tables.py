"""Tables of numbers in CSV files: columns by name, and functions on a grid of two columns.

Empty lines and lines that begin with # are comments. Every error names the file, and the line where
it concerns one.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from math import isfinite, nan
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import InputError, did_you_mean, unreadable
from rope_twin.files import share_dir

Vector = NDArray[np.float64]


def find_table(name_or_path: str, folder: str) -> Path:
    """Return the file of a name in config/FOLDER (without its suffix), or of a path.

    Raises:
        InputError: there is no such file.
    """
    known = {path.stem: path for path in (share_dir() / "config" / folder).glob("*.csv")}
    path = known.get(name_or_path, Path(name_or_path))
    if path.is_file():
        return path
    if is_path(name_or_path):
        raise InputError(str(path), "there is no such file", "give the path of a table")
    remedy = did_you_mean(name_or_path, known)
    raise InputError(f"'{name_or_path}'", f"no table of config/{folder}/", remedy)


def is_path(name_or_path: str) -> bool:
    """Return whether a table is given by a path instead of a name."""
    endings = (".csv", ".4", ".yml", ".yaml", ".nc")
    return "/" in name_or_path or name_or_path.startswith(".") or name_or_path.endswith(endings)


class Table(NamedTuple):
    """Numbers of a file, with the line of each row."""

    columns: dict[str, Vector]  # (rows,) each, in the order of the file
    lines: tuple[int, ...]


def read_table(path: Path) -> Table:
    """Return all columns of a file by the names in its header.

    Raises:
        InputError: it cannot be read, has no rows, or a value is not a finite number.
    """
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise unreadable(path, error) from None
    filled = [
        (k, line) for k, line in enumerate(lines, 1) if line.strip() and line.strip()[0] != "#"
    ]
    head = [name.strip() for name in next(csv.reader([filled[0][1]]))] if filled else []
    rows = [_numbers(f"{path}, line {k}", line, len(head)) for k, line in filled[1:]]
    if not rows:
        problem = "it has a header and no rows" if head else "it is empty"
        raise InputError(str(path), problem, "give a header and rows of numbers")
    columns = dict(zip(head, np.array(rows).T.copy(), strict=True))
    return Table(columns, tuple(k for k, _ in filled[1:]))


def read_columns(path: Path, names: Sequence[str]) -> dict[str, Vector]:
    """Return the columns of these names, (rows,) each, in any order of the file.

    Raises:
        InputError: a column is missing, or the file is not a table of numbers.
    """
    columns = read_table(path).columns
    for name in names:
        if name not in columns:
            remedy = f"the header must name {', '.join(names)}"
            raise InputError(str(path), f"there is no column {name}", remedy)
    return {name: columns[name] for name in names}


def read_grid(
    path: Path, axes: tuple[str, str], names: Sequence[str]
) -> tuple[Vector, Vector, dict[str, Vector]]:
    """Return functions of two columns: both axes, ascending, (n,) and (m,), and values, (n, m).

    Rows may have any order; each pair of values of the axes occurs once.

    Raises:
        InputError: rows are missing or double, or the file is not a table of numbers.
    """
    columns = read_columns(path, (*axes, *names))
    first, second = (np.unique(columns[name]) for name in axes)
    for name, axis in zip(axes, (first, second), strict=True):
        if len(axis) < 2:
            raise InputError(str(path), f"one value of {name}", "give two or more")
    order = np.lexsort((columns[axes[1]], columns[axes[0]]))
    pairs = np.stack([columns[name][order] for name in axes])
    grid = np.stack([np.repeat(first, len(second)), np.tile(second, len(first))])
    if pairs.shape != grid.shape or (pairs != grid).any():
        problem = f"{len(order)} rows of {len(first)} {axes[0]} and {len(second)} {axes[1]}"
        remedy = f"each once for each: {grid.shape[1]} rows, {_uneven(pairs, grid, axes)}"
        raise InputError(str(path), problem, remedy)
    shape = len(first), len(second)
    return first, second, {name: columns[name][order].reshape(shape) for name in names}


def _uneven(pairs: Vector, grid: Vector, axes: tuple[str, str]) -> str:
    """Return in words which pair of a full grid is double or missing; both (2, rows)."""
    rows = [tuple(pair) for pair in pairs.T]
    pair = next((row for k, row in enumerate(rows[1:]) if row == rows[k]), None)
    fault = "is double" if pair else "is missing"
    if pair is None:
        present = set(rows)
        pair = next(candidate for candidate in map(tuple, grid.T) if candidate not in present)
    return f"{axes[0]} {pair[0]:g} with {axes[1]} {pair[1]:g} {fault}"


def _numbers(where: str, line: str, count: int) -> list[float]:
    """Return the numbers of one line. Raises InputError."""
    cells = next(csv.reader([line]))
    if len(cells) != count:
        raise InputError(where, f"{len(cells)} values", f"the header names {count}")
    values = []
    for cell in cells:
        try:
            values.append(float(cell))
        except ValueError:
            values.append(nan)
        if not isfinite(values[-1]):
            raise InputError(where, f"'{cell.strip()}'", "give a finite number")
    return values
