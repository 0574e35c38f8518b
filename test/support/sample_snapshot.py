"""Snapshots with every field set, for tests of their consumers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rope_twin.scene.error_bound import KnownError
from rope_twin.twin.motion.ship_motion import ShipPose
from rope_twin.twin.snapshot import (
    BedContact,
    BodySnapshot,
    CompensatorSnapshot,
    ContactForce,
    InputHealth,
    PayloadSnapshot,
    Quality,
    Residual,
    RopeSnapshot,
    Snapshot,
    SolverHealth,
    StrutSnapshot,
    TensionInterval,
)
from rope_twin.vortex.fatigue import BendResult
from rope_twin.vortex.results import MaterialFatigue, RopeVibration

RESIDUAL = Residual(
    name="winch", quantity="top_tension_n", at_s=2.4, measured=3.21e5, computed=3.208e5,
    half_width=1500.0, instrument=700.0, twin=None, readings=1200, mean=400.0, rms=800.0,
    outside=0.04, span_s=60.0,
)  # fmt: skip


QUALITY = Quality(
    element="top_tension", index=0.8, cause="discretisation", reason="error 7 %, tolerance 5 %",
    components=(1.0, 1.0, 0.8, 1.0, 1.0, None), lowest=0.4, lowest_at_s=1.2,
    lowest_reason="heave: late",
)  # fmt: skip


def hanging_rope(
    nodes: int = 11, length_m: float = 3000.0, time_s: float = 2.5, heave_m: float = 0.4
) -> Snapshot:
    """Return a steel wire that hangs straight with 20 t on it and swings a little east."""
    arc = np.linspace(0.0, length_m, nodes)
    position = np.zeros((nodes, 3))
    position[:, 0] = 40.0 * (arc / length_m) ** 2
    position[:, 1] = -5.0 * arc / length_m
    position[:, 2] = heave_m - arc
    swing = np.sin(np.pi * arc / length_m)
    velocity = np.zeros((nodes, 3))
    velocity[:, 2] = 0.3
    element = 170e3 + 50.0 * (length_m - 0.5 * (arc[1:] + arc[:-1]))
    node = np.concatenate([element[:1], 0.5 * (element[1:] + element[:-1]), element[-1:]])
    return Snapshot(
        stamp_ns=round(time_s * 1e9),
        step=round(time_s * 100),
        node_position_m=position,
        node_velocity_m_per_s=velocity,
        node_tension_n=node,
        element_tension_n=element,
        arc_length_m=arc,
        tension_top_n=float(element[0]),
        tension_top_min_n=float(element[0]) - 1e3,
        tension_top_max_n=float(element[0]) + 1e3,
        hang_off_force_n=np.array([10.0, -2.0, -float(element[0])]),
        lower_end_force_n=(30.0, -40.0, 1.2e3),
        tension_payload_n=float(element[-1]),
        hang_off_position_m=position[0].copy(),
        hang_off_velocity_m_per_s=velocity[0].copy(),
        heave_m=heave_m,
        payload_position_m=position[-1].copy(),
        payload_velocity_m_per_s=velocity[-1].copy(),
        line_out_m=length_m,
        payout_speed_m_per_s=0.5,
        motion_ramp=1.0,
        step_s=0.01,
        solver=SolverHealth(steps=250, solves=500),
        study_error=KnownError(0.5, 0.1, "at most, in a run on paper"),
        inputs={"heave": InputHealth(accepted=50, age_s=0.02)},
        compensator=CompensatorSnapshot(
            2.1, 4.0, -0.3, 1.7e5, 8.1e6, 1.72e5, -2e3, -500.0, 0.0, 500.0
        ),
        seabed=BedContact(-0.03, 9.5e4, 12.0, 600.0),
        residuals=(RESIDUAL,),
        contacts=(ContactForce("hull", 1.3e4, (0.5, -1.0, -16.0)),),
        quality=(QUALITY,),
        error_interval=TensionInterval(
            float(element[0]) - 40.0, float(element[0]) + 40.0, 40.0, 25.0
        ),
        vibration=RopeVibration(
            "time-domain",
            0.5 * swing,
            2.0 + swing,
            0.1 * swing,
            4.0 + swing,
            1.0 + swing,
            0.0,
            0,
            "",
            1.5,
        ),
        fatigue=MaterialFatigue(
            "stranded_wire",
            2.0,
            length_m - arc,
            arc,
            1e-9 * np.arange(nodes),
            False,
            BendResult(
                0.5 * np.arange(nodes), 1e-6 * np.arange(nodes), 1e-3 * np.arange(nodes), "a test"
            ),
        ),
    )


def hanging_body(nodes: int = 11) -> Snapshot:
    """Return the same with a rigid body on two slings, just off a deck."""
    snapshot = hanging_rope(nodes)
    return replace(
        snapshot,
        body=BodySnapshot(
            quaternion=np.array([0.0, 0.0, 0.0, 1.0]),
            angular_velocity_rad_per_s=np.zeros(3),
            size_m=np.array([4.0, 3.0, 2.5]),
            leg_tension_n=np.array([5e4, 6e4]),
            leg_length_m=np.array([7.0, 7.1]),
            leg_end_m=snapshot.payload_position_m + np.array([[1.8, 0.0, 1.25], [-1.8, 0.0, 1.25]]),
            hook_m=snapshot.node_position_m[-1],
            deck_reaction_n=1e3,
            deck_clearance_m=-0.01,
        ),
    )


def rolled_ship(stamp_ns: int) -> ShipPose:
    """Return a ship 1.5 m up, turned about x by 2·asin(0.6), with rates about all axes."""
    return ShipPose(
        stamp_ns, (0.3, -0.2, 1.5), (0.1, 0.0, -0.4), (0.6, 0.0, 0.0, 0.8), (0.02, -0.01, 0.003)
    )


def lifted() -> Snapshot:
    """Return a hoist and two slings, a bar and two payloads."""
    first = hanging_rope(5, length_m=100.0)
    ropes = [
        RopeSnapshot(
            name="hoist",
            node_position_m=first.node_position_m,
            node_tension_n=first.node_tension_n,
            element_tension_n=first.element_tension_n,
            tension_top_n=first.tension_top_n,
            line_out_m=100.0,
            payout_speed_m_per_s=0.5,
        )
    ]
    for k, name in enumerate(("port", "starboard")):
        end = first.node_position_m[-1]
        nodes = end + np.linspace(0.0, 1.0, 3 + k)[:, None] * [2.0 * k - 1.0, 0.0, -8.0]
        ropes.append(
            RopeSnapshot(
                name=name,
                node_position_m=nodes,
                node_tension_n=np.linspace(6e3, 5e3, 3 + k),
                element_tension_n=np.linspace(6e3, 5e3, 2 + k),
                tension_top_n=6e3 + k,
                line_out_m=8.0,
                payout_speed_m_per_s=0.0,
            )
        )
    payloads = [
        PayloadSnapshot(
            name=rope.name,
            position_m=rope.node_position_m[-1],
            velocity_m_per_s=np.array([0.1, 0.0, -0.2]) * (k + 1),
        )
        for k, rope in enumerate(ropes[1:])
    ]
    ends = np.stack([one.position_m for one in payloads])
    return replace(
        first,
        ropes=tuple(ropes),
        payloads=tuple(payloads),
        struts=(StrutSnapshot(name="bar", ends_m=ends, pull_n=-4e3),),
    )
