"""Reader of the YAML file of a parameter study, as strict as that of scenes."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

from rope_twin.quantity import quantity, text
from rope_twin.scene.document import Place, read_document
from rope_twin.scene.load import load_scene
from rope_twin.scene.reader import read_object
from rope_twin.scene.schema import Scene
from rope_twin.twin.fatigue.curves import CURVES

SEA_OFFSET_S = "sea_offset_s"  # the path of a variable that moves a run along the recorded sea
RUNS_MOST = 100_000


@dataclass(frozen=True, kw_only=True)
class Case:
    """Several numbers of the scene that belong together, such as a sea's height and period."""

    name: str = text("what it is called in the table")
    set_: dict[str, float] = text("number by path of the scene")


@dataclass(frozen=True, kw_only=True)
class Variable:
    """Something that differs from run to run: numbers, names or cases."""

    name: str = text("its column in the table; absent: the path", "")
    path: str = text("what of the scene it is, such as payloads[0].mass_kg", "")
    from_: float | None = quantity("lowest number", default=None)
    to: float | None = quantity("highest number", default=None)
    count: int | None = quantity("numbers from lowest to highest, on a grid", "", 2, 10_000,
                                 default=None)  # fmt: skip
    values: tuple[float, ...] = quantity("numbers", default=())
    names: tuple[str, ...] = text("presets of `ropes[N].rope`, or bags of `sea_state.bag`", ())
    cases: tuple[Case, ...] = text("numbers that belong together", ())
    multiply: bool = text("the numbers multiply what the scene says", False)

    @property
    def column(self) -> str:
        """Return the name of the variable in tables."""
        return self.name or self.path + ("*" if self.multiply else "")

    @property
    def ranges(self) -> bool:
        """Return whether any number from lowest to highest may be drawn."""
        return self.from_ is not None

    def check(self) -> str | None:
        """Check that exactly one kind of values is given."""
        ways = [self.from_ is not None or self.to is not None, bool(self.values), bool(self.names),
                bool(self.cases)]  # fmt: skip
        if sum(ways) != 1:
            right = "give one of from and to, values, names, cases"
            return f"{sum(ways)} ways of saying what it can be; {right}"
        if self.cases:
            if self.path or not self.name:
                return "cases have paths of their own; give `name` and leave `path` out"
            called = [case.name for case in self.cases]
            return (
                None if len(set(called)) == len(called) else "two cases have one name; rename one"
            )
        if not self.path:
            return "it is not said what of the scene it is; add `path`"
        if self.names and self.multiply:
            return "names cannot multiply; leave `multiply` out"
        if ways[0] and (self.from_ is None or self.to is None or self.from_ >= self.to):
            return "`from` and `to` are no range; give both, the lesser as `from`"
        if self.count is not None and not ways[0]:
            return "`count` goes with `from` and `to`; leave it out"
        return None


@dataclass(frozen=True, kw_only=True)
class LatinHypercube:
    """Runs drawn so that each variable meets each part of its range equally often."""

    runs: int = quantity("how many runs", "", 2, RUNS_MOST)
    seed: int = quantity("picks them", "", 0, 2**31, default=1)


@dataclass(frozen=True, kw_only=True)
class FatigueWish:
    """Damage along the rope, counted in every run."""

    curve: str = text("one of " + ", ".join(CURVES))
    piece_m: float = quantity("length of a piece of rope", "m", 0.5, 1e4, default=20.0)
    sample_s: float = quantity("how often its tension is looked at", "s", 1e-3, 10.0, default=0.1)

    def check(self) -> str | None:
        """Check that the S-N curve is known."""
        known = ", ".join(CURVES)
        return None if self.curve in CURVES else f"there is no curve '{self.curve}'; known: {known}"


@dataclass(frozen=True, kw_only=True)
class Study:
    """Parameter study."""

    name: str
    path: Path
    digest: str  # SHA-256 of the file's text
    about: str = text("one line: what is asked")
    scene: str = text("a scene's name, or its path from this file")
    seconds: float = quantity("twin time of each run", "s", 1e-2, 1e6)
    look_s: float = quantity("how often each rope is looked along for slack", "s", 1e-3, 100.0,
                             default=0.5)  # fmt: skip
    vary: tuple[Variable, ...] = text("what differs from run to run")
    latin_hypercube: LatinHypercube | None = text("drawn runs; absent: a grid of all values", None)
    fatigue: FatigueWish | None = text("count damage along the rope", None)

    def check(self) -> str | None:
        """Check that the variables are consistent."""
        columns = [one.column for one in self.vary]
        twice = next((name for name in columns if columns.count(name) > 1), "")
        if not self.vary:
            return "nothing varies; add variables to `vary`"
        if twice:
            return f"two variables are called '{twice}'; give one of them a `name`"
        bare = next((one for one in self.vary if one.ranges and one.count is None), None)
        if bare is not None and self.latin_hypercube is None:
            return f"on a grid '{bare.column}' needs its numbers; add `count`, or `latin_hypercube`"
        return None


def read_study(path: Path) -> tuple[Study, Scene]:
    """Return a study and its scene.

    Raises:
        SceneError: one sentence on what is wrong in the file or the scene.
    """
    tree, data = read_document(path)
    digest = hashlib.sha256(data).hexdigest()
    place = Place(path)
    study: Study = read_object(Study, tree, place, name=path.stem, path=path, digest=digest)
    beside = path.parent / study.scene
    return study, load_scene(beside if beside.suffix in (".yaml", ".yml") else study.scene)
