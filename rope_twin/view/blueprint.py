"""Layout of the viewer: line profile, tension vs depth, and time histories, from the left."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from rope_twin.view import overview
from rope_twin.view.profile import (
    BENDS,
    FATIGUE,
    GAP,
    HEIGHT,
    PROFILE_WIDTH,
    RANGE_S,
    VIBRATION,
    WIDTH,
)
from rope_twin.view.series import TWIN_TIME, Plot

BACKGROUND = (18, 19, 24)
OVERVIEW, SURFACE, PROFILE, LOG = "overview", "surface", "profile", "diagnostics"
LOWER_END = "lower_end"
# entity, name and colour of each curve
CURVES = (
    ("plots/tension/top", "top", "fde725"),
    ("plots/tension/payload", "payload", "35b7a0"),
    ("plots/heave", "ship heave", "6fa8ff"),
    ("plots/line_out", "line out", "f2a65a"),
    ("plots/real_time_factor", "real-time factor", "c0c0c8"),
)
# error interval of the top tension, only if a run computes one
INTERVAL_CURVES = (
    ("plots/tension/top/low", "lower bound (95 %)", "8d8432"),
    ("plots/tension/top/high", "upper bound (95 %)", "8d8432"),
)
# band of the top tension that was forecast AHEAD_S before, only if a run forecasts
AHEAD_CURVES = (
    ("plots/tension/top/ahead_low", "forecast 10 s ahead, 5 %", "3f8f6b"),
    ("plots/tension/top/ahead_high", "forecast 10 s ahead, 95 %", "3f8f6b"),
)
AHEAD_S, AHEAD_EVERY_S = 10.0, 1.0  # lead that is drawn, and the interval of forecasts
# entity, title and share of the height of each plot
_PLOTS = (
    ("plots/tension/top", "Top tension [kN]", 4),
    ("plots/tension/payload", "Payload tension [kN]", 3),
    ("plots/heave", "Ship heave [m]", 3),
    ("plots/line_out", "Line out [m]", 3),
    ("plots/real_time_factor", "Real-time factor [-]", 3),
)


# entity, title and number of panels of the charts of VIV response and fatigue
_CHARTS = {
    VIBRATION: (VIBRATION, "VIV response vs length below the hang-off [m]", 3),
    FATIGUE: (FATIGUE, "Fatigue damage vs length below the hang-off [m]", 1),
    BENDS: (BENDS, "Bends vs length from the upper end of all rope [m]", 2),
}
LIVE_S = 120.0  # time span of the plots of a live window
Ranges = Mapping[str, tuple[float, float]]
Camera = tuple[list[float], list[float]]  # position and target


@dataclass(frozen=True)
class Shown:
    """Content that is available for display."""

    frame: overview.Frame | None = None  # of the line profile
    close: Camera | None = None  # of the lower end
    upper: Camera | None = None  # of hang-off and sea surface
    plots: tuple[Plot, ...] = ()  # in addition to those that every run has
    ranges: Ranges = field(default_factory=dict)  # axis range by entity; others fit their data
    charts: tuple[str, ...] = ()  # which of VIBRATION, FATIGUE and BENDS have data


def layout(shown: Shown, live: bool) -> Any:
    """Return the blueprint; live: plots span LIVE_S instead of the whole run."""
    import rerun.blueprint as rrb

    camera = None if shown.frame is None else overview.eye(shown.frame)
    left_column = rrb.Vertical(
        _space(OVERVIEW, _profile_title(shown.frame), camera),
        _space(LOWER_END, "Lower end (to scale)", shown.close),
        row_shares=[5, 3],
    )
    upper = shown.upper or overview.Sight().eye()
    below: Any = _space(SURFACE, "Hang-off and sea surface (to scale)", upper)
    if shown.charts:
        charts = (_CHARTS[name] for name in shown.charts)
        below = rrb.Tabs(*(_chart(*chart) for chart in charts), below, active_tab=0)
    title = f"Tension [kN] vs depth [m]; thin lines: min/max of last {RANGE_S:g} s"
    sides, heights = (-0.12 * PROFILE_WIDTH, 1.04 * PROFILE_WIDTH), (-0.05 * HEIGHT, 1.15 * HEIGHT)
    middle = rrb.Vertical(_plane(PROFILE, title, sides, heights), below, row_shares=[5, 4])
    return rrb.Blueprint(
        rrb.Horizontal(left_column, middle, _right(shown, live), column_shares=[23, 34, 43]),
        rrb.TopPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TimePanel(state="collapsed", timeline=TWIN_TIME, play_state="following"),
        auto_views=False,
        auto_layout=False,
    )


def _chart(entity: str, title: str, panels: int) -> Any:
    """Return the panels of a depth chart, side by side."""
    wide = panels * (WIDTH + GAP)
    heights = (-180.0, 1.12 * HEIGHT)
    return _plane(entity, title, (-GAP, wide), heights)


def _plane(entity: str, title: str, x: tuple[float, float], y: tuple[float, float]) -> Any:
    """Return a view in two dimensions of these ranges."""
    import rerun.blueprint as rrb

    bounds = rrb.VisualBounds2D(x_range=x, y_range=y)
    return rrb.Spatial2DView(origin=entity, name=title, background=BACKGROUND, visual_bounds=bounds)


def _space(entity: str, title: str, camera: Camera | None) -> Any:
    """Return a view in three dimensions, from a camera if there is one."""
    import rerun.blueprint as rrb

    eye = None
    if camera is not None:
        eye = rrb.EyeControls3D(position=camera[0], look_target=camera[1], eye_up=(0.0, 0.0, 1.0))
    return rrb.Spatial3DView(
        origin=entity, name=title, background=BACKGROUND, line_grid=False, eye_controls=eye
    )


def _profile_title(frame: overview.Frame | None) -> str:
    if frame is None:
        return "Line profile"
    scale = f"horizontal scale ×{frame.factor}" if frame.factor > 1 else "to scale"
    return f"Line profile ({scale})"


def _right(shown: Shown, live: bool) -> Any:
    """Return the plots that every run has, and in tabs those of quantities that came by name."""
    import rerun.blueprint as rrb

    ranges = shown.ranges
    *plots, speed = [_plot(entity, title, live, ranges.get(entity)) for entity, title, _ in _PLOTS]
    last = rrb.Tabs(speed, rrb.TextLogView(origin=LOG, name="Diagnostics"), active_tab=0)
    shares = [share for _, _, share in _PLOTS]
    usual = rrb.Vertical(*plots, last, row_shares=shares, name="Lift")
    tabs = list(dict.fromkeys(plot.tab for plot in shown.plots))
    if not tabs:
        return usual
    further = []
    for tab in tabs:
        of_tab = [plot for plot in shown.plots if plot.tab == tab]
        views = (_plot(plot.entity, plot.title, live, None, legend=True) for plot in of_tab)
        further.append(rrb.Vertical(*views, name=tab))
    return rrb.Tabs(usual, *further, active_tab=0)


def _plot(
    entity: str, title: str, live: bool, span: tuple[float, float] | None, *, legend: bool = False
) -> Any:
    import rerun as rr
    import rerun.blueprint as rrb

    ago = rrb.TimeRangeBoundary.cursor_relative
    start = ago(seconds=-LIVE_S) if live else rrb.TimeRangeBoundary.infinite()
    shown = rrb.VisibleTimeRange(TWIN_TIME, start=start, end=ago())
    return rrb.TimeSeriesView(
        origin=entity,
        name=title,
        plot_legend=rrb.PlotLegend(visible=legend),
        time_ranges=shown,
        axis_y=rrb.ScalarAxis(range=span) if span else None,
        axis_x=rrb.TimeAxis(view_range=rr.TimeRange(start=start, end=ago())),
    )
