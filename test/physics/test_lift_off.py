"""A rigid body on a deck: at rest, heaved, dropped, and lifted off with hits on the way."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from body_rigs import LINE, Hung, Vector, scene_of
from rigs import march, sine, still

from rope_twin import Twin
from rope_twin.core.body import state as at
from rope_twin.effects.rigid_body import DeckHeave, DeckParams, RigidBodyParams, Sling
from rope_twin.scene.schema import Winch

G, MASS = 9.80665, 2000.0
DECK = DeckParams(height_m=-24.0, penetration_m=0.004, damping_s_per_m=0.5, friction=0.4)
SLINGS = tuple(
    Sling(to_m=(x, y, 0.6), length_m=5.0, stiffness_n_per_m=4e6, damping_newton_seconds_per_m=2e4)
    for x in (1.8, -1.8)
    for y in (1.2, -1.2)
)
MODULE = RigidBodyParams(size_m=(4.0, 3.0, 1.2), slings=SLINGS, hook_mass_kg=50.0, deck=DECK)
HOISTED = replace(
    LINE, mass=1.0, EA=2e7, damping=2e4, step=0.0025, ramp=4.0,
    winch=Winch(speed_limit_m_per_s=0.5, acceleration_limit_m_per_s2=0.5, min_line_out_m=5.0,
                max_line_out_m=30.0),
)  # fmt: skip


def test_static_deck_reaction_with_slack_slings() -> None:
    """The deck carries m·g at the given penetration; the rope carries the hook; 1e-6."""
    snapshot = Twin(scene_of(LINE, MODULE)).snapshot()
    assert snapshot.body is not None
    assert snapshot.body.leg_tension_n.max() == 0.0
    assert snapshot.body.deck_reaction_n == pytest.approx(MASS * G, rel=1e-6)
    assert snapshot.body.deck_clearance_m == pytest.approx(-DECK.penetration_m, rel=1e-6)
    assert snapshot.tension_payload_n == pytest.approx(50.0 * G, rel=1e-2)


def test_deck_reaction_of_a_heaving_deck() -> None:
    """m·(g + d²z/dt²) of the deck's own sine, and of the ship's; 1 % of the varying part."""
    amplitude, period = 0.4, 7.0
    omega = 2.0 * math.pi / period
    own = replace(DECK, heave=DeckHeave(amplitude_m=amplitude, period_s=period, ramp_s=4.0))
    for deck, heave in ((own, still), (replace(DECK, with_ship=True), sine(amplitude, period))):
        scene = scene_of(replace(HOISTED, step=0.01), replace(MODULE, deck=deck))
        push, time = [], []
        for snapshot in march(Twin(scene), heave, 14.0, every=5):
            assert snapshot.body is not None
            push.append(snapshot.body.deck_reaction_n)
            time.append(snapshot.time_s)
        settled = np.array(time) > 6.0
        expected = MASS * (G - amplitude * omega**2 * np.sin(omega * np.array(time)))
        off = (np.array(push) - expected)[settled]
        assert np.abs(off).max() < 0.01 * MASS * amplitude * omega**2


def test_peak_reaction_of_a_fall_onto_an_undamped_deck() -> None:
    """m·g·(1 + √(1 + 2·h/p)) after a fall of h, p the static penetration."""
    fall, p = 0.05, DECK.penetration_m
    body = replace(MODULE, deck=replace(DECK, damping_s_per_m=0.0))
    hung = Hung(replace(LINE, step=0.0005), body)
    hung.record[at.X + 2] += fall + p  # from where the corners touch
    hung.let_go((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, -MASS * G))
    push = [0.0]
    for _ in range(round(0.25 / 0.0005)):
        hung.twin.advance(1)
        snapshot = hung.twin.snapshot()
        assert snapshot.body is not None
        push.append(snapshot.body.deck_reaction_n or 0.0)
    assert max(push) == pytest.approx(MASS * G * (1.0 + math.sqrt(1.0 + 2.0 * fall / p)), rel=3e-3)


def lifted(seconds: float) -> Vector:
    """Hoisted slowly off a deck that heaves. A row each step: time, push, lift, v, clearance."""
    heave = DeckHeave(amplitude_m=0.25, period_s=5.0, ramp_s=4.0)
    body = replace(MODULE, deck=replace(DECK, heave=heave))
    rows = []
    speeds = [(1.0, -0.12)]
    for snapshot in march(Twin(scene_of(HOISTED, body)), sine(0.1, 7.0), seconds, speeds=speeds):
        own: Any = snapshot.body
        toward = snapshot.node_position_m[-1] - own.leg_end_m
        lift = float(own.leg_tension_n @ (toward[:, 2] / own.leg_length_m))
        v = float(snapshot.payload_velocity_m_per_s[2])
        rows.append((snapshot.time_s, own.deck_reaction_n, lift, v, own.deck_clearance_m))
    return np.array(rows)


def test_momentum_balance_of_lift_off_and_re_hits() -> None:
    """Only weight pulls it down, and its momentum is the impulse of all forces."""
    time, push, lift, v, clearance = lifted(34.0).T
    assert push.min() == 0.0
    assert lift.min() == 0.0
    assert lift[time < 4.0].max() == 0.0, "slack at first"
    airborne = push == 0.0
    hits = np.flatnonzero(airborne[:-1] & ~airborne[1:])
    assert len(hits) >= 2, "the deck comes up again"
    assert push.max() > 1.3 * MASS * G, "and hits"
    assert airborne[-200:].all()
    assert clearance[-1] > 0.3
    h = time[1] - time[0]
    force = push + lift - MASS * G
    impulse = h * np.concatenate([[0.0], np.cumsum(0.5 * (force[1:] + force[:-1]))])
    off = MASS * (v - v[0]) - impulse
    assert np.abs(off).max() < 0.02 * MASS * np.abs(v).max()
