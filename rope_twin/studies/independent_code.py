"""Independent verification code: the same rope by an explicit method in plain numpy.

Leapfrog, v += h·F/M between x += h·v, far below its stability limit h < (2/ω)·(√(1 + ζ²) - ζ), ω =
2·√(EA/m)/l0, ζ = c·√(EA/m)/(EA·l0). It has no Newton iteration, no stages, no substeps and none of
the compiled kernels, so that agreement is not due to shared code. It runs a short piece, a few
elements over a few seconds with the winch stopped, on the same elements as the solver.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rope_twin.core import state as rows
from rope_twin.effects.current import CurrentParams
from rope_twin.effects.drag import DragParams
from rope_twin.effects.payload import PayloadParams
from rope_twin.effects.rope_mass import AddedMassParams, WeightParams
from rope_twin.scene.error_bound import Setting
from rope_twin.scene.grid import find_payload, section_damping
from rope_twin.scene.rope_model import build
from rope_twin.scene.schema import Scene
from rope_twin.scene.shapes import payload_figures
from rope_twin.studies.accuracy_run import MotionWindow, Trial
from rope_twin.studies.driven_twin import variant
from rope_twin.twin.statics import solve_scene_statics

Vector = NDArray[np.float64]
ELEMENTS, AFTER_RAMP_S = (20, 10, 5), 12.0  # the most whose step is no shorter than ...
SHORTEST_S = 4e-4
SHARE = 0.2  # of the largest stable step
KNOWN = (CurrentParams, WeightParams, DragParams, AddedMassParams, PayloadParams)


@dataclass(frozen=True)
class IndependentResult:
    """Result of the independent code."""

    elements: int
    seconds: float
    step_s: float  # of the explicit code
    rms_pct: float  # between both, of the standard deviation; of the mean if nothing moves
    peak_pct: float

    def __str__(self) -> str:
        return (
            f"explicit leapfrog in steps of {1e3 * self.step_s:.3g} ms, {self.elements} elements "
            f"over {self.seconds:g} s with the winch standing still: the solver's top tension on "
            f"the same elements differs by {self.rms_pct:.2g} % (rms), its peak by "
            f"{self.peak_pct:+.2g} %"
        )


def run_independent_code(
    scene: Scene, step_s: float, max_s: float = math.inf
) -> IndependentResult | str:
    """Run both codes for this time, the solver with this step; or return why it is impossible.

    Raises:
        RopeTwinError: the scene cannot be built or run.
    """
    why = _beyond(scene)
    if why:
        return f"none: the explicit code does not know {why}"
    scenes = [replace(variant(scene, count, step_s), winch=None) for count in ELEMENTS]
    ropes = (_Rope(item) for item in scenes)
    rope = next((item for item in ropes if SHARE * item.largest_step() > SHORTEST_S), None)
    if rope is None:
        return f"none: its steps would be shorter than {1e3 * SHORTEST_S:g} ms"
    scene = rope.scene
    seconds = min(math.ceil(scene.ship.motion_ramp_s + AFTER_RAMP_S), max_s)
    course = MotionWindow(scene, seconds, step_s)
    count = scene.ropes[0].elements
    tension = Trial(course, Setting(count, step_s)).run().tension_n
    inner = math.ceil(step_s / (SHARE * rope.largest_step()))
    exact = rope.run(course.motion(step_s / inner), step_s / inner)[inner - 1 :: inner]
    deviation, scale = tension - exact[: len(tension)], float(tension.std())
    if scale < 1e-4 * tension.mean():
        scale = float(tension.mean())
    return IndependentResult(
        count,
        seconds,
        step_s / inner,
        100.0 * float(np.sqrt(np.mean(deviation**2))) / scale,
        100.0 * float(tension.max() / exact.max() - 1.0),
    )


def _beyond(scene: Scene) -> str:
    """Return the first feature of the scene that the independent code lacks, or ""."""
    line = scene.ropes[0]
    if len(scene.ropes) > 1:
        return "more than one rope"
    if line.rope is None or line.rope.axial_stiffness is not None:
        return "ropes of several sections or with a table of stiffness"
    if line.grading is not None or line.fixed_at_m is not None:
        return "graded elements and fixed lower ends"
    payload = find_payload(scene, line)
    if payload and payload_figures(payload, 1.0).differs_rising:
        return "a payload that rises by other figures than it sinks"
    for effect in scene.effects:
        if isinstance(effect, DragParams) and (
            effect.over_reynolds or effect.over_keulegan_carpenter or not effect.relative
        ):
            return "drag by a table or by the current alone"
        if isinstance(effect, AddedMassParams) and effect.tangential:
            return "added mass along the rope"
        if isinstance(effect, CurrentParams) and effect.over_time:
            return "a current that changes in time"
    unknown = [effect for effect in scene.effects if not isinstance(effect, KNOWN)]
    return f"the effect of {type(unknown[0]).__name__.removesuffix('Params')}" if unknown else ""


class _Rope:
    """Nodes in space, lower end first, (3, nodes); the last one is the hang-off."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        line, water = scene.ropes[0], scene.environment
        model, rope = build(scene), line.rope
        solve_scene_statics(scene, model)
        assert rope is not None
        assert rope.axial_stiffness_n is not None
        count, density = line.elements + 1, water.water_density_kg_per_m3
        self.x = model.state.nodes[rows.POSITION : rows.POSITION + 3, :count].copy()
        self.rest, self.EA = line.length_m / line.elements, rope.axial_stiffness_n
        payload = find_payload(scene, line)
        assert payload is not None
        load = payload_figures(payload, density)
        self.c = section_damping(scene, line, load)[0]
        lump = np.full(count, self.rest)
        lump[[0, -1]] *= 0.5
        d, gravity = rope.hydrodynamic_diameter_m, water.gravity_m_per_s2
        area = 0.25 * math.pi * d * d
        self.per_metre, self.mass = rope.mass_kg_per_m, rope.mass_kg_per_m * lump
        effects = {type(effect): effect for effect in scene.effects}
        drag, added = effects.get(DragParams), effects.get(AddedMassParams)
        self.added = np.zeros(count) if added is None else added.normal * density * area * lump
        self.normal = self.skin = np.zeros(count)
        if drag is not None:
            normal = drag.normal * d if rope.drag_normal is None else rope.drag_normal * rope.diameter_m  # fmt: skip # noqa: E501
            tangential = drag.tangential * d if rope.drag_tangential is None else rope.drag_tangential * rope.diameter_m  # fmt: skip # noqa: E501
            self.normal = 0.5 * density * normal * lump
            self.skin = 0.5 * density * math.pi * tangential * lump
        self.weight = np.zeros(count)
        if WeightParams in effects:
            self.weight = (rope.mass_kg_per_m - density * area) * gravity * lump
        self.weight[0] += (load.mass_kg - density * load.volume_m3) * gravity
        self.payload_mass = load.mass_kg + np.array(load.added_mass_kg)
        self.payload_drag = 0.5 * density * np.array(load.drag_area_m2)
        table = effects[CurrentParams].table if CurrentParams in effects else np.zeros((1, 4))
        self.height, self.flow = table[::-1, 0], table[::-1, 1:].T

    def largest_step(self) -> float:
        """Return the stability limit of the time step [s]."""
        speed = math.sqrt(self.EA / self.per_metre)
        omega, zeta = 2.0 * speed / self.rest, self.c * speed / (self.EA * self.rest)
        return 2.0 / omega * (math.sqrt(1.0 + zeta * zeta) - zeta)

    def run(self, motion: rows.Boundary, h: float) -> Vector:
        """Return the force on the hang-off [N] after each step of h."""
        position, rate = motion.value[:, :3], motion.rate[:, :3]
        acceleration = np.gradient(rate, h, axis=0)
        x, half = self.x, np.zeros_like(self.x)  # velocity half a step before
        last = np.zeros_like(half)
        tension_n = np.zeros(len(position) - 1)
        for step in range(len(position)):
            v = half + 0.5 * h * last
            x[:, -1], v[:, -1] = position[step], rate[step]
            force, tangent = self._forces(x, v)
            if step:
                end_force = force[:, -1] - self._inertia(tangent[:, -1], acceleration[step])
                tension_n[step - 1] = np.sqrt(end_force @ end_force)
            last = self._accelerations(force, tangent)
            half += h * last
            x[:, :-1] += h * half[:, :-1]
        return tension_n

    def _forces(self, x: Vector, v: Vector) -> tuple[Vector, Vector]:
        """Return all forces on the nodes except inertia [N], and the tangents there."""
        gap = np.diff(x)
        length = np.sqrt((gap * gap).sum(axis=0))
        direction = gap / length
        rate = (direction * np.diff(v)).sum(axis=0)
        tension = np.maximum(0.0, (self.EA * (length - self.rest) + self.c * rate) / self.rest)
        tangent = np.empty_like(x)
        tangent[:, 1:-1] = direction[:, 1:] + direction[:, :-1]
        tangent[:, 0], tangent[:, -1] = direction[:, 0], direction[:, -1]
        tangent /= np.sqrt((tangent * tangent).sum(axis=0) + 1e-12)
        u = v.copy()
        for k in range(3):
            u[k] -= np.interp(x[2], self.height, self.flow[k])
        tangential = (u * tangent).sum(axis=0)
        across = u - tangential * tangent
        size = np.sqrt((across * across).sum(axis=0))
        force = -self.normal * size * across - self.skin * np.abs(tangential) * tangential * tangent
        force[2] -= self.weight
        force[:, :-1] += tension * direction
        force[:, 1:] -= tension * direction
        force[:, 0] -= self.payload_drag * np.sqrt(u[:, 0] @ u[:, 0]) * u[:, 0]
        return force, tangent

    def _inertia(self, tangent: Vector, acceleration: Vector) -> Vector:
        """Return the inertia force of the half element at the hang-off, with its added mass [N]."""
        across = acceleration - (acceleration @ tangent) * tangent
        return np.asarray(self.mass[-1] * acceleration + self.added[-1] * across)

    def _accelerations(self, force: Vector, tangent: Vector) -> Vector:
        """Return F/M; M is the rope's mass along the tangent, and includes added mass across it."""
        axial = (force * tangent).sum(axis=0) * tangent
        acceleration: Vector = axial / self.mass + (force - axial) / (self.mass + self.added)
        tau = tangent[:, 0]
        end = np.diag(self.payload_mass + self.mass[0])
        end += self.added[0] * (np.eye(3) - np.outer(tau, tau))
        acceleration[:, 0] = np.linalg.solve(end, force[:, 0])
        acceleration[:, -1] = 0.0
        return acceleration
