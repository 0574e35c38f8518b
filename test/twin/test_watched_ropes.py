"""Vibration and fatigue of the ropes of a multi-line system: against one rope, and by symmetry."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from parted_lift import whole_and_parted

from rope_twin import messages
from rope_twin.messages import read_cloud, statuses
from rope_twin.run.summary import fatigue_figures
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import Scene
from rope_twin.studies.driven_twin import march
from rope_twin.twin.monitors import Monitors
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.twin import Twin
from rope_twin.vortex.results import MonitorSettings
from validation.rigs import sine

BOTH = Monitors(vortex=MonitorSettings("frequency-domain", "stranded_wire"))
WORN = Monitors(vortex=MonitorSettings(fatigue="stranded_wire"))


def last_of(scene: Scene, asked: Monitors) -> Snapshot:
    """Return the state of a twin after payout in heave."""
    (*_, last) = march(Twin(scene, asked), sine(0.5, 3.0), 8.0, 2, [(1.0, 0.5)])
    return last


def test_a_rope_in_two_parts_vibrates_and_wears_as_the_rope() -> None:
    """Cross-flow amplitude at each node, frequency, and the damage of each metre."""
    whole, parted = whole_and_parted()
    one, two = last_of(whole, BOTH), last_of(parted, BOTH)
    upper, lower = two.ropes
    assert one.vibration is not None
    assert upper.vibration is not None
    assert lower.vibration is not None
    largest = float(one.vibration.cross_flow.max())
    assert largest > 0.1
    for name, scale in (("cross_flow", largest), ("cross_flow_hz", 1.0)):
        above, below = (getattr(part.vibration, name) for part in (upper, lower))
        assert above[-1] == below[0]
        found = np.concatenate([above, below[1:]])
        assert found == pytest.approx(getattr(one.vibration, name), abs=5e-3 * scale)
    assert one.fatigue is not None
    assert upper.fatigue is not None
    assert lower.fatigue is not None
    used = np.concatenate([lower.fatigue.used, upper.fatigue.used])[: len(one.fatigue.used)]
    assert used == pytest.approx(one.fatigue.used, rel=0.02)
    assert lower.fatigue.from_lower_end_m == pytest.approx(np.arange(0.5, 100.0))
    cloud = read_cloud(
        messages.decode("ropes/fatigue", messages.Encoder(0).encode("ropes/fatigue", two))
    )
    assert (cloud["rope"] == np.repeat([0.0, 1.0], [300, 100])).all()
    assert cloud["damage"] == pytest.approx(
        np.concatenate([upper.fatigue.used, lower.fatigue.used])
    )
    nodes = read_cloud(
        messages.decode("ropes/vibration", messages.Encoder(0).encode("ropes/vibration", two))
    )
    counts = [len(part.node_position_m) for part in (upper, lower)]
    assert (nodes["rope"] == np.repeat([0.0, 1.0], counts)).all()


def test_legs_of_a_bridle_wear_alike_and_less_than_the_hoist() -> None:
    """Where they meet, the hoist's tension swings 2·cos 30° times as far as a leg's, at least.

    The hook between them adds a few per cent. Damage goes with the fourth power.
    """
    scene = load_scene("bridle_lift")
    effects = tuple(
        replace(one, profile=((0.0, (1e-9, 0.0)),)) if hasattr(one, "profile") else one
        for one in scene.effects
    )
    scene = replace(scene, effects=effects)
    twin = Twin(scene, WORN)
    (*_, first) = march(twin, sine(0.5, 6.0), 9.0, 2)
    again = Twin.restore(twin.capture(), scene, WORN)
    (*_, snapshot), (*_, other) = (march(own, sine(0.5, 6.0), 4.0, 2) for own in (twin, again))
    worn = {one.name: one.fatigue.used for one in snapshot.ropes if one.fatigue is not None}
    assert list(worn) == [line.name for line in scene.ropes]
    assert worn["leg_port"] == pytest.approx(worn["leg_starboard"], rel=1e-3)
    assert worn["sling_port"] == pytest.approx(worn["sling_starboard"], rel=1e-3)
    assert 9.0 < worn["hoist"][0] / worn["leg_port"][-1] < 12.0
    assert first.ropes[1].fatigue is not None
    assert (worn["leg_port"] > first.ropes[1].fatigue.used).all()
    for one, same in zip(snapshot.ropes, other.ropes, strict=True):
        assert one.fatigue is not None
        assert same.fatigue is not None
        assert np.array_equal(one.fatigue.used, same.fatigue.used), one.name
    figures = fatigue_figures(snapshot)
    assert figures is not None
    assert figures["rope"] == "hoist"
    row = next(row for row in statuses(snapshot, None) if row.name == "simulation: fatigue")
    assert "upper end of 'hoist'" in row.message
