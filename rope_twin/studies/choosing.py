"""Cases that are asked for by name, of all that a study has."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

from rope_twin.errors import InputError, did_you_mean, phrase

T = TypeVar("T")


def choose(
    command: str, cases: Sequence[T], names: Sequence[str], name_of: Callable[[T], str]
) -> tuple[T, ...]:
    """The cases of these names in their own order; all of them if no name is given.

    Raises:
        InputError: a name that no case has, told as of the command.
    """
    known = list(dict.fromkeys(name_of(case) for case in cases))
    for name in names:
        if name not in known:
            what = f"there is no case '{name}'"
            raise InputError(phrase(command, what, did_you_mean(name, known)))
    return tuple(case for case in cases if not names or name_of(case) in names)
