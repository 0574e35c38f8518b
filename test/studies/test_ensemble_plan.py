"""Draws of members: ranges, grids, seeds, and plans that are refused."""

from __future__ import annotations

import numpy as np
import pytest

from rope_twin.errors import InputError
from rope_twin.studies.ensemble import make_plan, read_axis, read_range
from rope_twin.studies.study_design import Variable

MASS = read_axis("--vary", "payloads[0].mass_kg=18e3..22e3")


def test_axes_are_read() -> None:
    assert Variable(path="payloads[0].mass_kg", from_=18e3, to=22e3) == MASS
    assert read_axis("--vary", "a.b*=0.5..2:4").values == (0.5, 1.0, 1.5, 2.0)
    assert read_axis("--vary", "a.b*=0.5..2:4").multiply
    assert read_axis("--vary", "a=3,1,2").values == (3.0, 1.0, 2.0)
    assert read_range("--sea-offset", "sea", "-5..5") == Variable(path="sea", from_=-5.0, to=5.0)
    assert [str(read_axis("--vary", text)) for text in ("a=1..2", "a*=1,2")] == ["a=1..2", "a*=1,2"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("mass", "--vary 'mass': it names no path or no numbers; write PATH=LOW..HIGH"),
        ("=1..2", "it names no path"),
        ("a=", "no numbers"),
        ("a=2..1", "2 is not below 1; give the lesser first"),
        ("a=1..2:1", "'1' is no number of values; give 2 to 10000 after the colon"),
        ("a=1..2:x", "'x' is no number of values"),
        ("a=1..", "'' is no finite number"),
        ("a=1,two", "'two' is no finite number"),
        ("a=1,nan", "'nan' is no finite number"),
    ],
)
def test_what_is_no_axis(words: str, said: str) -> None:
    with pytest.raises(InputError) as refused:
        read_axis("--vary", words)
    assert said in str(refused.value)


def test_draws_fill_their_range_and_repeat_by_seed() -> None:
    """Uniform: mean and spread of 2,000 draws within four standard errors."""
    drawn = np.array(make_plan([MASS], 2000, seed=7).rows)[:, 0]
    assert drawn.min() >= 18e3
    assert drawn.max() <= 22e3
    assert drawn.mean() == pytest.approx(20e3, abs=4 * 4e3 / np.sqrt(12 * 2000))
    assert drawn.std() == pytest.approx(4e3 / np.sqrt(12), rel=0.05)
    assert make_plan([MASS], 2000, seed=7) == make_plan([MASS], 2000, seed=7)
    assert make_plan([MASS], 50, seed=7).rows == make_plan([MASS], 2000, seed=7).rows[:50]
    assert make_plan([MASS], 50, seed=8).rows != make_plan([MASS], 50, seed=7).rows


def test_grids_are_crossed_and_draws_repeated_at_each_point() -> None:
    first, second = read_axis("--vary", "a=1,2"), read_axis("--vary", "b=10..30:3")
    crossed = [(1, 10), (1, 20), (1, 30), (2, 10), (2, 20), (2, 30)]
    assert list(make_plan([first, second], None, 1).rows) == crossed
    mixed = make_plan([first, MASS, second], 4, 1)
    assert [(row[0], row[2]) for row in mixed.rows] == [pair for pair in crossed for _ in range(4)]
    assert len({row[1] for row in mixed.rows}) == 24
    assert mixed.per_point == 4
    assert len(make_plan([MASS], None, 1).rows) == 100


@pytest.mark.parametrize(
    ("axes", "members", "said"),
    [
        ([], 5, "ensemble: nothing varies; say what does, with --vary or --sea-offset"),
        ([MASS], 0, "--members: 0 members at each of 1 points of the grid; give 1 to 10000"),
        ([MASS], 10_001, "give 1 to 10000 in all"),
        ([read_axis("--vary", "a=1..2:200"), MASS], 100, "100 members at each of 200 points"),
        ([read_axis("--vary", "a=1,2")], 2, "2 members at each point would all be equal"),
        ([MASS, MASS], 2, "--vary payloads[0].mass_kg: it is set twice; keep one of them"),
    ],
)
def test_what_is_no_plan(axes: list[Variable], members: int, said: str) -> None:
    with pytest.raises(InputError) as refused:
        make_plan(axes, members, 1)
    assert said in str(refused.value)
