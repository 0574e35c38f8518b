"""Errors that end an operation: one sentence with place, problem and remedy."""

from __future__ import annotations

import difflib
import importlib.util
import operator
from collections.abc import Iterable
from pathlib import Path


class RopeTwinError(Exception):
    """Base of every error that a user can mend; its text is one sentence."""

    def __init__(self, *parts: str) -> None:
        """Take the sentence, or place, problem and remedy."""
        super().__init__(phrase(*parts) if len(parts) > 1 else "".join(parts))


class SceneError(RopeTwinError):
    """A scene (or a file that a scene names) is wrong.

    Its text is the first error that was found; `others` are further ones of the same file, which
    were found independently of it. `line`: of the file; 0 if there is none.
    """

    def __init__(self, *parts: str, line: int = 0, others: tuple[SceneError, ...] = ()) -> None:
        super().__init__(*parts)
        self.line, self.others = line, others

    @property
    def every(self) -> list[str]:
        """Return the sentences of all errors, sorted by line, each once."""
        errors = sorted((self, *self.others), key=lambda error: error.line)
        return list(dict.fromkeys(str(error) for error in errors))


class SceneErrors:
    """Collects errors of a scene's file, so that what is independent of them is checked too.

    As a context manager it takes a SceneError that ends the block.
    """

    def __init__(self) -> None:
        self._found: list[SceneError] = []

    def add(self, error: SceneError) -> None:
        """Collect an error and those that it carries."""
        self._found += [error, *error.others]

    def raise_any(self) -> None:
        """Raise the first error with the others, if there is one."""
        if self._found:
            first, *others = self._found
            first.others = tuple(others)
            raise first

    def __bool__(self) -> bool:
        return bool(self._found)

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> bool:
        if not isinstance(error, SceneError):
            return False
        self.add(error)
        return True


class BagError(RopeTwinError):
    """A bag cannot be read or written."""


class InputError(RopeTwinError):
    """A command-line option, parameter or topic value is wrong."""


class StateError(RopeTwinError):
    """A saved state cannot be written, read or taken up."""


class SolverError(RopeTwinError):
    """The rope cannot be stepped on; the last good state is kept."""


def phrase(where: str, problem: str, remedy: str) -> str:
    """Return one sentence: `where: what; right.`"""
    end = "" if remedy.endswith("?") else "."
    return f"{where}: {problem}; {remedy}{end}"


def unreadable(path: Path, error: OSError | UnicodeDecodeError) -> InputError:
    """Return the error to raise where a file cannot be read as text."""
    if isinstance(error, UnicodeDecodeError):
        problem = f"it is not UTF-8 text (byte {error.object[error.start]:#04x} at {error.start})"
        return InputError(str(path), problem, "save it as UTF-8, or give the path of a text file")
    problem = f"it cannot be read ({error.strerror or error})"
    return InputError(str(path), problem, "give the path of a text file")


def require(module: str, why: str, extra: str, name: str = "") -> None:
    """Check that an optional package is there; `extra` of rope_twin brings it.

    Raises:
        InputError: it is not installed; `why` says what needs it.
    """
    if importlib.util.find_spec(module) is None:
        remedy = f"install it with `pip install 'rope_twin[{extra}]'`"
        raise InputError(name or module, why, remedy)


def whole_number(where: str, noun: str, value: int, low: int = 1, high: int | None = None) -> int:
    """Return a whole number of things from low to high; None: without an upper end.

    Raises:
        InputError: it is another number, or none.
    """
    try:
        number = operator.index(value)
    except TypeError:
        number = low - 1
    if number < low or (high is not None and number > high):
        end = "or more" if high is None else f"to {high}"
        raise InputError(where, f"{value!r} {noun}", f"give a whole number, {low} {end}")
    return number


def counted(number: int, noun: str) -> str:
    """Return a number with its noun, such as `1 step` or `2 steps`."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def did_you_mean(word: object, known: Iterable[str]) -> str:
    """Return the nearest known word as a question, or the list of known words."""
    options = sorted(known)
    for option in options:
        if option.casefold() == str(word).casefold():
            return f"did you mean '{option}'?"
    near = difflib.get_close_matches(str(word), options, n=1, cutoff=0.5)
    return f"did you mean '{near[0]}'?" if near else f"known: {', '.join(options)}"
