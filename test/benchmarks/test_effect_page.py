"""`python -m benchmarks effects`: ratios of timed steps, rows on docs/effects.md."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks import effect_page
from benchmarks.effect_speed import (
    TOGETHER_NAME,
    EffectSpeed,
    all_names,
    choose_names,
)
from benchmarks.paired import Plan, Ratio, ratio_of, time_rounds
from rope_twin.errors import InputError
from validation.state_bench import Bench

DOCS = Path(__file__).resolve().parents[2] / "docs"


def test_every_effect_has_a_row_and_none_is_in_the_code_without() -> None:
    """docs/effects.md has what the file beside it holds."""
    rows = effect_page.read_rows(DOCS)
    assert [row.effect for row in rows] == [*all_names(), TOGETHER_NAME]
    assert [row.symbols_off for row in rows] == [0] * len(all_names()) + [None]
    page = (DOCS / effect_page.PAGE).read_text(encoding="utf-8")
    for line in effect_page.effect_table(rows)[1:]:
        assert f"| {' | '.join(line)} |" in page


def test_a_ratio_is_of_pieces_of_one_round() -> None:
    """A slow round changes no interval; of 48 the interval is the 16th to the 33rd."""
    random = np.random.default_rng(1)
    slowed = random.uniform(1.0, 5.0, 48)
    exact = np.linspace(1.1, 1.2, 48)
    ratio = ratio_of(list(random.permutation(exact) * slowed), list(slowed))
    assert ratio.median == pytest.approx(1.15, abs=5e-3)
    found = ratio_of(list(exact), [1.0] * 48)
    assert (found.low, found.high) == (exact[15], exact[32])
    assert not found.holds_one
    assert ratio_of([0.9, 1.1], [1.0, 1.0]) == Ratio(1.0, 0.9, 1.1)


def test_the_interval_holds_the_median_as_often_as_it_says() -> None:
    """In 2,000 samples of 48 numbers about 1 at least 98.5 % hold; 99.2 % are expected."""
    samples = np.random.default_rng(2).lognormal(0.0, 0.05, (2000, 48))
    held = sum(ratio_of(list(one), [1.0] * 48).holds_one for one in samples)
    assert 0.985 < held / 2000 < 0.999


def test_rounds_go_forward_and_back_and_sets_take_new_ropes() -> None:
    said: list[tuple[int, int]] = []
    made = 0

    class Walker:
        """Only follows."""

        def __init__(self, number: int) -> None:
            self.number = number

        def follow(self, steps: int) -> None:
            said.append((self.number, steps))

    def make() -> list[Walker]:
        nonlocal made
        made += 2
        return [Walker(made - 2), Walker(made - 1)]

    def motion(bench: Bench, steps: int) -> int:
        return steps

    took = time_rounds(make, motion, Plan(sets=2, rounds=2, settle=7, steps=3))  # type: ignore[arg-type]
    assert said[:6] == [(0, 7), (1, 7), (0, 3), (1, 3), (1, 3), (0, 3)]
    assert [number for number, _ in said[6:]] == [2, 3, 2, 3, 3, 2]
    assert [len(own) for own in took] == [4, 4]
    assert min(min(own) for own in took) >= 0.0


def row_of(effect: str, off: float = 1.0, on: float = 100.0) -> EffectSpeed:
    near = Ratio(off, off - 0.01, off + 0.01)
    return EffectSpeed(effect, 1000, 60.0, 60.1, on, near, Ratio(1.6, 1.5, 1.7), 0, 1e4 / on)


def test_rows_are_kept_on_the_page_in_the_order_of_the_effects(tmp_path: Path) -> None:
    page = tmp_path / effect_page.PAGE
    with pytest.raises(InputError, match=r"it has no lines .*; give a folder with"):
        effect_page.keep_rows([row_of("drag")], tmp_path)
    assert not (tmp_path / effect_page.STORED).exists()
    page.write_text(f"before\n{effect_page.MARKED.begin}\nold\n{effect_page.MARKED.end}\nafter\n")
    effect_page.keep_rows([row_of("drag"), row_of("seabed", off=1.02)], tmp_path)
    effect_page.keep_rows([row_of("waves", on=140.0)], tmp_path)
    text = page.read_text()
    assert text.startswith("before\n")
    assert text.endswith("\nafter\n")
    assert "In 2 of 3 rows 1 lies in the interval" in text
    assert (
        "| waves | 60.0 | 60.1 | 140.0 | 1.000 (0.990 to 1.010) | 1.600 (1.500 to 1.700) | no |"
        " 71 |" in text
    )
    assert text.index("| waves |") < text.index("| drag |") < text.index("| seabed |")
    (tmp_path / effect_page.STORED).write_text(json.dumps({"rows": [{"effect": "drag"}]}))
    with pytest.raises(InputError, match=r"it holds no rows .*; delete it and run"):
        effect_page.read_rows(tmp_path)


def test_effects_are_chosen_by_name_in_their_own_order() -> None:
    assert choose_names(["drag", "waves"]) == ("waves", "drag")
    assert choose_names([]) == all_names()
    with pytest.raises(InputError, match="there is no effect `wave`; did you mean 'waves'"):
        choose_names(["wave"])
