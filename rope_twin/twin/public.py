"""Public Python API of the twin: it takes a scene by name and raises on rejected inputs.

The nodes use `rope_twin.twin.twin.Twin`, whose `submit_*` methods return the reason for a
rejection: a faulty sensor is reported and never ends a run.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import ParamSpec, Self

from rope_twin.errors import InputError
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import Scene
from rope_twin.twin import twin
from rope_twin.twin.monitors import NO_MONITORS, Monitors
from rope_twin.twin.state import SavedState

Arguments = ParamSpec("Arguments")


class Twin(twin.Twin):
    """Simulation of one scene, given by its name, the path of its file, or from `load_scene`.

    Every `submit_*` method raises InputError with the reason if the input is rejected; inputs
    accepted earlier stay in force. Otherwise it returns "".

    `advance` applies what was submitted and nothing else: the scene's vessel motion and winch
    schedule are submitted by `rope_twin.fed`.

    Raises:
        SceneError: the scene is invalid or cannot be built, or its rope has no static equilibrium
            to start from.
    """

    def __init__(self, scene: Scene | str | Path, monitors: Monitors = NO_MONITORS) -> None:
        super().__init__(_loaded(scene), monitors)

    @classmethod
    def restore(
        cls,
        saved: str | Path | SavedState,
        scene: Scene | str | Path,
        monitors: Monitors = NO_MONITORS,
    ) -> Self:
        """Return a twin that resumes from a saved state of this scene.

        saved: the state, or the path of its file. monitors: those of the run.

        Raises:
            StateError: the file is invalid, or the scene differs; the message names the difference.
            SceneError: as for a new twin.
        """
        return super().restore(saved, _loaded(scene), monitors)


def _loaded(scene: Scene | str | Path) -> Scene:
    return scene if isinstance(scene, Scene) else load_scene(scene)


def _raising(submit: Callable[Arguments, str]) -> Callable[Arguments, str]:
    """Return a method that raises InputError with the rejection that `submit` returns."""

    @functools.wraps(submit)
    def submitted(*args: Arguments.args, **kwargs: Arguments.kwargs) -> str:
        refusal = submit(*args, **kwargs)
        if refusal:
            raise InputError(refusal)
        return refusal

    about = str(submit.__doc__).strip().splitlines()[0]
    submitted.__doc__ = f"{about.partition('; ')[0].rstrip('.')}. Raises InputError if refused."
    return submitted


for _name in dir(twin.Twin):
    if _name.startswith("submit_"):
        setattr(Twin, _name, _raising(getattr(twin.Twin, _name)))
