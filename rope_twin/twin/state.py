"""State of a twin: everything that changes while it runs, named part by part.

`Twin.save`, `Twin.restore` and checkpoints use it. Data of the scene or the caller (models, limits,
scratch arrays, locks) is not part of it.

A run resumes bit-identically from a saved state, which holds a `TwinState`: the ropes, every
effect's arrays, the inputs with their stored and rejected samples, the prescribed motion, clock and
counts. The solver's scratch array is left out except for the tensions, the only part that outlives
a step. The scene is not saved: it is given again on loading, and the properties that matter are
compared.
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
from typing import TYPE_CHECKING, Any

import numpy as np

from rope_twin import __version__
from rope_twin.errors import StateError
from rope_twin.scene.error_bound import AccuracyLevel
from rope_twin.scene.schema import Scene
from rope_twin.twin.state_file import (
    Arrays,
    decode,
    deserialise,
    encode,
    read_state,
    serialise,
    write_state,
)

if TYPE_CHECKING:
    from rope_twin.twin.inputs import InputState
    from rope_twin.twin.level import MeshState
    from rope_twin.twin.motion.boundary_conditions import MotionState
    from rope_twin.twin.run_record import RecordState

# Fields of a scene that a state does not depend on: texts, limits, and external inputs.
_NOT_COMPARED = {"name", "path", "digest", "about", "source", "look_at", "sea_state", "schedule",
                 "schedule_repeats_every_s", "max_heave_m", "max_hang_off_speed_m_per_s",
                 "max_hang_off_acceleration_m_per_s2", "when_commander_lost", "accept",
                 "limits", "learning"}  # fmt: skip
_log = logging.getLogger(__name__)


class Clock:
    """Twin time in whole nanoseconds, so that paced and unpaced runs see the same numbers."""

    def __init__(self) -> None:
        self.time_ns = 0  # since the start
        self.steps = 0  # completed
        self.computing_s = 0.0  # spent on them

    def advance(self, steps: int, step_ns: int) -> None:
        """Count completed steps of this length [ns]."""
        self.steps += steps
        self.time_ns += steps * step_ns


@dataclass(frozen=True)
class TwinState:
    """State of a twin between two steps.

    It shares arrays and inputs with the twin; `capture` copies it.
    """

    clock: Clock
    mesh: MeshState
    ropes: dict[str, Any]  # arrays of all ropes, connections and further winches by name
    motion: MotionState
    inputs: InputState
    record: RecordState
    monitors: dict[str, Any]  # states of the monitors by name; a run may lack some


@dataclass(frozen=True)
class StateDescription:
    """Description of a saved state for people; field names are the keys in the file's header."""

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
    halvings: int = 0  # number of times the scene's mesh was coarsened by half
    cut_lost_m: float = 0.0  # unstretched length cut off; 0: no cut
    cut_left_m: float = 0.0  # unstretched length left at the cut
    cut_rope: str = ""  # name of the cut rope in a multi-line scene
    failure: str = ""  # why the step from here failed


@dataclass(frozen=True)
class SavedState:
    """A state in memory that shares nothing with the twin."""

    about: StateDescription
    figures: Any  # properties of the scene that are compared on loading
    memory: dict[str, Any]  # plain form of the TwinState by part
    arrays: Arrays
    source: str = "in memory"  # the file it was read from
    beside: dict[str, Any] = dataclasses.field(
        default_factory=dict
    )  # of what runs beside the twin, as JSON

    @property
    def time_ns(self) -> int:
        """Twin time [ns]."""
        return round(self.about.time_s * 1e9)

    @property
    def level(self) -> AccuracyLevel:
        """Accuracy level of the twin."""
        return AccuracyLevel(round(self.about.step_s * 1e9), self.about.halvings)

    def write(self, path: Path) -> None:
        """Write the state to a file, whole or not at all.

        Raises:
            StateError: it holds a NaN, or the disk rejects it.
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
            raise StateError(where, fault, "the state is not saved")
        return {
            **dataclasses.asdict(self.about), "scene_figures": self.figures, "memory": self.memory,
            "beside": self.beside,
        }  # fmt: skip

    def fault(self) -> str:
        """Return the reason why the state is invalid (it holds a NaN), or ""."""
        for name, array in self.arrays.items():
            if np.isnan(array).any():
                return f"{np.isnan(array).sum()} values of {name} are not numbers (NaN)"
        return ""

    def restored(self, like: TwinState) -> TwinState:
        """Return the state for a new twin, whose own state `like` is changed.

        Monitors read their own parts, as a run may have others than the one that was saved.

        Raises:
            StateError: another version of the program wrote it with other parts.
        """
        try:
            parts = {
                field.name: self._part(field.name, getattr(like, field.name))
                for field in dataclasses.fields(like)
                if field.name != "monitors"
            }
        except (StateError, KeyError, ValueError, TypeError, AttributeError) as error:
            problem = f"it does not fit this version of rope_twin: {error}"
            wrote = f"version {self.about.program}, solver {self.about.solver}"
            remedy = f"start a new run, or go on with what wrote it ({wrote})"
            raise StateError(f"saved state {self.source}", problem, remedy) from error
        return TwinState(monitors={}, **parts)

    def _part(self, name: str, like: Any) -> Any:
        """Return one part of the state.

        Raises:
            StateError: it does not have the entries of `like`.
        """
        plain = self.memory[name]
        if not isinstance(like, dict):
            return deserialise(plain, like, self.arrays, name)
        if mismatched := sorted(like.keys() ^ plain.keys()):
            raise StateError(f"it does not hold the same parts ({', '.join(mismatched)})")
        return {
            key: deserialise(plain[key], template, self.arrays, key)
            for key, template in like.items()
        }

    def of_monitor(self, prefix: str) -> dict[str, Any]:
        """Return the plain values of a monitor, by their names without this prefix."""
        saved = self.memory["monitors"].items()
        return {
            name.removeprefix(prefix): value for name, value in saved if name.startswith(prefix)
        }

    def read_monitor(self, name: str, like: Any) -> Any:
        """Return a value of a monitor; `like`, of the same structure, may be changed."""
        return deserialise(self.memory["monitors"][name], like, self.arrays, name)


def changing_parts(rope: Any) -> list[str]:
    """Return the fields of a core's rope that a restart needs; of the scratch only the tensions."""
    return [name for name in rope._fields if name not in ("model", "work", "effects")]


