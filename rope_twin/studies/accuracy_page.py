"""Report of a convergence study, as tables on the console and as a page of Markdown."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rope_twin.scene.error_bound import PEAK, RMS, Setting, StudyLevel, format_bound
from rope_twin.scene.lift import lift_figures
from rope_twin.scene.rigging import is_joined
from rope_twin.scene.vortex import model_beside, vortex_words
from rope_twin.studies.accuracy_run import QUANTITIES, STILL
from rope_twin.studies.accuracy_study import FORMAL_ORDER, ReferenceUncertainty, Study, page_table
from rope_twin.studies.accuracy_within import cheapest_within
from rope_twin.studies.picture import check_picture, mark_decades, new_figure, write_picture

Table = list[list[str]]  # the first row is the head
HEADS = {
    RMS: "rms %", "tension_mean": "mean %", "tension_std": "std %", PEAK: "highest %",
    "tension_trough": "lowest %", "snap_peak": "snaps %", "payload_depth": "depth m",
    "slack_share": "slack %",
}  # fmt: skip
TARGETS_PCT = (5.0, 1.0, 0.1)
_PAGE = """\
# {name}: what accuracy costs

{about}

{summary}

![Error of the top tension over the real-time factor, a point for each setting]({picture})

Errors of the first {seconds:g} s of `rope_twin run {name} --speed 0` against a run of {reference};
the reference's uncertainty counts in: what lies below it reads ≤. rms, std and lowest are in per
cent of the top tension's standard deviation{still}, mean and highest of themselves, snaps (mean of
the snaps' peaks) likewise, depth is the payload's in metres (rms), slack in points of time. Times
real time: the step alone on {machine}.{met}

{rows}

## The reference

{doubts}

{notes}

How to read this, and what it does not contain: docs/accuracy.md. Made by
`rope_twin accuracy {name}`; digest of the scene {scene_digest}, solver version {solver}.
"""


def as_markdown(study: Study, content: dict[str, object], picture: str) -> str:
    """Return the page; `content` is the study as in its JSON file."""
    mean_remark = " (here of its mean, since nothing moves)" if is_still(study) else ""
    of_which = ""
    if is_joined(study.scene):
        of_which = (
            f" Top tension and elements are those of `{study.scene.ropes[0].name}`; the other "
            "ropes'\nelements follow in proportion."
        )
    return _PAGE.format(
        name=study.scene.name,
        about=f"{study.scene.about}.",
        summary="\n".join(f"- {line}" for line in summary(study)),
        picture=picture,
        seconds=study.plan.seconds,
        reference=study.reference.setting,
        still=mean_remark,
        machine=study.machine.as_text(),
        met=of_which,
        rows=page_table(row_table(study)),
        doubts=page_table(doubt_table(study)),
        notes="\n".join(f"- {line}" for line in notes(study)),
        scene_digest=content["scene_digest"],
        solver=content["solver"],
    )


def is_still(study: Study) -> bool:
    """Return whether the top tension is almost constant."""
    tension = study.reference.series.tension_n
    return float(tension.std()) <= STILL * abs(float(tension.mean()))


def summary(study: Study) -> list[str]:
    """Return the conclusions of the study in a few sentences."""
    lines = []
    level = study.own
    if level is not None:
        lines.append(
            f"As the scene is, {level.setting}: top tension {_bound(level, RMS, study)} rms and "
            f"{_bound(level, PEAK, study)} at its highest, at {level.real_time_factor:.0f} times "
            "real time."
        )
    selections: dict[Setting, tuple[StudyLevel, list[str]]] = {}
    for target in TARGETS_PCT:
        row = cheapest_within(study.rows, RMS, target)
        if row is not None:
            selections.setdefault(row.setting, (row, []))[1].append(f"{target:g} %")
        elif study.reference.doubts[RMS].uncertainty is not None:
            lines.append(f"No setting is within {target:g} % rms.")
    for row, (*first, last) in selections.values():
        targets = f"{', '.join(first)} and {last}" if first else last
        lines.append(
            f"Within {targets} rms the cheapest is {row.setting}: "
            f"{row.real_time_factor:.0f} times real time."
        )
    return lines


def notes(study: Study) -> list[str]:
    """Return notes on non-convergence, the independent code, VIV, and failed runs."""
    lines, scene = [f"Independent check: {study.independent}."], study.scene
    if vortices := "" if is_joined(scene) else vortex_words(scene, lift_figures(scene)):
        if model_beside(scene) is None:
            vortices = (
                f"{vortices.removesuffix('.')}. The errors above are of the tension and the "
                "payload: what is coarser than that does not tell how the rope vibrates."
            )
        lines.append(vortices)
    for quantity in QUANTITIES:
        doubt = study.reference.doubts[quantity.name]
        if doubt.uncertainty is None:
            lines.append(f"{quantity.name} does not converge: {_spread(quantity.name, doubt)}.")
    line = scene.ropes[0]
    if study.reference.series.slack.any() and line.damping.newton_seconds == 0.0:
        lines.append(
            "The rope falls slack and has no damping: a snap's height then has no limit of its own "
            "but that which the solver's dissipation sets."
        )
    return lines + [f"Not run: {failure}" for failure in study.failures]


def row_table(study: Study) -> Table:
    """Return a line per accuracy level, with the scene's own marked."""
    table = [["elements", "step ms", "× real time", "MB", *HEADS.values()]]
    for row in study.rows:
        setting = row.setting
        mark = " *" if setting == study.plan.own else ""
        newtons = setting.tolerance_n
        tolerance = f", tol. {float(f'{newtons:.3g}'):g} N" if newtons else ""
        table.append(
            [
                f"{setting.elements}{mark}",
                f"{1e3 * setting.step_s:g}{tolerance}",
                f"{row.real_time_factor:.0f}",
                f"{row.memory_mb:.2g}",
                *(shown(row, name) for name in HEADS),
            ]
        )
    return table


