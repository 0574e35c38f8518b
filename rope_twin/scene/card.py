"""The accuracy card of a scene: how far its tension can be trusted, by elements and step.

`rope_twin accuracy SCENE` writes it to the folder `cards` beside the scene's file; here it is read.
A card knows the digest of the scene's figures and the version of the solver that it was made
with. When either changed it is old, and no error is known until it is made again.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from rope_twin.errors import SceneError, phrase
from rope_twin.scene.arrays.grid import elements_with
from rope_twin.scene.digest import scene_digest, solver_version
from rope_twin.scene.schema import Scene

FORMAT = 2
FOLDER = "cards"
RMS, PEAK = "tension_rms", "tension_peak"  # quantities that every card has
OTHER_SEA = "the card's run has another sea"


class Setting(NamedTuple):
    """What a run is made with; of ropes that meet the elements of the first."""

    elements: int
    step_s: float

    def __str__(self) -> str:
        return f"{self.elements} elements at {1e3 * self.step_s:g} ms"


@dataclass(frozen=True)
class Figure:
    """One quantity at one setting, in the quantity's unit."""

    error: float | None  # against the reference, with its sign; None: nothing to compare
    at_most: float | None  # its magnitude and the reference's uncertainty; None: not converged

    @property
    def known(self) -> float:
        """The bound; NaN where there is none."""
        return math.nan if self.at_most is None else self.at_most


@dataclass(frozen=True)
class Rung:
    """One setting of the ladder; errors are of the card's run."""

    elements: int
    step_s: float
    newton_tolerance_n: float | None  # None: the scene's own
    real_time_factor: float  # of the step alone, on the card's machine
    solves_per_step: float
    memory_mb: float  # of the rope's arrays
    figures: dict[str, Figure]  # by quantity

    def place(self) -> tuple[int, float, float | None]:
        """Elements, step [s] and tolerance [N] (None: the scene's own)."""
        return self.elements, self.step_s, self.newton_tolerance_n

    def bound(self, name: str) -> float:
        """What a quantity's error is at most, in its unit; NaN where it is unknown."""
        return self.figures[name].known if name in self.figures else math.nan

    @property
    def error_rms_pct(self) -> float:
        """Bound on the rms error of the top tension [% of its standard deviation]; NaN: unknown."""
        return self.figures[RMS].known

    @property
    def error_peak_pct(self) -> float:
        """Bound on the error of its highest value [%]; NaN: unknown."""
        return self.figures[PEAK].known


@dataclass(frozen=True)
class Card:
    """A card as it was written."""

    scene: str
    seconds: float  # twin time of the run that was studied
    scene_digest: str
    solver: str  # its version, and of the effects
    machine: str
    rungs: tuple[Rung, ...]
    rope_elements: tuple[int, ...] = ()  # of every rope where ropes meet, as the scene had them

    @property
    def ladder(self) -> tuple[Rung, ...]:
        """The rungs with the scene's own tolerance, by elements and then by step."""
        own = (rung for rung in self.rungs if rung.newton_tolerance_n is None)
        return tuple(sorted(own, key=lambda rung: (rung.elements, rung.step_s)))

    @property
    def finest(self) -> Setting:
        """The most elements and the shortest step of the ladder."""
        rungs = self.ladder
        return Setting(max(one.elements for one in rungs), min(one.step_s for one in rungs))

    def age(self, scene: Scene) -> str:
        """Why it says nothing about the scene any more; "" if it does."""
        now = [line.elements for line in scene.ropes]
        if self.rope_elements and elements_with(self.rope_elements, now[0]) != now:
            return "the scene's elements were changed since its card was made"
        if self.scene_digest != scene_digest(scene):
            return "the scene was changed since its card was made"
        if self.solver != solver_version(scene):
            return "the card is old: the solver was changed since it was made"
        return ""

    def at(self, elements: int, step_s: float) -> tuple[Rung, ...]:
        """The rung of a setting, or those around it if it lies between rungs.

        One that is finer counts as the finest; none: coarser than the ladder.
        """
        rungs, finest = self.ladder, self.finest
        counts = _around(min(elements, finest.elements), sorted({one.elements for one in rungs}))
        steps = _around(max(step_s, finest.step_s), sorted({one.step_s for one in rungs}))
        return tuple(one for one in rungs if one.elements in counts and one.step_s in steps)


