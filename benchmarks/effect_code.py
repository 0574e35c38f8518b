"""Effects whose code is in the compiled step of a scene, read from its assembly."""

from __future__ import annotations

import numpy as np

from rope_twin.core.jit.decorators import assembly
from rope_twin.core.loads.hooks import hooks_of, kernel_of
from rope_twin.core.state import MOTIONS, PULL_COLUMNS, Boundary
from rope_twin.core.step import advance_steps
from rope_twin.scene.model.rope import build
from rope_twin.scene.schema import Scene


def step_assembly(scene: Scene) -> str:
    """Return the assembly of the step for the scene's effects; it takes about 10 s."""
    border = np.zeros((2, MOTIONS))
    arguments = (build(scene), Boundary(border, border), np.zeros((1, PULL_COLUMNS)), 0.0, 1)
    return assembly(advance_steps, arguments)


def modules_of(scene: Scene, without: Scene) -> tuple[str, ...]:
    """Return the kernel modules that one scene has and another has not: those of one effect."""
    others = {type(effect) for effect in build(without).effects}
    kinds = [type(own) for own in build(scene).effects if type(own) not in others]
    kernels = [kernel_of(hook, kind) for kind in kinds for hook in hooks_of(kind)]
    return tuple(sorted({kernel.py_func.__module__ for kernel in kernels}))


def traces(code: str, module: str) -> int:
    """Count the symbols of a module's functions in assembly, as numba mangles them."""
    return code.count("".join(f"{len(part)}{part}" for part in module.split(".")))
