"""Plausibility checks of a winch: holding capacity, and time steps for tension feedback."""

from __future__ import annotations

from collections.abc import Iterator

from rope_twin.errors import phrase
from rope_twin.scene.figures import LiftFigures
from rope_twin.scene.schema import Scene

ON, OFF = "compensate", "stop_compensating"
LONGEST_STEP = 0.5  # of the travel time of an axial wave (see twin/winch/tension_feedback.py)


def check_winch(scene: Scene, figures: LiftFigures) -> Iterator[str]:
    """Check the first rope's winch."""
    yield from _holding(scene, figures)
    yield from _feedback(scene, figures)
    yield from _compensates_from_the_start(scene)


def _holding(scene: Scene, figures: LiftFigures) -> Iterator[str]:
    winch, line = scene.winch, scene.ropes[0]
    if winch is None or winch.drum is None or figures.payload is None:
        return
    diameter = line.made_of[-1].rope.diameter_m
    layer = winch.drum.layer_of(winch.most_line_out_m - line.length_m, diameter)
    radius, load = winch.drum.radius_m(layer, diameter), figures.top_tension_n(line.length_m)
    torques = {
        "drive": winch.drive.torque_limit_n_m if winch.drive else None,
        "brake": winch.brake.holding_torque_n_m if winch.brake else None,
    }
    for part, torque in torques.items():
        if torque is not None and torque < load * radius:
            what = (
                f"it holds {torque / radius * 1e-3:.0f} kN on layer {layer}, static tension is "
                f"{load * 1e-3:.0f} kN"
            )
            right = f"give more than {load * radius * 1e-3:.0f} kN·m, or expect it to render"
            yield phrase(f"winch.{part}", what, right)


def _feedback(scene: Scene, figures: LiftFigures) -> Iterator[str]:
    winch = scene.winch
    if winch is None or (winch.drive is None and winch.constant_tension is None):
        return
    part = "drive" if winch.drive is not None else "constant_tension"
    travel = winch.least_line_out_m / figures.axial_wave_speed_m_per_s
    if scene.time.step_s > LONGEST_STEP * travel:
        what = (
            f"a step of {scene.time.step_s:g} s delays the tension feedback too much on "
            f"{winch.least_line_out_m:g} m of rope, with a wave travel time of {travel:.3f} s"
        )
        right = f"give at most {LONGEST_STEP * travel:.2g} s, or a longer least_line_out_m"
        yield phrase(f"winch.{part}", what, right)


def _compensates_from_the_start(scene: Scene) -> Iterator[str]:
    """Check for heave compensation that is switched on later but is on from the start."""
    winch = scene.winch
    if winch is None or winch.heave_compensation is None:
        return
    switches = [row for row in winch.schedule if row.switch in (ON, OFF)]
    if switches and switches[0].switch == ON and switches[0].at_s > 0.0:
        what = f"it is on from the start, and switched on at {switches[0].at_s:g} s"
        right = f"begin with {{at_s: 0.0, switch: {OFF}}} if it is to wait until then"
        yield phrase("winch.heave_compensation", what, right)