def doubt_table(study: Study) -> Table:
    """Return a line per quantity: orders of convergence and uncertainty of the reference."""
    table = [["quantity", "order in elements", "order in steps", "uncertainty"]]
    for quantity in QUANTITIES:
        doubt = study.reference.doubts[quantity.name]
        if quantity.name == "snap_peak" and study.reference.values["snap_peak_n"] is None:
            continue
        known = doubt.uncertainty is not None
        bounds = f"± {doubt.uncertainty:.2g} {quantity.unit}" if known else "does not converge"
        orders = [_order(doubt.element_order), _order(doubt.step_order)]
        table.append([quantity.words, *orders, bounds])
    return table


def shown(row: StudyLevel, name: str) -> str:
    """Return a cell: the error, its bound if it is below the uncertainty, or a value."""
    error, at_most = row.figures[name].error, row.figures[name].at_most
    if error is None or at_most is None:
        value = row.values.get({PEAK: "tension_max_n", "snap_peak": "snap_peak_n"}.get(name, ""))
        return "–" if value is None else f"{1e-3 * value:.1f} kN"
    if at_most == 0.0:
        return "0"
    if abs(error) <= at_most - abs(error):
        return f"≤ {format_bound(at_most)}"
    sign = "" if name in (RMS, "payload_depth") else "+"
    return f"{error:{sign}.2g}"


def _bound(row: StudyLevel, name: str, study: Study) -> str:
    at_most = row.figures[name].at_most
    if at_most is None:
        return f"does not converge ({_spread(name, study.reference.doubts[name])})"
    return f"within {format_bound(at_most)} %"


def _spread(name: str, doubt: ReferenceUncertainty) -> str:
    if doubt.spread is None:
        return "it is not there on every grid"
    low, high = doubt.spread
    if name == "payload_depth":
        return f"the reference's grids differ by {low:.2g} to {high:.2g} m"
    if name == RMS:
        return f"the reference's grids differ by {low:.2g} to {high:.2g} %"
    if name == "slack_share":
        return f"{100.0 * low:.3g} to {100.0 * high:.3g} % of the time over the reference's grids"
    return f"{1e-3 * low:.4g} to {1e-3 * high:.4g} kN over the reference's grids"


def _order(order: float | None) -> str:
    if order is None:
        return "–"
    return f"> {FORMAL_ORDER:g}" if order > FORMAL_ORDER + 0.5 else f"{order:.1f}"


MARKERS = ("o", "s", "D", "^", "v", "P")  # the shorter the step, the earlier
PANELS = ((RMS, "rms [% of std]"), (PEAK, "highest [%]"))
MIN_PCT = 1e-6


