"""Real-time twin with learning: messages in, figures out, taken over by itself; off: no thread."""

from __future__ import annotations

import threading
import time
from collections import Counter
from pathlib import Path

import pytest
from learned_lift import NOISE_N, lift
from small_scene import SMALL_SCENE

from rope_twin import load_scene
from rope_twin.messages import encode_heave, encode_measurement
from rope_twin.messages.reports import ROW
from rope_twin.ros.paced_twin import PacedTwin
from rope_twin.ros.params import SimulationParams
from rope_twin.topics import ESTIMATE_TOPIC
from rope_twin.twin.readings import Measurement

SPEED, AHEAD_S, PATIENCE_S = 16.0, 3.0, 120.0


@pytest.fixture
def scene_file(tmp_path: Path) -> str:
    """Return the file of the small scene with sensors that are known well."""
    path = tmp_path / "small.yaml"
    path.write_text(
        SMALL_SCENE + f"learning: {{pin_range_n: {NOISE_N / 0.0075}, friction_pct: 0.0, "
        "friction_uncertainty_pct: 0.001, heave_delay_s: 0.0, heave_delay_uncertainty_s: 0.001}\n"
        "measured: {tension: {uncertainty_n: 500.0}}\n"
    )
    return str(path)


def worker_threads() -> list[str]:
    """Return the names of worker threads."""
    return [one.name for one in threading.enumerate() if one.name == "twin-worker"]


def test_without_learning_there_is_no_thread(scene_file: str, tmp_path: Path) -> None:
    """No learner, no listener, no row."""
    params = SimulationParams(scene=scene_file, failure_directory=str(tmp_path))
    paced = PacedTwin(load_scene(scene_file), params, lambda name, data: None)
    assert paced.learning is None
    assert paced.border.listener is None
    assert paced.border.motion_listener is None
    assert ROW not in [row.name for row in paced.rows(-time.monotonic_ns())]
    assert not worker_threads()


def test_figures_come_out_and_are_taken_over(scene_file: str, tmp_path: Path) -> None:
    """Two minutes of messages at 16 times real time give one estimate, which the twin has then."""
    published: Counter[str] = Counter()

    def publish(name: str, data: bytes) -> None:
        published[name] += 1

    params = SimulationParams(
        scene=scene_file, speed=SPEED, learn=True, apply_learned=True,
        failure_directory=str(tmp_path), sender_lead_s=5.0, overload_protection=False,
    )  # fmt: skip
    paced = PacedTwin(load_scene(scene_file), params, publish)
    assert paced.learning is not None
    series = lift()
    heave, tension, line = (one.table for one in (series.heave, series.tension, series.line_out))
    epoch_ns = paced.begin(time.time_ns())
    assert worker_threads()
    sent, said, give_up_s = 0, [], time.monotonic() + PATIENCE_S
    while paced.learning.learner.newest is None or not paced.twin.inputs.figures.active:
        now_s = paced.last.stamp_ns * 1e-9
        while sent < len(heave) and heave[sent, 0] < now_s + AHEAD_S:
            t, z, v = heave[sent]
            at_ns = epoch_ns + round(t * 1e9)
            paced.border.take_motion("ship/heave", encode_heave(at_ns, z, v), "mru")
            reading = Measurement.of_winch(0, line[sent, 1], None, tension[sent, 1])
            topic, data = encode_measurement(at_ns, reading)
            paced.border.take_measurement(topic, data)
            sent += 1
        said += list(paced.notices())
        assert time.monotonic() < give_up_s, (said, paced.learning.row(1.0))
        time.sleep(0.02)
    paced.halt()
    assert published[ESTIMATE_TOPIC] == 1
    assert any("submerged_weight" in words for words in said)
    assert any("taken over in 20 s" in words for words in said)
    summary = paced.summary()
    assert {one["name"] for one in summary.learned} > {"submerged_weight", "tension_bias"}
    row = next(r for r in paced.rows(0) if r.name == ROW)
    assert float(row.values["CPU [% of a core]"]) > 0.0
    assert not worker_threads()
