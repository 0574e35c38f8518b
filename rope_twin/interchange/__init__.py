"""Exchange of models with other programs: MoorDyn decks, OrcaFlex text files.

A model that is read becomes a scene's YAML, with a list of what has no equal in it.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from rope_twin.errors import InputError, SceneError, did_you_mean
from rope_twin.scene.load import load_scene
from rope_twin.scene.reader import plain
from rope_twin.scene.schema import Scene

Keys = dict[str, Any]
STEP_S = 0.01  # of imported scenes: an implicit step, unlike those of the other programs


class BreakingLoads:
    """MBL of the line types of a model, which it does not state [N]."""

    def __init__(self, loads_n: float | Mapping[str, float]) -> None:
        """Take one for all lines, or one by line type; "" is that of all others."""
        self._given = dict(loads_n) if isinstance(loads_n, Mapping) else {"": loads_n}
        self._alike: dict[str, float] = {}  # axial stiffness of types that share that of all others

    def check(self, kinds: Iterable[str]) -> None:
        """Check the names that were given. Raises InputError for one that the model lacks."""
        known = set(kinds)
        for name in self._given.keys() - {"", *known}:
            raise InputError("--breaking-load", f"no line type '{name}'", did_you_mean(name, known))

    def of(self, kind: str, stiffness_n: float, stated_n: float | None = None) -> float:
        """Return the MBL of a line type: given for it, stated by the model, or of all others.

        Raises InputError if there is none.
        """
        if kind in self._given:
            return self._given[kind]
        if stated_n is not None:
            return stated_n
        if "" not in self._given:
            remedy = f"give it by --breaking-load {kind}=FORCE"
            raise InputError(f"line type '{kind}'", "its breaking load is not known", remedy)
        self._alike[kind] = stiffness_n
        return self._given[""]

    def remarks(self) -> list[str]:
        """Return a remark if types of several stiffnesses share one MBL."""
        if len(set(self._alike.values())) < 2:
            return []
        named = ", ".join(self._alike)
        remedy = "give each its own by --breaking-load TYPE=FORCE"
        return [f"breaking load by line type: {named} all have {self._given['']:g} N; {remedy}"]


@dataclass(frozen=True)
class Imported:
    """A scene and the parts of the model that it does not have."""

    scene: Keys
    left_out: tuple[str, ...]  # a sentence each, without full stop

    def text(self) -> str:
        """Return the scene's file; what was left out is a comment at its top."""
        head = [f"# not imported: {remark}" for remark in self.left_out]
        body = yaml.dump(
            self.scene, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=100,
            default_flow_style=None,
        )  # fmt: skip
        return "\n".join([*head, body])


class _Dumper(yaml.SafeDumper):
    """Writes floats so that every YAML reader agrees on them."""


_Dumper.add_representer(
    float, lambda dumper, value: dumper.represent_scalar("tag:yaml.org,2002:float", plain(value))
)


def write_scene(imported: Imported, path: Path) -> Scene:
    """Write a scene's file, check it, and return the scene.

    The file is there only if the scene is valid.

    Raises:
        InputError: the model gives no valid scene, or the file cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(suffix=".yaml", dir=path.parent)
    except OSError as error:
        remedy = "give a place that can be written"
        raise InputError(str(path), f"it cannot be written ({error})", remedy) from None
    draft = Path(name)
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as stream:
            stream.write(imported.text())
        load_scene(draft)
        draft.replace(path)
    except SceneError as error:
        message = str(error).replace(str(draft), "the scene").removesuffix(".")
        problem, _, remedy = message.rpartition("; ")
        raise InputError(str(path), f"the model gives no valid scene ({problem})", remedy) from None
    finally:
        draft.unlink(missing_ok=True)
    return load_scene(path)
