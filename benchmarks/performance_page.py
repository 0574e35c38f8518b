"""Speed and orders as tables, and as the page docs/performance.md."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from benchmarks.ensemble_speed import EnsembleRow, ensemble_table
from benchmarks.orders import Curve
from benchmarks.speed import FIT_FROM, Basis, Row, Speed
from rope_twin.core.jit.wide import LANES
from rope_twin.studies.accuracy_study import page_table

PICTURE = Path("images") / "orders.png"
Table = list[list[str]]  # the first row is the head
# Of a node and a smooth step, which is two stages of one correction: to load it (tangent, drag, and
# the root of a stiffness), to stretch its element before and after, to eliminate it.
ROOTS, DIVISIONS = 2 * (3 + 2), 2 * (2 + 2 + 1)

TEMPLATE = Path(__file__).with_name("performance.md")


def as_markdown(speed: Speed, curves: Sequence[Curve], ensembles: Sequence[EnsembleRow]) -> str:
    """Return the page."""
    return TEMPLATE.read_text("utf-8").format(
        machine=speed.machine.as_text() + ".",
        seconds=speed.seconds,
        speed=page_table(speed_table(speed.rows)),
        snaps=page_table(speed_table(speed.snaps)),
        exponents=exponent_words(speed),
        basis=page_table(basis_table(speed.references)),
        picture=PICTURE.as_posix(),
        orders=page_table(order_table(curves)),
        ensembles=page_table(ensemble_table(ensembles)),
        lanes=LANES,
        roots=ROOTS,
        divisions=DIVISIONS,
    )


def speed_table(rows: Sequence[Row]) -> Table:
    """Return a line per case."""
    head = [
        "scene", "nodes", "step ms", "ns/node/step", "× real time", "rms %", "peak %", "trough %",
        "longest ms", "solves", "substeps", "cpu %",
    ]  # fmt: skip
    return [head] + [
        [
            row.scene,
            str(row.nodes),
            f"{1e3 * row.step_s:g}",
            f"{row.ns_per_node_step:.1f} ({row.ns_per_node_step_best:.1f})",
            f"{row.real_time_factor:.0f} ({row.real_time_factor_best:.0f})",
            f"{row.error_pct:.3g}",
            f"{row.peak_error_pct:+.3f}",
            f"{row.trough_error_pct:+.3f}",
            "" if row.longest_step_s is None else f"{1e3 * row.longest_step_s:.3f}",
            f"{row.solves_per_step:.2f}",
            f"{row.substeps_max}" + (f", {row.unconverged} bad" if row.unconverged else ""),
            f"{100.0 * row.processor_share:.0f}",
        ]
        for row in rows
    ]


def basis_table(references: Sequence[Basis]) -> Table:
    """Return a line per reference."""
    head = [
        "reference", "nodes", "step ms", "mean kN", "max kN", "min kN", "rms ± %", "peak ± %",
    ]  # fmt: skip
    return [head] + [
        [
            basis.scene,
            str(basis.nodes),
            f"{1e3 * basis.step_s:g}",
            *(f"{1e-3 * value:.3f}" for value in (basis.mean_n, basis.max_n, basis.min_n)),
            f"{basis.doubt.rms_pct:.2g}",
            f"{abs(basis.doubt.peak_pct):.2g}",
        ]
        for basis in references
    ]


def order_table(curves: Sequence[Curve]) -> Table:
    """Return a line per sweep."""
    head = ["scene", "held", "refined", "mean", "rms", "peak", "rms %", "peak %"]
    return [head] + [
        [
            f"{curve.scene}, {curve.seconds:g} s",
            curve.held_words,
            _span(curve),
            *(f"{order:.2f}" for order in (curve.mean_order, curve.rms_order, curve.peak_order)),
            f"{curve.rms_pct[0]:.2g} to {curve.rms_pct[-1]:.2g}",
            f"{curve.peak_pct[0]:.2g} to {curve.peak_pct[-1]:.2g}",
        ]
        for curve in curves
    ]


def exponent_words(speed: Speed) -> str:
    """Return in words how the cost grows with the number of nodes."""
    exponents = [
        f"N^{power:.3f} at {1e3 * float(step_s):g} ms" for step_s, power in speed.exponents.items()
    ]
    largest = max(row.nodes for row in speed.rows)
    listed = " and ".join(exponents)
    return f"Cost of a step from {FIT_FROM} to {largest:,} nodes: {listed} (best times)."


def _span(curve: Curve) -> str:
    scale, unit = (1e3, "ms") if curve.refined == "step" else (1.0, "m")
    first, last, finest = (
        f"{scale * size:.3g}" for size in (curve.sizes[0], curve.sizes[-1], curve.reference_size)
    )
    return f"{first} to {last} {unit}, against {finest}"