def capture(state: TwinState, about: StateDescription, scene: Scene) -> SavedState:
    """Return a saved state of a twin of the scene.

    Arrays are named by their path in the state; entries of a dict by their own names.

    Raises:
        StateError: a value is NaN.
    """
    arrays: Arrays = {}
    memory: dict[str, Any] = {}
    for field in dataclasses.fields(state):
        part = getattr(state, field.name)
        memory[field.name] = (
            {key: serialise(value, arrays, key) for key, value in part.items()}
            if isinstance(part, dict)
            else serialise(part, arrays, field.name)
        )
    return SavedState(about, scene_properties(scene), memory, arrays)


def run_stamp(scene: Scene, failure: str = "") -> dict[str, Any]:
    """Return the fields of a StateDescription that do not depend on the rope."""
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
    """Return the digest of the solver's sources at this process's first call."""
    from rope_twin.core.jit.decorators import source_digest  # reading a state needs no compiler

    return source_digest()


def load_state(path: str | Path) -> SavedState:
    """Read a saved state from a file.

    Raises:
        StateError: the file is invalid; the message gives the reason.
    """
    return _state_of(*read_state(Path(path)), path)


def decode_state(data: bytes, source: str) -> SavedState:
    """Read a saved state from bytes; source: their origin, for messages.

    Raises:
        StateError: they are invalid; the message gives the reason.
    """
    return _state_of(*decode(data, Path(source)), source)


def _state_of(header: dict[str, Any], arrays: Arrays, path: str | Path) -> SavedState:
    try:
        values = {field.name: header[field.name] for field in dataclasses.fields(StateDescription)}
        values["payload_position_m"] = tuple(values["payload_position_m"])
        figures, memory = header["scene_figures"], header["memory"]
        beside = header.get("beside", {})
        state = SavedState(StateDescription(**values), figures, memory, arrays, str(path), beside)
    except (KeyError, TypeError) as error:
        remedy = "take another saved state, or start without one"
        raise StateError(f"saved state {path}", f"its header lacks {error}", remedy) from error
    if fault := state.fault():
        raise StateError(f"saved state {path}", fault, "take a state that was saved before")
    return state


def check_scene(state: SavedState, scene: Scene) -> None:
    """Reject a state of another scene; log when another solver wrote it.

    Raises:
        StateError: the scene differs in a property that the state depends on.
    """
    difference = next(differences(state.figures, scene_properties(scene), ""), None)
    if difference is not None:
        problem = f"it is of another scene, {state.about.scene}: {difference} in scene {scene.name}"
        remedy = f"give the scene that it was saved from ({state.about.scene_path})"
        raise StateError(f"saved state {state.source}", problem, remedy)
    solver = _solver_digest()
    if state.about.solver != solver:
        _log.warning(
            "saved state %s: solver %s wrote it and %s goes on; the run is the same, but not to "
            "the bit", state.source, state.about.solver, solver,
        )  # fmt: skip


def scene_properties(value: Any) -> Any:
    """Return the properties of a scene (or a part of it) that a state depends on, in plain form."""
    if dataclasses.is_dataclass(value):
        parts = {
            field.name: scene_properties(getattr(value, field.name))
            for field in dataclasses.fields(value)
            if field.name not in _NOT_COMPARED
        }
        return {"kind": type(value).__name__, **parts}
    if isinstance(value, list | tuple):
        return [scene_properties(part) for part in value]
    if isinstance(value, dict):
        return {str(key): scene_properties(part) for key, part in value.items()}
    if isinstance(value, float):
        return value if math.isfinite(value) else str(value)
    return value if value is None or isinstance(value, bool | int | str) else str(value)


def differences(saved: Any, present: Any, path: str) -> Iterator[str]:
    """Yield a description of each difference between two plain forms; path: of both."""
    if isinstance(saved, dict) and isinstance(present, dict):
        for key in [*saved, *(key for key in present if key not in saved)]:
            key_path = f"{path}.{key}" if path else key
            yield from differences(saved.get(key), present.get(key), key_path)
    elif isinstance(saved, list) and isinstance(present, list):
        if len(saved) != len(present):
            yield f"{path} has {len(saved)} entries there and {len(present)}"
        for number, (saved_part, present_part) in enumerate(zip(saved, present, strict=False)):
            yield from differences(saved_part, present_part, f"{path}[{number}]")
    elif saved != present:
        yield f"{path} is {_describe(saved)} there and {_describe(present)}"


def _describe(value: Any) -> str:
    """Return a value as text, or the type of a component."""
    if isinstance(value, dict):
        return str(value.get("kind", "a mapping"))
    return "absent" if value is None else str(value)
