"""Process in plain Python: restart of a rope with an effect that has internal variables."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from small_scene import SMALL_SCENE, digest

import rope_twin.scene.rope_model as build_module
from rope_twin import Twin, load_scene
from rope_twin.core.loads.hooks import kernel
from rope_twin.core.state import RESIDUAL

build_effects = build_module.build_effects


class Pusher(NamedTuple):
    """Effect that pushes node 0 east [N] in proportion to the number of its calls."""

    asked: np.ndarray


@kernel("load_end", Pusher)
def push(pusher: Any, work: Any, stage: Any) -> None:
    pusher.asked[0] += 1.0
    work[RESIDUAL, 0] += 1e-3 * pusher.asked[0]


def with_pusher(*given: Any) -> tuple[Any, ...]:
    return (*build_effects(*given), Pusher(np.zeros(1)))


def run(twin: Twin) -> str:
    snapshots = []
    for _ in range(4):
        twin.advance(2)
        snapshots.append(twin.snapshot())
    return digest(snapshots)


def differs(folder: Path, spoil: Callable[[Twin], None]) -> bool:
    """Return whether a spoilt restored run differs; assert that branch and restored run do not."""
    twin = Twin(load_scene(folder / "small.yaml"))
    twin.advance(3)
    twin.save(folder / "saved")
    restored = Twin.restore(folder / "saved", twin.scene)
    branch = twin.branch()
    spoilt = Twin.restore(folder / "saved", twin.scene)
    spoil(spoilt)
    expected = run(twin)
    assert run(restored) == expected
    assert run(branch) == expected
    return run(spoilt) != expected


def forget(twin: Twin) -> None:
    twin.rope.effects[-1].asked[:] = 0.0


if __name__ == "__main__":
    build_module.build_effects = with_pusher
    path = Path(sys.argv[1])
    text = SMALL_SCENE.replace("elements: 20", "elements: 4")
    (path / "small.yaml").write_text(text, encoding="utf-8")
    assert differs(path, forget)
    sys.stdout.write("restored and branch are the run; without the memory they are not\n")
