"""The twin for programs that use the package: it takes a scene's name, and refusals are errors.

The suite's own runners use `rope_twin.twin.twin.Twin`, whose offers return the sentence of a
refusal: a sensor that lies is reported, and never ends a run.
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
from rope_twin.twin.saving.saved_state import SavedState

Arguments = ParamSpec("Arguments")


class Twin(twin.Twin):
    """One scene, running; `scene`: its name, the path of its file, or what `load_scene` returned.

    Every offer of an input raises InputError, with the sentence that says why, if the input is
    refused; what was accepted before stays in force. Else it returns "".

    Raises:
        SceneError: the scene is wrong or cannot be built, or its rope has no equilibrium to start
            from.
    """

    def __init__(self, scene: Scene | str | Path) -> None:
        super().__init__(_loaded(scene))

    @classmethod
    def restore(cls, saved: str | Path | SavedState, scene: Scene | str | Path) -> Self:
        """A twin that goes on from a saved state (or the file of one) of this scene.

        Raises:
            StateError: one sentence on what is wrong with the file, or which figure of the scene
                is another.
            SceneError: as for a new twin.
        """
        return super().restore(saved, _loaded(scene))


def _loaded(scene: Scene | str | Path) -> Scene:
    return scene if isinstance(scene, Scene) else load_scene(scene)


def _raising(offer: Callable[Arguments, str]) -> Callable[Arguments, str]:
    """The same offer; it raises its refusal."""

    @functools.wraps(offer)
    def offered(*args: Arguments.args, **kwargs: Arguments.kwargs) -> str:
        refusal = offer(*args, **kwargs)
        if refusal:
            raise InputError(refusal)
        return refusal

    about = str(offer.__doc__).strip().splitlines()[0]
    offered.__doc__ = f"{about.partition('; ')[0].rstrip('.')}. Raises InputError if refused."
    return offered


for _name in dir(twin.Twin):
    if _name.startswith("offer_"):
        setattr(Twin, _name, _raising(getattr(twin.Twin, _name)))
