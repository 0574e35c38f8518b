"""Static profiles of the scenes that come with the package, for the gallery's thumbnails.

`python docs/ext/profiles.py` computes those that docs/images/profiles.json does not have yet,
`python docs/ext/profiles.py NAME...` computes these again. Compiling takes longer than statics of
one line: with NUMBA_DISABLE_JIT=1 all but the largest scenes are done in a minute. The build draws
what the file holds and computes nothing.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from rope_twin import Snapshot, Twin  # noqa: E402
from rope_twin.scene.load import load_scene, scene_names  # noqa: E402

STORED = ROOT / "docs" / "images" / "profiles.json"
NODES_MAX = 40  # of a line in the file: more cannot be seen in a thumbnail


def stored_profiles() -> dict[str, dict[str, Any]]:
    """Return what the file holds, by scene."""
    return json.loads(STORED.read_text("utf-8")) if STORED.exists() else {}


def static_profile(name: str) -> dict[str, Any]:
    """Return lines, payloads and struts of a scene in static equilibrium: x, y, z [m]."""
    snapshot = Twin(load_scene(name)).snapshot()
    lines = [rope.node_position_m for rope in snapshot.ropes] or [snapshot.node_position_m]
    return {
        "lines": [_thinned(line) for line in lines],
        "payloads": _payloads(snapshot),
        "struts": [_rounded(strut.ends_m) for strut in snapshot.struts],
        "tension_top_kn": round(snapshot.tension_top_n / 1e3, 1),
    }


def _payloads(snapshot: Snapshot) -> list[list[float]]:
    if snapshot.ropes:
        return [_rounded(payload.position_m) for payload in snapshot.payloads]
    return [_rounded(snapshot.payload_position_m)]


def _thinned(line: Any) -> list[list[float]]:
    rows = np.unique(np.linspace(0, len(line) - 1, min(len(line), NODES_MAX)).round().astype(int))
    return _rounded(np.asarray(line)[rows])


def _rounded(numbers: Any) -> list[Any]:
    rounded: list[Any] = np.asarray(numbers, dtype=float).round(2).tolist()
    return rounded


def main(names: list[str]) -> None:
    """Compute the profiles of these scenes, or those that are missing, and store each at once."""
    kept = stored_profiles()
    for name in names or [name for name in scene_names() if name not in kept]:
        kept[name] = static_profile(name)
        text = json.dumps(kept, sort_keys=True, separators=(",", ":"))
        STORED.write_text(text.replace('},"', '},\n"') + "\n", encoding="utf-8")
        print(name, kept[name]["tension_top_kn"], "kN", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
