"""Orders of convergence of the top tension in the step and in the element length.

Three measures, since a snap needs them apart: the mean magnitude of the error, its rms, and the
error of the peak. What comes out, and why, is in docs/performance.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.trial import Trial, find_reference
from rope_twin.scene.load import load_scene
from rope_twin.studies.driven_twin import variant
from rope_twin.studies.picture import check_picture, write_picture
from validation.case import Listener, announced
from validation.convergence import slope


@dataclass(frozen=True)
class Sweep:
    """One scene, refined in one of the two."""

    scene: str
    nodes: tuple[int, ...]  # the last is the reference's; one alone: the step is refined
    steps_s: tuple[float, ...]  # likewise
    seconds: float  # simulated

    def __str__(self) -> str:
        """Return the scene, and what is refined."""
        refined = "element length" if len(self.nodes) > 1 else "step"
        return f"{self.scene}, refining its {refined}"


ONE_SNAP_S = 12.0  # of snap_vertical and snap_2km: the first snap, at 6.6 s, and what follows it

_STEPS = (0.04, 0.02, 0.01, 0.005, 0.0025, 0.00125)
FULL = (
    Sweep("smooth_2km", (100,), (*_STEPS, 0.0003125), 60.0),
    Sweep("snap_vertical", (50,), (*_STEPS, 0.00015625), ONE_SNAP_S),
    Sweep("snap_vertical", (250,), (*_STEPS, 0.00015625), ONE_SNAP_S),
    Sweep("snap_2km", (250,), (*_STEPS, 0.00015625), ONE_SNAP_S),
    Sweep("smooth_2km", (25, 50, 100, 200, 400, 1600), (0.01,), 60.0),
    Sweep("snap_vertical", (25, 50, 100, 200, 400, 1600), (0.00125,), ONE_SNAP_S),
    Sweep("snap_2km", (50, 100, 200, 400, 800, 1600, 3200), (0.005,), 60.0),
)
QUICK = (
    Sweep("smooth_2km", (25,), (0.04, 0.02, 0.01, 0.0025), 16.0),
    Sweep("smooth_2km", (20, 40, 80, 320), (0.02,), 16.0),
    Sweep("snap_2km", (25,), (0.02, 0.01, 0.005, 0.00125), ONE_SNAP_S),
)


@dataclass(frozen=True)
class Curve:
    """Errors over sizes, coarse to fine, and the slopes of straight lines through them."""

    scene: str
    refined: str  # "step" or "element"
    held: float  # elements where the step is refined, else the step [s]
    seconds: float
    sizes: tuple[float, ...]  # step [s] or element length [m]
    reference_size: float
    mean_pct: tuple[float, ...]  # mean magnitude, of the reference's standard deviation
    rms_pct: tuple[float, ...]  # likewise
    peak_pct: tuple[float, ...]  # of the reference's maximum, without sign
    mean_order: float
    rms_order: float
    peak_order: float

    @property
    def held_words(self) -> str:
        """Return in words what is not refined."""
        if self.refined == "step":
            return f"{self.held:g} elements"
        return f"{1e3 * self.held:g} ms"


def measure_orders(sweeps: tuple[Sweep, ...], listen: Listener) -> tuple[Curve, ...]:
    """Measure the curve of every sweep.

    Raises:
        RopeTwinError: a scene is not there, or a step of it is not finite.
    """
    return tuple(_curve(sweep) for sweep in announced(sweeps, listen, str))


def _curve(sweep: Sweep) -> Curve:
    reference = find_reference(sweep.scene, sweep.nodes[-1], sweep.steps_s[-1], sweep.seconds)
    by_step = len(sweep.nodes) == 1
    cases = [(nodes, step_s) for nodes in sweep.nodes for step_s in sweep.steps_s][:-1]
    length = load_scene(sweep.scene).ropes[0].length_m
    sizes = tuple(step_s if by_step else length / nodes for nodes, step_s in cases)
    errors = []
    for nodes, step_s in cases:
        trial = Trial(variant(load_scene(sweep.scene), nodes, step_s), sweep.seconds)
        errors.append(reference.errors(trial.run().tension_n, step_s))
    mean, rms = tuple(row.mean_pct for row in errors), tuple(row.rms_pct for row in errors)
    peak = tuple(abs(row.peak_pct) for row in errors)
    return Curve(
        scene=sweep.scene,
        refined="step" if by_step else "element",
        held=sweep.nodes[0] if by_step else sweep.steps_s[0],
        seconds=sweep.seconds,
        sizes=sizes,
        reference_size=reference.step_s if by_step else length / reference.nodes,
        mean_pct=mean,
        rms_pct=rms,
        peak_pct=peak,
        mean_order=slope(sizes, mean),
        rms_order=slope(sizes, rms),
        peak_order=slope(sizes, peak),
    )


_COLOURS = {"smooth_2km": "#0072b2", "snap_vertical": "#d55e00", "snap_2km": "#009e73"}
_MEASURES = (("mean_pct", "o-", "mean"), ("rms_pct", "s--", "rms"), ("peak_pct", "^:", "peak"))
SLOPES_FROM_PCT = 100.0  # right ends of the lines to compare with
_PANELS = (("step", 1e3, "step [ms]"), ("element", 1.0, "element length [m]"))


def draw_orders(curves: tuple[Curve, ...], path: Path) -> None:
    """Write the plot: steps on the left, element lengths on the right.

    Raises:
        InputError: it cannot be written there.
    """
    check_picture(path)
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 7.0), layout="constrained")
    steps_axes, right = figure.subplots(1, 2, sharey=True)
    for axes, (refined, scale, label) in zip((steps_axes, right), _PANELS, strict=True):
        chosen = [curve for curve in curves if curve.refined == refined]
        for curve in chosen:
            _draw(axes, curve, scale)
        axes.set_xlabel(label)
        axes.grid(True, which="both", linewidth=0.3)
        if chosen:
            _draw_slopes(axes, chosen, scale)
            axes.legend(fontsize=7, ncols=2, loc="upper center", bbox_to_anchor=(0.5, -0.12))
    steps_axes.set_ylabel("error of the top tension [%]")
    figure.suptitle(
        "Error under refinement; mean and rms of the standard deviation, peak of itself"
    )
    write_picture(figure, path, 110)


def _draw(axes: Any, curve: Curve, scale: float) -> None:
    sizes = [scale * size for size in curve.sizes]
    for field, style, name in _MEASURES:
        if curve.scene == "smooth_2km" and name == "mean":
            continue  # the same line as its rms
        order = getattr(curve, field.replace("_pct", "_order"))
        axes.loglog(
            sizes,
            getattr(curve, field),
            style,
            color=_COLOURS.get(curve.scene, "black"),
            alpha=0.5 if curve.scene == "snap_vertical" and curve.held == 50 else 1.0,
            markersize=4,
            linewidth=1.2,
            label=f"{curve.scene}, {curve.held_words}: {name}, order {order:.1f}",
        )


def _draw_slopes(axes: Any, curves: list[Curve], scale: float) -> None:
    """Draw ticks at the sizes, and lines of order 1 and 2 for comparison."""
    sizes = sorted({scale * size for curve in curves for size in curve.sizes})
    low, high = sizes[0], sizes[-1]
    for order in (1, 2):
        bottom = SLOPES_FROM_PCT * (low / high) ** order
        axes.loglog([low, high], [bottom, SLOPES_FROM_PCT], color="0.5", linewidth=0.8)
        axes.annotate(f"order {order}", (low, bottom), fontsize=8, color="0.3", va="bottom")
    axes.set_xticks(sizes, [f"{size:g}" for size in sizes])
    axes.set_xticks([], minor=True)
