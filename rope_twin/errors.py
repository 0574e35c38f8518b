"""What the twin says when it cannot go on: one sentence with what, where, what would be right."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class RopeTwinError(Exception):
    """Base of every error that a user can mend; its text is one sentence."""


class SceneError(RopeTwinError):
    """A scene (or a file that a scene names) is wrong."""


class BagError(RopeTwinError):
    """A bag cannot be read or written."""


class InputError(RopeTwinError):
    """A command-line option, parameter or topic value is wrong."""


class StateError(RopeTwinError):
    """A saved state cannot be written, read or taken up."""


class SolverError(RopeTwinError):
    """The rope cannot be stepped on; the last good state is kept."""


def phrase(where: str, what: str, right: str) -> str:
    """One sentence: `where: what; right.`"""
    end = "" if right.endswith("?") else "."
    return f"{where}: {what}; {right}{end}"


def did_you_mean(word: object, known: Iterable[str]) -> str:
    """The nearest known word as a question, or the list of known words."""
    options = sorted(known)
    for one in options:
        if one.casefold() == str(word).casefold():
            return f"did you mean '{one}'?"
    near = difflib.get_close_matches(str(word), options, n=1, cutoff=0.5)
    return f"did you mean '{near[0]}'?" if near else f"known: {', '.join(options)}"
