"""Orders of convergence as a plot: error over size, both logarithmic (needs matplotlib)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from benchmarks.orders import Curve
from rope_twin.studies.picture import check_picture, write_picture

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
    left, right = figure.subplots(1, 2, sharey=True)
    for axes, (refined, scale, label) in zip((left, right), _PANELS, strict=True):
        own = [curve for curve in curves if curve.refined == refined]
        for curve in own:
            _draw(axes, curve, scale)
        axes.set_xlabel(label)
        axes.grid(True, which="both", linewidth=0.3)
        if own:
            _draw_slopes(axes, own, scale)
            axes.legend(fontsize=7, ncols=2, loc="upper center", bbox_to_anchor=(0.5, -0.12))
    left.set_ylabel("error of the top tension [%]")
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