@dataclass(frozen=True)
class KnownError:
    """What is known of the error of a scene's top tension at its own setting."""

    rms_pct: float = math.nan  # at most so much of the standard deviation; NaN: unknown
    peak_pct: float = math.nan  # the same for the highest value
    words: str = "unknown"  # what it is, or why it is unknown
    seconds: float = math.inf  # twin time that the card's run covers; nothing is known beyond it


def told_bound(bound: float) -> str:
    """A bound for people: two digits, rounded up."""
    if not 0.0 < bound < math.inf:
        return "0" if bound == 0.0 else "unknown"
    place = 10.0 ** (math.floor(math.log10(bound)) - 1)
    told = math.ceil(bound / place - 1e-9) * place
    return f"{told:.0f}" if 100.0 <= told < 1e6 else f"{told:.2g}"


def card_path(scene: Scene) -> Path:
    """Where the scene's card is, if it has one."""
    return scene.path.parent / FOLDER / f"{scene.path.stem}.json"


def read_card(scene: Scene) -> Card | None:
    """The scene's card, which may be old; None if there is none.

    Raises:
        SceneError: the file is no card; one sentence.
    """
    path = card_path(scene)
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        return None
    except (OSError, UnicodeDecodeError) as error:
        raise SceneError(phrase(str(path), f"it cannot be read ({error})", _REMAKE)) from error
    try:
        found = json.loads(text)
        if found["format"] != FORMAT:
            what = f"a card of format {found['format']}, this version reads {FORMAT}"
            raise SceneError(phrase(str(path), what, _REMAKE))
        return _card(found)
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise SceneError(
            phrase(str(path), f"it is no accuracy card ({error!r})", _REMAKE)
        ) from error


def known_error(scene: Scene) -> KnownError:
    """The error of the scene at its own elements and step, from its card.

    Between rungs the largest error of the rungs around holds, of what is finer that of the finest:
    no better one is claimed than was measured. Of what is coarser than the ladder it is unknown,
    and so it is with an old card.
    """
    try:
        card = read_card(scene)
    except SceneError as error:
        return KnownError(words=f"unknown: {error}")
    if card is None:
        return KnownError(words="unknown: no card")
    why = card.age(scene)
    around = () if why else card.at(scene.ropes[0].elements, scene.time.step_s)
    rms = max((rung.error_rms_pct for rung in around), default=math.nan)
    peak = max((rung.error_peak_pct for rung in around), default=math.nan)
    if why or not around:
        return KnownError(
            words=f"unknown: {why or 'this setting is not on the ladder of the card'}"
        )
    if any(math.isnan(rung.error_rms_pct) for rung in around):
        return KnownError(peak_pct=peak, words="unknown: the run does not converge (see its card)")
    words = f"at most, in the card's run of {card.seconds:g} s"
    finest = card.finest
    if scene.ropes[0].elements > finest.elements or scene.time.step_s < finest.step_s:
        words += ", which ends at a coarser setting"
    return KnownError(rms, peak, words, card.seconds)


_REMAKE = "make it again with `rope_twin accuracy SCENE`"


def _around(value: float, sizes: list[Any]) -> list[Any]:
    """The size that is the value, else the two on either side; none if it lies outside."""
    if value in sizes:
        return [value]
    below, above = (
        [size for size in sizes if size < value],
        [size for size in sizes if size > value],
    )
    return [below[-1], above[0]] if below and above else []


def _card(found: dict[str, Any]) -> Card:
    return Card(
        scene=str(found["scene"]),
        seconds=float(found["seconds"]),
        scene_digest=str(found["scene_digest"]),
        solver=str(found["solver"]),
        machine=str(found["machine"]),
        rungs=tuple(_rung(row) for row in found["rows"]),
        rope_elements=tuple(int(count) for count in found.get("rope_elements", ())),
    )


def _rung(row: dict[str, Any]) -> Rung:
    tolerance = row["newton_tolerance_n"]
    figures = {
        name: Figure(_number(figure["error"]), _number(figure["at_most"]))
        for name, figure in row["figures"].items()
    }
    if not {RMS, PEAK} <= set(figures):
        raise KeyError(RMS)
    return Rung(
        elements=int(row["elements"]),
        step_s=float(row["step_s"]),
        newton_tolerance_n=_number(tolerance),
        real_time_factor=float(row["real_time_factor"]),
        solves_per_step=float(row["solves_per_step"]),
        memory_mb=float(row["memory_mb"]),
        figures=figures,
    )


def _number(value: Any) -> float | None:
    return None if value is None else float(value)
