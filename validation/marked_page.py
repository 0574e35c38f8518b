"""Page with a generated part between two marks, and the stored rows of that part."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from rope_twin.errors import InputError

Row = TypeVar("Row")


class MarkedPage(NamedTuple):
    """Page and the two marks in it."""

    name: str  # of the file
    begin: str
    end: str

    def around(self, folder: Path) -> tuple[str, str]:
        """Return the text before and after the marks on a folder's page.

        Raises:
            InputError: there is no such page, or it has no marks.
        """
        path = folder / self.name
        text = path.read_text("utf-8") if path.exists() else ""
        if self.begin not in text or self.end not in text:
            problem = f"it has no lines '{self.begin}' and '{self.end}'"
            raise InputError(str(path), problem, f"give a folder with docs/{self.name}")
        before, remainder = text.split(self.begin, 1)
        return before, remainder.split(self.end, 1)[1]

    def write(self, folder: Path, section: str) -> Path:
        """Put a text between the marks; the page.

        Raises:
            InputError: there is no such page, or it has no marks.
        """
        before, after = self.around(folder)
        path = folder / self.name
        path.write_text(f"{before}{self.begin}\n{section}\n{self.end}{after}", encoding="utf-8")
        return path


def read_json(path: Path) -> Any:
    """Return the data in a file of results; None if there is no file.

    Raises:
        InputError: the file cannot be read.
    """
    try:
        return json.loads(path.read_text("utf-8")) if path.exists() else None
    except ValueError as error:
        problem = f"it is no result ({error})"
        raise InputError(str(path), problem, "delete it and run it again") from error


def write_json(path: Path, data: Any) -> None:
    """Write a file of results; its folder is created."""
    path.parent.mkdir(exist_ok=True)
    text = json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False)
    path.write_text(text + "\n", encoding="utf-8")


def read_stored(path: Path, as_row: Callable[[dict[str, Any]], Row], command: str) -> list[Row]:
    """Return the `rows` in a file; none if there is no file.

    Raises:
        InputError: the file cannot be read; `command` creates a new one.
    """
    if not path.exists():
        return []
    try:
        return [as_row(dict(row)) for row in json.loads(path.read_text("utf-8"))["rows"]]
    except (ValueError, KeyError, TypeError) as error:
        right = f"delete it and run `{command}` again"
        raise InputError(str(path), f"it holds no rows ({error})", right) from error