def draw_accuracy(study: Study, path: Path) -> None:
    """Write the plot: rms error on the left, error of the maximum tension on the right.

    Raises:
        InputError: matplotlib is not there, or the file cannot be written.
    """
    check_picture(path)
    figure = new_figure(10.0, 4.6)
    panels = figure.subplots(1, 2)
    for axes, (name, label) in zip(panels, PANELS, strict=True):
        _draw_panel(axes, study, name)
        axes.set_ylabel(f"error of the top tension, {label}")
        axes.set_xlabel("times real time (faster →)")
    handles, labels = panels[0].get_legend_handles_labels()
    if not handles:
        handles, labels = panels[1].get_legend_handles_labels()
    if handles:
        figure.legend(handles, labels, loc="outside right upper", fontsize=7, frameon=False)
    name, seconds = study.scene.name, study.plan.seconds
    figure.suptitle(f"{name}: what accuracy costs (first {seconds:g} s, one core)", fontsize=11)
    write_picture(figure, path, 90)


def _draw_panel(axes: Any, study: Study, name: str) -> None:
    doubt = study.reference.doubts[name].uncertainty
    rows = [row for row in study.rows if row.newton_tolerance_n is None]
    if doubt is None or is_still(study):
        text = "does not converge:\nsee the spread in the study" if doubt is None else (
            "nothing moves:\nevery setting is right to round-off"
        )  # fmt: skip
        axes.text(0.5, 0.5, text, ha="center", va="center", transform=axes.transAxes)
        axes.set_xticks([])
        axes.set_yticks([])
        return
    axes.set_xscale("log")
    axes.set_yscale("log")
    _draw_levels(axes, rows, name)
    _draw_front(axes, rows, name)
    level = study.own
    if level is not None:
        axes.plot(level.real_time_factor, _height(level, name), "o", markersize=14,
                  fillstyle="none", color="crimson", markeredgewidth=1.8, linestyle="", label="the scene as it is")  # fmt: skip # noqa: E501
    low, high = axes.get_ylim()
    bottom = min(low, 0.5 * max(doubt, MIN_PCT))
    axes.axhspan(bottom, max(doubt, MIN_PCT), color="0.85", zorder=0,
                 label="reference's uncertainty")  # fmt: skip
    axes.set_ylim(bottom, high)
    mark_decades(axes)
    axes.grid(True, which="major", linewidth=0.3)


def _draw_levels(axes: Any, rows: list[StudyLevel], name: str) -> None:
    """Draw a line for each number of elements, with a marker for each time step."""
    from matplotlib import colormaps

    counts = sorted({row.elements for row in rows})
    steps = sorted({row.step_s for row in rows})
    for number, count in enumerate(counts):
        colour = colormaps["viridis"](0.92 * number / max(len(counts) - 1, 1))
        levels = sorted(
            (row for row in rows if row.elements == count),
            key=lambda row: row.step_s,
        )
        points = [(row.real_time_factor, _height(row, name)) for row in levels]
        axes.plot(
            *zip(*points, strict=True), color=colour, linewidth=0.9, label=f"{count} elements"
        )
        for row, (x, y) in zip(levels, points, strict=True):
            axes.plot(x, y, MARKERS[steps.index(row.step_s) % len(MARKERS)], color=colour,
                      markersize=5)  # fmt: skip
    for number, step_s in enumerate(steps):
        axes.plot([], [], MARKERS[number % len(MARKERS)], color="0.4", markersize=5,
                  label=f"{1e3 * step_s:g} ms")  # fmt: skip


def _draw_front(axes: Any, rows: list[StudyLevel], name: str) -> None:
    """Draw the Pareto front of error and speed."""
    ordered = sorted(rows, key=lambda row: -row.real_time_factor)
    front: list[tuple[float, float]] = []
    for row in ordered:
        if not front or _height(row, name) < front[-1][1]:
            front.append((row.real_time_factor, _height(row, name)))
    axes.step(*zip(*front, strict=True), where="pre", color="black", linewidth=2.5, alpha=0.25,
              label="best for the cost")  # fmt: skip


def _height(row: StudyLevel, name: str) -> float:
    at_most = row.figures[name].at_most
    return max(MIN_PCT, MIN_PCT if at_most is None else at_most)
