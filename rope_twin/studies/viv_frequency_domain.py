"""VIV assessment in the frequency domain: lock-in zones, VIV response and fatigue damage.

The modal response (rope_twin.vortex.modal_response) is about the static equilibrium in the scene's
current: tension, mass with added mass, and normal flow velocity. The motion is normal to the plane
of current and rope, for which a sagging rope is a string of its own length (Irvine 1981, ch. 3).

In a multi-line scene each line is assessed by itself, with its shape and tension in the equilibrium
of all; a line is a rope, or ropes that continue each other (rope_twin.vortex.line_model).
Connections are held across the line. Of a line that lies on the seabed in part, the longest
suspended part is assessed, held where it touches down.

Drag is amplified by 1 + 1.043·(2·rms/d)^0.65 (Vandiver 1983). Bending strain is d/2·y″, that of the
outermost fibre of a section that stays plane. Stress is that of bending, E·d/2·y″ with E = EA over
the metal area: an upper bound for a stranded rope, whose wires slide. A rope with the bending
stiffness of a pipe of its diameter, EI/EA = (d² + d_i²)/16, is treated as a pipe, with its metal
area. Damage is counted by rainflow of the bending stress alone; the tension is static.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rope_twin.core import state as rows
from rope_twin.core.joined.joints import System
from rope_twin.core.state import Floats
from rope_twin.effects.bending import BendingParams
from rope_twin.effects.current import CurrentParams
from rope_twin.effects.payload import Payload, TwoWayPayload
from rope_twin.effects.rope_in_air import WettingParams
from rope_twin.effects.rope_mass import AddedMassParams
from rope_twin.errors import SceneError
from rope_twin.scene.grid import ends_m
from rope_twin.scene.rigging import is_joined, refuse_body
from rope_twin.scene.schema import Scene
from rope_twin.studies.equilibrium import (
    bring_system_to_rest,
    bring_to_rest,
    lying,
    node_diameters,
    per_metre,
    speed_across,
    water_at,
)
from rope_twin.vortex.drag_amplification import amplified_drag
from rope_twin.vortex.fatigue import StressCurve, damage_of_series, metal_area
from rope_twin.vortex.line_model import Span, line_model, lines_of, one_rope, wetted_shares
from rope_twin.vortex.modal_response import ModalResponse
from rope_twin.vortex.shedding import Shedding

YEAR_S = 365.25 * 86400.0
STEADY = 0.5  # of a run: the part that statistics are taken of
RECORDED = 3  # times as often as the response needs its amplitude
PLACES = 240  # at most, that stress and damage are counted at
AT_REST_FRACTION = 1e-2  # of the largest motion: what moves less is as good as at rest


@dataclass(frozen=True)
class FrequencyDomainRun:
    """A response over time; places from the lower end up."""

    scene: SceneSpan
    response: ModalResponse
    time_s: Floats  # (times,)
    coordinate: Floats  # of the modes [m], (times, modes)
    from_top_m: Floats  # unstretched, of the places

    @property
    def first(self) -> int:
        """Return the index of the first steady time."""
        return int((1.0 - STEADY) * len(self.time_s))

    def motion(self, places: Floats | None = None) -> Floats:
        """Return the steady motion over the diameter, (times, places), at all or some places by
        number.
        """
        shape, diameter = self.response.modes.shape, self.response.span.diameter
        if places is not None:
            nodes = places.astype(int)
            shape, diameter = shape[nodes], diameter[nodes]
        return np.asarray(self.coordinate[self.first :] @ shape.T / diameter)

    @property
    def covariance(self) -> Floats:
        """Return the covariance of the steady modal coordinates [m²], (modes, modes)."""
        steady = self.coordinate[self.first :]
        steady = steady - steady.mean(axis=0)
        return np.asarray(steady.T @ steady / len(steady))

    def rms(self) -> Floats:
        """Return the RMS of the motion over the diameter, (places,)."""
        shape = self.response.modes.shape
        square = np.einsum("pm,mn,pn->p", shape, self.covariance, shape, optimize=True)
        return np.asarray(np.sqrt(np.maximum(square, 0.0)) / self.response.span.diameter)

    @property
    def growth(self) -> float:
        """Return the RMS of all modes in the second half of the steady time over the first.

        1: settled; above, the response still builds up from rest. NaN: no mode moves.
        """
        steady = self.coordinate[self.first :]
        middle = len(steady) // 2
        early, late = (float(part.var(axis=0).sum()) for part in (steady[:middle], steady[middle:]))
        return float(np.sqrt(late / early)) if early > 0.0 else float("nan")

    def frequency_hz(self) -> Floats:
        """Return the mean frequency rms(ẏ)/rms(y)/2π of the motion, by modes; 0 without motion."""
        shape = self.response.modes.shape
        variance = np.diag(self.covariance)
        square = shape**2 @ variance
        rate = shape**2 @ (variance * self.response.frequency**2)
        moves = square > 1e-12 * square.max(initial=1e-300)
        return np.sqrt(np.where(moves, rate / np.where(moves, square, 1.0), 0.0))

    def drag_amplification(self) -> Floats:
        """Return the amplification of the normal drag coefficient (Vandiver 1983)."""
        return amplified_drag(self.rms())

    def spectra(self, places: Floats) -> tuple[Floats, Floats]:
        """Return frequencies [Hz] and power of the motion per Hz [d²/Hz], (frequencies, places)."""
        from scipy.signal import welch

        motion = self.motion(places)
        step = float(self.time_s[1] - self.time_s[0])
        length = max(16, min(len(motion), len(motion) // 2))
        spectra: tuple[Floats, Floats] = welch(motion, fs=1.0 / step, nperseg=length, axis=0)
        return spectra

    @property
    def modal_rms(self) -> Floats:
        """Return the RMS of each mode over the mean diameter."""
        mean = float(self.response.span.diameter.mean())
        return np.asarray(np.sqrt(np.diag(self.covariance)) / mean)


@dataclass(frozen=True)
class Fatigue:
    """Strain, stress and damage of bending at places of the run."""

    from_top_m: Floats
    strain_rms: Floats
    stress_rms_pa: Floats  # NaN where the rope is not all of steel
    damage_per_year: Floats  # Miner's sum; NaN likewise


def run_frequency_domain(
    scene_span: SceneSpan, shedding: Shedding, duration_s: float
) -> FrequencyDomainRun:
    """Compute the VIV response of a line from rest for a given time."""
    response = ModalResponse(scene_span.span, shedding)
    step = min(response.step_s / RECORDED, duration_s / 16.0)
    count = int(np.ceil(duration_s / step))
    coordinate = np.zeros((count, len(response.frequency)))
    for row in range(count):
        response.advance(step)
        coordinate[row] = response.coordinate
    time_s: Floats = np.asarray(step * np.arange(1.0, count + 1.0), dtype=np.float64)
    from_top = np.interp(response.span.s, scene_span.span.s, scene_span.unstretched)
    return FrequencyDomainRun(scene_span, response, time_s, coordinate, from_top)


def most_moved(run: FrequencyDomainRun, count: int) -> Floats:
    """Return the numbers of the modes with the largest motion, at most `count`, in rising order."""
    rms = run.modal_rms
    largest = np.argsort(-rms, kind="stable")[:count]
    return np.sort(largest[rms[largest] > AT_REST_FRACTION * rms.max(initial=0.0)])


def where_it_moves(frequency_hz: Floats, rms: Floats) -> Floats:
    """Return frequencies for pictures, NaN where the motion is negligible."""
    return np.where(rms > AT_REST_FRACTION * rms.max(initial=0.0), frequency_hz, np.nan)


def chosen_places(run: FrequencyDomainRun, most: int = PLACES) -> Floats:
    """Return the numbers of a limited number of equally spaced places."""
    last = len(run.response.span.s) - 1
    count = min(most, last + 1)
    return np.unique(np.linspace(0.0, last, count).round())


def count_fatigue(run: FrequencyDomainRun, scene: Scene, curve: StressCurve) -> Fatigue:
    """Return bending strain and stress of the steady part of the run, and the damage per year."""
    places = chosen_places(run)
    nodes = places.astype(int)
    s = run.response.span.s
    mode_curvature = np.gradient(np.gradient(run.response.modes.shape, s, axis=0), s, axis=0)
    radius, per_curvature = _per_curvature(run, scene, nodes)
    curvature = run.coordinate[run.first :] @ mode_curvature[nodes].T
    stress = curvature * per_curvature
    known = np.isfinite(per_curvature)
    damage = np.full(len(nodes), np.nan)
    damage[known] = damage_of_series(stress[:, known], curve.used)
    lasted = float(run.time_s[-1] - run.time_s[run.first])
    rms = np.where(known, stress.std(axis=0), np.nan)
    strain = radius * curvature.std(axis=0)
    return Fatigue(run.from_top_m[nodes], strain, rms, damage * YEAR_S / lasted)


def _per_curvature(
    run: FrequencyDomainRun, scene: Scene, nodes: np.ndarray
) -> tuple[Floats, Floats]:
    """Return d/2 [m] and E·d/2 [Pa·m] at places, the latter NaN where it is not solid steel."""
    figures: list[tuple[float, float]] = []
    ends: list[float] = []  # of the sections, from the lower end of the line
    low_m = 0.0
    for number, length_m in zip(run.scene.ropes, run.scene.lengths_m, strict=True):
        line = scene.ropes[number]
        for section, end_m in zip(line.made_of, ends_m(line), strict=True):
            rope = section.rope
            area = metal_area(rope, run.response.span.stiffness)
            radius = 0.5 * rope.diameter_m
            figures.append((radius, rope.tangent_n(0.0) / area * radius))
            ends.append(low_m + min(end_m, length_m))
        low_m += length_m
    below = sum(run.scene.lengths_m) - run.from_top_m[nodes]
    index = np.searchsorted(ends, below, side="left")
    at_places = np.array(figures)[np.minimum(index, len(figures) - 1)]
    return at_places[:, 0], at_places[:, 1]


@dataclass(frozen=True)
class SceneSpan:
    """A line of a scene, and where it lies."""

    span: Span
    place: Floats  # of its nodes, from the lower end up [m], (3, nodes)
    unstretched: Floats  # from its upper end [m], (nodes,)
    ropes: tuple[int, ...]  # their numbers, from its lower end up
    lengths_m: tuple[float, ...]  # of these ropes, unstretched


def spans_of(scene: Scene) -> list[SceneSpan]:
    """Return the line models of all lines of a scene in static equilibrium.

    Raises:
        SceneError: no current, no static equilibrium, or a slack rope.
    """
    refuse_body(scene, "lines that end at a body which swings by itself are not assessed in modes")
    if not is_joined(scene):
        return [span_of(scene)]
    _check_current(scene)
    system = bring_system_to_rest(scene).system
    return [_span_in(scene, system, numbers) for numbers in lines_of(system)]


def _span_in(scene: Scene, system: System, numbers: tuple[int, ...]) -> SceneSpan:
    """Return the line model of some ropes of a system in static equilibrium."""
    ropes = [system.ropes[r] for r in numbers]
    rope = one_rope(ropes)
    n = int(rope.state.counts[rows.ELEMENTS])
    s = rope.state.s[: n + 1]
    position = rope.state.nodes[rows.POSITION : rows.POSITION + 3, : n + 1].copy()
    span = line_model(rope)._replace(speed=speed_across(scene, position))
    if span.end_mass is not None:
        x, y, _ = _across(scene, position) ** 2
        loads = [effect for effect in rope.effects if isinstance(effect, Payload | TwoWayPayload)]
        end_mass = sum(x * load.Mx + y * load.My for load in loads) / (x + y)
        span = span._replace(end_mass=float(end_mass))
    lengths_m = tuple(float(item.state.s[item.state.counts[rows.ELEMENTS]]) for item in ropes)
    whole = SceneSpan(span, position, s[-1] - s, numbers, lengths_m)
    return _suspended(scene, whole, lying(rope, position))


def span_of(scene: Scene) -> SceneSpan:
    """Return the line model of a scene of one rope in static equilibrium.

    Raises:
        SceneError: a multi-line system, no current, no static equilibrium, or a slack rope.
    """
    _check_current(scene)
    rest = bring_to_rest(scene)
    steps = np.diff(rest.place, axis=1)
    length = np.sqrt((steps * steps).sum(axis=0))
    unstretched = np.concatenate([[0.0], np.cumsum(rest.rest)])
    mass, volume = per_metre(rest)
    added: float | Floats = sum(p.normal for p in scene.effects if isinstance(p, AddedMassParams))
    if scene.listed(WettingParams) is not None:
        added = added * wetted_shares(rest.place[2])
    density = scene.environment.water_density_kg_per_m3
    stretch = length / rest.rest
    span = Span(
        s=np.concatenate([[0.0], np.cumsum(length)]),
        tension=rest.tension,
        mass=(mass + added * density * volume) / stretch,
        diameter=node_diameters(rest),
        speed=speed_across(scene, rest.place),
        stiffness=sum(p.stiffness_n_m2 for p in scene.effects if isinstance(p, BendingParams)),
    )
    if rest.first == 0:
        normal = _across(scene, rest.place)
        end_mass = float(normal @ rest.mass[0] @ normal)
        span = span._replace(end_mass=max(end_mass - float(span.node_mass[0]), 0.0))
    length_m = float(unstretched[-1])
    whole = SceneSpan(span, rest.place, length_m - unstretched, (0,), (length_m,))
    return _suspended(scene, whole, rest.lies)


def _suspended(scene: Scene, whole: SceneSpan, lies: NDArray[np.bool_]) -> SceneSpan:
    """Return the longest suspended part of a line, held where it touches down.

    lies: whether each node is on the seabed, (nodes,).

    Raises:
        SceneError: all of it lies there.
    """
    if not lies.any():
        return whole
    if lies.all():
        problem = "the whole line lies on the seabed, where it does not vibrate"
        raise SceneError(f"{scene.path}: ropes[{whole.ropes[0]}]", problem, "give less rope")
    borders = np.flatnonzero(np.diff(np.concatenate([[1], lies, [1]])))
    parts = [(max(low - 1, 0), min(high, len(lies) - 1)) for low, high in borders.reshape(-1, 2)]
    first, last = max(parts, key=lambda part: whole.span.s[part[1]] - whole.span.s[part[0]])
    nodes, elements, span = slice(first, last + 1), slice(first, last), whole.span
    span = span._replace(
        s=span.s[nodes] - span.s[first], tension=span.tension[elements], mass=span.mass[elements],
        diameter=span.diameter[nodes], speed=span.speed[nodes],
        end_mass=None if first > 0 or lies[0] else span.end_mass,
    )  # fmt: skip
    place, unstretched = whole.place[:, nodes], whole.unstretched[nodes]
    return replace(whole, span=span, place=place, unstretched=unstretched)


def _check_current(scene: Scene) -> None:
    if not any(isinstance(params, CurrentParams) for params in scene.effects):
        problem = "no current, so no vortices"
        raise SceneError(f"{scene.path}: effects", problem, "add the effect 'current'")


def _across(scene: Scene, position: Floats) -> Floats:
    """Return the unit vector normal to line and current at the lower end; position: (3, nodes)."""
    water = water_at(scene, position[2]).sum(axis=1)
    normal = np.cross(water, position[:, 1] - position[:, 0])
    size = float(np.linalg.norm(normal))
    return normal / size if size > 0.0 else np.array([0.0, 1.0, 0.0])
