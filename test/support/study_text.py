"""A small study as text, and its file."""

from __future__ import annotations

from pathlib import Path

GOOD = """\
about: a small one
scene: shallow_lift
seconds: 2.0
vary:
  - {path: "payloads[0].mass_kg", values: [18000.0, 20000.0, 22000.0]}
  - {name: cable, path: "ropes[0].rope", names: [steel_wire_40mm, steel_wire_76mm]}
  - name: drag
    cases:
      - {name: smooth, set: {effects.drag.normal: 1.2, effects.drag.tangential: 0.01}}
      - {name: rough, set: {effects.drag.normal: 1.9, effects.drag.tangential: 0.03}}
fatigue: {curve: stranded_wire, piece_m: 50.0, sample_s: 0.5}
"""
DRAWN = GOOD + "latin_hypercube: {runs: 12, seed: 3}\n"


def written(folder: Path, text: str = GOOD) -> Path:
    path = folder / "small.yaml"
    path.write_text(text, encoding="utf-8")
    return path
