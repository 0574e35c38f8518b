"""Golden states: each shipped scene's first 30 s, as users run it, in a file that a test compares.

`PYTHONPATH=. python test/stability/golden_states.py NAME` at the root of the repository writes the
row of a new scene to golden_states.json, without a name all rows (about two minutes once all is
compiled). Rows of other scenes change only together with a raised `SOLVER_VERSION`,
`CONNECTIONS_VERSION` or `Effect.version`, or where results change by rounding alone (1e-9 of the
tension's standard deviation) or within a bound that the scene states (`neglected_m_per_s`), and
with the reason in the commit.
"""

from __future__ import annotations

import hashlib
import json
import re
import sys
from pathlib import Path
from typing import Any

import llvmlite.binding
import numba
import numpy as np

from benchmarks.compile_time import step_types
from rope_twin.run.options import RunOptions
from rope_twin.run.unpaced import UnpacedRun
from rope_twin.scene.convergence import solver_version
from rope_twin.scene.lift import listed_effects
from rope_twin.scene.load import scene_names
from rope_twin.scene.schema import Scene

FILE = Path(__file__).with_name("golden_states.json")
EVERY_S, UNTIL_S = 5, 30
DIGITS = 12
_STATE = ("rope/state/", "joined/")  # the arrays of the ropes among those of a saved state


def machine() -> str:
    """Return what decides the last bits of compiled code: processor, its features, numba."""
    features = llvmlite.binding.get_host_cpu_features().flatten()
    digest = hashlib.sha256(features.encode()).hexdigest()[:8]
    cpu = llvmlite.binding.get_host_cpu_name()
    return f"{cpu}, features {digest}, numba {numba.__version__}, numpy {np.__version__}"


def golden(name: str, until_s: float = UNTIL_S) -> dict[str, Any]:
    """Run a scene with its own sea and winch schedule; states and tension every 5 s."""
    run = UnpacedRun(RunOptions(scene=name, speed=0.0))
    digests, tensions, every = [], [], []
    while run.twin.time_ns < until_s * 1_000_000_000:
        snapshot = run.advance_slot()
        every.append(snapshot.tension_top_n)
        if snapshot.time_s >= EVERY_S * (len(tensions) + 1) - 1e-9:
            digests.append(_digest(run))
            tensions.append(float(f"{snapshot.tension_top_n:.{DIGITS - 1}e}"))
    return {
        "machine": machine(),
        "solver": solver_version(run.twin.scene),
        "parts": parts_of(run.twin.scene),
        "std_n": float(f"{np.std(every):.6g}"),
        "tension_top_n": tensions,
        "state": digests,
    }


def parts_of(scene: Scene) -> list[str]:
    """Return the records that the scene's step is compiled for, and the effects that it lists."""
    records = re.findall(r"[A-Z]\w+", step_types(scene))
    return sorted({*records, *listed_effects(scene)})


def covering() -> list[str]:
    """Return scenes that between them have every part: first those that add most of their own."""
    parts = {name: set(row["parts"]) for name, row in sorted(rows().items())}
    missing, chosen = set().union(*parts.values()), []
    while missing:
        best = max(parts, key=lambda name: len(parts[name] & missing) / len(parts[name]))
        chosen.append(best)
        missing -= parts[best]
    return sorted(chosen)


def _digest(run: UnpacedRun) -> str:
    arrays = run.twin.capture().arrays
    digest = hashlib.sha256()
    for name in sorted(arrays):
        if name.startswith(_STATE):
            digest.update(name.encode())
            digest.update(np.ascontiguousarray(arrays[name]).tobytes())
    return digest.hexdigest()[:16]


def rows() -> dict[str, Any]:
    """Read the file: a row for each scene."""
    found: dict[str, Any] = json.loads(FILE.read_text(encoding="utf-8"))
    return found


def write(names: list[str]) -> None:
    """Write the file again for these scenes; the others' rows stay."""
    computed = rows() if FILE.exists() else {}
    for name in names:
        computed[name] = golden(name)
        sys.stderr.write(f"{name}\n")
    lines = (f' "{name}": {json.dumps(row)}' for name, row in sorted(computed.items()))
    FILE.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")


if __name__ == "__main__":
    write(sys.argv[1:] or list(scene_names()))
