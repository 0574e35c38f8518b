"""Variables of the members of an ensemble: random or on a grid.

An axis is written `PATH=LOW..HIGH` (each member draws a value), `PATH=LOW..HIGH:COUNT` (evenly
spaced) or `PATH=A,B,C`; with `*=` the value multiplies that of the scene. Axes with given values
are crossed; each point of that grid has the requested number of members.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rope_twin.errors import InputError, phrase
from rope_twin.scene.change import Change

MEMBERS_MOST = 10_000
MEMBERS_USUAL = 100
RIGHT = "write PATH=LOW..HIGH, PATH=LOW..HIGH:COUNT or PATH=A,B,C (*= to multiply)"


@dataclass(frozen=True)
class Axis:
    """One variable."""

    path: str
    low: float = 0.0
    high: float = 0.0
    values: tuple[float, ...] = ()  # of the grid; empty: drawn between low and high
    multiply: bool = False

    def __str__(self) -> str:
        """Return the axis as it would be written."""
        sign = "*=" if self.multiply else "="
        numbers = ",".join(f"{value:g}" for value in self.values)
        return f"{self.path}{sign}{numbers or f'{self.low:g}..{self.high:g}'}"

    def change(self, value: float) -> Change:
        """Return the change that gives a member its value."""
        return Change(self.path, value, self.multiply)


@dataclass(frozen=True)
class Plan:
    """Values of the axes for each member."""

    axes: tuple[Axis, ...]
    seed: int
    rows: tuple[tuple[float, ...], ...]  # a value of each axis; members of a grid point together
    per_point: int  # members at each point of the grid


def read_axis(option: str, words: str) -> Axis:
    """Return an axis as written on a command line.

    Raises:
        InputError: one sentence.
    """
    path, sign, numbers = words.partition("=")
    multiply = path.endswith("*")
    path = path.removesuffix("*")
    if not sign or not path or not numbers:
        raise InputError(phrase(f"{option} '{words}'", "it names no path or no numbers", RIGHT))
    return read_range(option, path, numbers, multiply)


def read_range(option: str, path: str, numbers: str, multiply: bool = False) -> Axis:
    """Return an axis from its path and `LOW..HIGH`, `LOW..HIGH:COUNT` or `A,B,C`.

    Raises:
        InputError: one sentence.
    """
    where = f"{option} '{numbers}'"
    if ".." not in numbers:
        values = tuple(_read_number(where, word) for word in numbers.split(","))
        return Axis(path, min(values), max(values), values, multiply)
    ends, colon, count = numbers.partition(":")
    low, high = (_read_number(where, word) for word in ends.split("..", 1))
    if low >= high:
        raise InputError(phrase(where, f"{low:g} is not below {high:g}", "give the lesser first"))
    if not colon:
        return Axis(path, low, high, (), multiply)
    if not count.isdecimal() or not 2 <= int(count) <= MEMBERS_MOST:
        what = f"'{count}' is no number of values"
        raise InputError(phrase(where, what, f"give 2 to {MEMBERS_MOST} after the colon"))
    values = tuple(np.linspace(low, high, int(count)).tolist())
    return Axis(path, low, high, values, multiply)


def make_plan(axes: Sequence[Axis], members: int | None, seed: int) -> Plan:
    """Return each member's values. More members of the same seed begin with the same ones.

    Args:
        axes: what varies.
        members: at each point of the grid; None: one, or 100 where anything is drawn at random.
        seed: of the random numbers.

    Raises:
        InputError: nothing varies, or there are too many members.
    """
    drawn = [axis for axis in axes if not axis.values]
    if not axes:
        right = "say what does, with --vary or --sea-offset"
        raise InputError(phrase("ensemble", "nothing varies", right))
    paths = [axis.path for axis in axes if not axis.multiply]
    twice = next((path for path in paths if paths.count(path) > 1), "")
    if twice:
        raise InputError(phrase(f"--vary {twice}", "it is set twice", "keep one of them"))
    each = members if members is not None else (MEMBERS_USUAL if drawn else 1)
    points = math.prod(len(axis.values) for axis in axes if axis.values)
    if not 1 <= each * points <= MEMBERS_MOST:
        what = f"{each} members at each of {points} points of the grid"
        raise InputError(phrase("--members", what, f"give 1 to {MEMBERS_MOST} in all"))
    if each > 1 and not drawn:
        what = f"{each} members at each point would all be equal"
        raise InputError(phrase("--members", what, "leave it out, or draw a number at random"))
    random = np.random.default_rng(seed).random((each * points, len(drawn)))
    rows = []
    grid = itertools.product(*(axis.values for axis in axes if axis.values))
    for number, point in enumerate(point for point in grid for _ in range(each)):
        given, shares = iter(point), iter(random[number].tolist())
        rows.append(
            tuple(
                next(given) if axis.values else axis.low + next(shares) * (axis.high - axis.low)
                for axis in axes
            )
        )
    return Plan(tuple(axes), seed, tuple(rows), each)


def _read_number(where: str, word: str) -> float:
    try:
        number = float(word)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise InputError(phrase(where, f"'{word.strip()}' is no finite number", RIGHT))
    return number
