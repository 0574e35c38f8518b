"""A state of a twin from which a run goes on to the bit: taken, judged, kept in a file.

It holds everything that changes while a twin runs, found by walking (`memory.py`): the rope, every
effect's arrays, the inputs with what they have in store and refused, the prescribed motion, clock
and counts. The solver's scratch is not: nothing in it outlives a step but the tensions, which are.
The scene is not in it either: it is given again, and what counts is compared.
"""

from __future__ import annotations

import dataclasses
import functools
import logging
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rope_twin import __version__
from rope_twin.errors import StateError, phrase
from rope_twin.scene.schema import Scene
from rope_twin.twin.accuracy.rung import Rung
from rope_twin.twin.saving.memory import Arrays, recall, remember
from rope_twin.twin.saving.state_file import decode, encode, read_state, write_state

# Fields of a scene that a state does not depend on: words, limits, and inputs from outside.
_NOT_COMPARED = {"name", "path", "digest", "about", "source", "look_at", "sea_state", "schedule",
                 "schedule_repeats_every_s", "max_heave_m", "max_hang_off_speed_m_per_s",
                 "max_hang_off_acceleration_m_per_s2", "when_commander_lost", "accept",
                 "limits"}  # fmt: skip

IF_ASKED = "watch/"  # before names of parts that a run may ask for or not (vibration/watched.py)

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class About:
    """What a saved state is of, for people; names are the keys in the file's header."""

    scene: str
    scene_path: str
    scene_digest: str  # SHA-256 of the scene's text
    program: str  # version of rope_twin
    solver: str  # digest of the solver's sources
    saved_at: str  # UTC
    time_s: float  # twin time
    step: int
    step_s: float
    elements: int
    line_out_m: float
    payout_speed_m_per_s: float
    tension_top_n: float
    payload_position_m: tuple[float, float, float]
    halvings: int = 0  # how often the scene's elements were halved
    cut_lost_m: float = 0.0  # unstretched rope that a cut took; 0: none
    cut_left_m: float = 0.0  # and what hung on then
    cut_rope: str = ""  # which one, where several meet
    failure: str = ""  # why the solver could not go on from here


@dataclass(frozen=True)
class SavedState:
    """A state in memory; it shares nothing with the twin."""

    about: About
    figures: Any  # what is compared of the scene
    memory: Any  # plain form of what the twin remembers
    arrays: Arrays
    source: str = "in memory"  # the file it was read from

    @property
    def time_ns(self) -> int:
        """Twin time [ns]."""
        return round(self.about.time_s * 1e9)

    @property
    def rung(self) -> Rung:
        """Elements and step that the twin went with."""
        return Rung(round(self.about.step_s * 1e9), self.about.halvings)

    def write(self, path: Path) -> None:
        """Write it to a file, whole or not at all.

        Raises:
            StateError: it holds a NaN, or the disk does not take it.
        """
        write_state(path, self._header(str(path)), self.arrays)

    def encode(self) -> bytes:
        """Return the bytes that `write` would write.

        Raises:
            StateError: it holds a NaN.
        """
        return encode(self._header(self.source), self.arrays)

    def _header(self, where: str) -> dict[str, Any]:
        if fault := self.fault():
            raise StateError(phrase(where, fault, "the state is not saved"))
        return {
            **dataclasses.asdict(self.about), "scene_figures": self.figures, "memory": self.memory,
        }  # fmt: skip

    def fault(self) -> str:
        """What no state may hold, or ""."""
        for name, array in self.arrays.items():
            if np.isnan(array).any():
                return f"{np.isnan(array).sum()} values of {name} are not numbers (NaN)"
        return ""

    def restore_into(self, target: dict[str, Any]) -> dict[str, Any]:
        """The values for the attributes `target` of a new twin.

        Raises:
            StateError: another version of the program wrote it and kept other things.
        """
        try:
            return {
                name: recall(self.memory[name], target[name], self.arrays, name.lstrip("_"))
                for name in self._names(target)
            }
        except (StateError, KeyError, ValueError, TypeError, AttributeError) as error:
            what = f"it does not fit this version of rope_twin: {error}"
            wrote = f"version {self.about.program}, solver {self.about.solver}"
            right = f"start anew, or go on with what wrote it ({wrote})"
            raise StateError(phrase(f"saved state {self.source}", what, right)) from error

    def _names(self, target: dict[str, Any]) -> list[str]:
        """All but what only a run that asks for it keeps, and takes back itself."""
        here, there = (
            {name for name in names if not name.startswith(IF_ASKED)}
            for names in (target, self.memory)
        )
        if odd := sorted(here ^ there):
            raise StateError(f"it does not hold the same parts ({', '.join(odd)})")
        return [name for name in target if name in here]


def changing_parts(rope: Any) -> list[str]:
    """The fields of a core's rope that a restart needs; of the scratch it is only the tensions."""
    return [name for name in rope._fields if name not in ("model", "work", "effects")]


def take(remembered: dict[str, Any], about: About, scene: Scene) -> SavedState:
    """A state of these attributes of a twin of the scene. Raises StateError for a NaN."""
    arrays: Arrays = {}
    memory = {name: remember(v, arrays, name.lstrip("_")) for name, v in remembered.items()}
    return SavedState(about, scene_figures(scene), memory, arrays)


def stamp(scene: Scene, failure: str = "") -> dict[str, Any]:
    """The part of About that does not depend on the rope."""
    return {
        "scene": scene.name,
        "scene_path": str(scene.path),
        "scene_digest": scene.digest,
        "program": __version__,
        "solver": _solver_digest(),
        "saved_at": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "failure": failure,
    }


@functools.cache
def _solver_digest() -> str:
    """Of the sources as they were when this process first asked."""
    from rope_twin.core.jit.decorators import source_digest  # here: to read needs no compiler

    return source_digest()


def load_state(path: str | Path) -> SavedState:
    """Read a saved state.

    Raises:
        StateError: one sentence on what is wrong with the file.
    """
    return _state_of(*read_state(Path(path)), path)


def decode_state(data: bytes, source: str) -> SavedState:
    """Read the bytes of a saved state; `source` says where they are from.

    Raises:
        StateError: one sentence on what is wrong with them.
    """
    return _state_of(*decode(data, Path(source)), source)


def _state_of(header: dict[str, Any], arrays: Arrays, path: str | Path) -> SavedState:
    try:
        values = {field.name: header[field.name] for field in dataclasses.fields(About)}
        values["payload_position_m"] = tuple(values["payload_position_m"])
        figures, memory = header["scene_figures"], header["memory"]
        state = SavedState(About(**values), figures, memory, arrays, str(path))
    except (KeyError, TypeError) as error:
        right = "take another saved state, or start without one"
        raise StateError(
            phrase(f"saved state {path}", f"its header lacks {error}", right)
        ) from error
    if fault := state.fault():
        right = "take a state that was saved before"
        raise StateError(phrase(f"saved state {path}", fault, right))
    return state


def judge_scene(state: SavedState, scene: Scene) -> None:
    """Refuse a state of another scene; log when another solver wrote it.

    Raises:
        StateError: the scene differs in something that the state depends on.
    """
    found = next(differences(state.figures, scene_figures(scene), ""), None)
    if found is not None:
        what = f"it is of another scene, {state.about.scene}: {found} in scene {scene.name}"
        right = f"give the scene that it was saved from ({state.about.scene_path})"
        raise StateError(phrase(f"saved state {state.source}", what, right))
    solver = _solver_digest()
    if state.about.solver != solver:
        _log.warning(
            "saved state %s: solver %s wrote it and %s goes on; the run is the same, but not to "
            "the bit", state.source, state.about.solver, solver,
        )  # fmt: skip


def scene_figures(value: Any) -> Any:
    """What a state depends on of a scene (or of a part of it), in plain form."""
    if dataclasses.is_dataclass(value):
        parts = {
            field.name: scene_figures(getattr(value, field.name))
            for field in dataclasses.fields(value)
            if field.name not in _NOT_COMPARED
        }
        return {"kind": type(value).__name__, **parts}
    if isinstance(value, list | tuple):
        return [scene_figures(part) for part in value]
    if isinstance(value, dict):
        return {str(key): scene_figures(part) for key, part in value.items()}
    if isinstance(value, float):
        return value if math.isfinite(value) else str(value)
    return value if value is None or isinstance(value, bool | int | str) else str(value)


def differences(there: Any, here: Any, at: str) -> Iterator[str]:
    """Where two plain forms differ, in words."""
    if isinstance(there, dict) and isinstance(here, dict):
        for key in [*there, *(key for key in here if key not in there)]:
            path = f"{at}.{key}" if at else key
            yield from differences(there.get(key), here.get(key), path)
    elif isinstance(there, list) and isinstance(here, list):
        if len(there) != len(here):
            yield f"{at} has {len(there)} entries there and {len(here)}"
        for number, (one, other) in enumerate(zip(there, here, strict=False)):
            yield from differences(one, other, f"{at}[{number}]")
    elif there != here:
        yield f"{at} is {_words(there)} there and {_words(here)}"


def _words(value: Any) -> str:
    """A figure, or what kind of part it is."""
    if isinstance(value, dict):
        return str(value.get("kind", "a mapping"))
    return "absent" if value is None else str(value)
