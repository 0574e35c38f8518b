"""Speed and orders as tables, and as the page docs/performance.md."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from benchmarks.ensemble_speed import EnsembleRow, ensemble_table
from benchmarks.orders import Curve
from benchmarks.speed import FIT_FROM, Basis, Row, Speed
from rope_twin.core.jit.wide import LANES
from rope_twin.studies.page import page_table

PICTURE = Path("images") / "orders.png"
Table = list[list[str]]  # the first row is the head
# Of a node and a smooth step, which is two stages of one correction: to load it (tangent, drag, and
# the root of a stiffness), to stretch its element before and after, to eliminate it.
ROOTS, DIVISIONS = 2 * (3 + 2), 2 * (2 + 2 + 1)

_PAGE = """\
# Performance

Written by `python -m benchmarks report`; the figures are those of its last run, by the solver
that is named with the machine (`python -m benchmarks speed` prints the present one's name). Edit
`benchmarks/performance_page.py`, not this page.

{machine}

## Speed and error

`python -m benchmarks speed` steps the study's scenes on one core, {seconds:g} s of twin time each.
Times are medians over repetitions in one run; in brackets the best, each piece of the run being the
fastest of its repetitions. `cpu %` far below 100 means that other programs ran on the same core.
Nothing but the step is timed (`rope_twin run --speed 0` also feeds inputs and takes snapshots).
Nodes are moving nodes, as many as elements. Errors are of the top tension at the steps' ends: rms
and trough in per cent of the reference's standard deviation, peak in per cent of its peak.

{speed}

Slack and snap. Where a step must be finer for a moment it is halved; the average counts, and the
longest single step is shown:

{snaps}

{exponents}

The references are runs of the same solver with fine settings. How far they can be trusted: so much
changes when elements and steps are made twice as coarse.

{basis}

That the solver converges to what others compute is not shown here but by `pytest test/physics`
(`test_reference_figures`, `test_snap`): explicit integration and three outside codes.

## Orders of convergence

![Error over step and element length, both logarithmic]({picture})

`python -m benchmarks order`: slopes of the error over sizes from coarse to fine, against a still
finer run.

{orders}

**Smooth**: second order in the step and in the element length. Strain at the middle of an element
and half of its mass at each end are of second order, and so is TR-BDF2 over its two stages.

**A snap, in the step**: second order in the mean and in the peak, less in the rms, which does not
fall evenly. The tension max(0, EA·strain + c·strain rate) is continuous and has a kink. The one
step that crosses a kink is wrong by O(h²) instead of O(h³), and there are as many such steps as
elements fall slack or taut, however many steps there are: second order stays. But what a snap
sends along the rope is a front of height m·c_w·v (c_w = √(EA/m), v the speed at which the ends
part), which passes a node while one element tightens, l0/c_w: 1.2 ms at 8 m. To longer steps it is
a jump. A jump that arrives O(h²) too early or late has a mean error of O(h²), an rms of O(h), its
root, and a largest error that does not fall; whether a step ends just before the front or just
after it makes this uneven. With 50 elements the front takes 6.2 ms, steps below that resolve it,
and the rms is of second order as well. The peak comes later, when the load is stopped, and is
smooth.

**A snap, in the element length**: first order in the mean, about a half in the rms, a little over
first in the peak. The mesh cannot hold a front that is steeper than an element's travel time, so
the jump is spread over O(l0): its mean error is O(l0), its rms O(√l0). No step mends that, however
fine. With a current (snap_2km) the slack rope lies in loops, and as long as elements are not
shorter than these, some 4 m, refining brings little: check two numbers of elements before
believing a snap's peak.

## Ensembles

`python -m benchmarks ensemble`: many ropes of smooth_2km together, each with a load and a part of
the sea of its own; nanoseconds are those of one thread.

{ensembles}

Up to {lanes} ropes of one kind share a step, each in a lane of the processor's vectors: the kernels
of one rope run unchanged on numbers {lanes} doubles wide. *Threads only* are the same members on
the same threads without lanes, *one rope alone* is a single rope on one thread, all in the same
minute. A lane gets the same operations in the same order as a lone rope, so each member is equal to
a twin of its own to the bit, whoever shares its group.

Of one kind are ropes with equally many elements, sections at the same ones, the same effects and
the same end below; their figures, water, loads, motion and winch may all differ. What is rare a
member does by itself within the group's turn: a step that is halved or searched along, an element
that splits or merges. By itself throughout steps a rope with a table of stiffness or with an effect
that branches or couples nodes (waves, seabed, splash_zone, bending): `rope_twin ensemble` says how
many of the members and why.

What limits it: with 100 elements a third of a step's time is the divider's, which takes the
{roots} square roots and {divisions} divisions of each node and step no faster in wide registers
than in narrow ones; next is the way to the second-level cache, which holds a group's arrays
(0.5 MB). With 1,000 elements it holds them no more, and lanes gain little.
"""


def as_markdown(speed: Speed, curves: Sequence[Curve], many: Sequence[EnsembleRow]) -> str:
    """Return the page."""
    return _PAGE.format(
        machine=speed.machine.as_text() + ".",
        seconds=speed.seconds,
        speed=page_table(speed_table(speed.rows)),
        snaps=page_table(speed_table(speed.snaps)),
        exponents=exponent_words(speed),
        basis=page_table(basis_table(speed.references)),
        picture=PICTURE.as_posix(),
        orders=page_table(order_table(curves)),
        ensembles=page_table(ensemble_table(many)),
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
    words = [
        f"N^{power:.3f} at {1e3 * float(step_s):g} ms" for step_s, power in speed.exponents.items()
    ]
    most = max(row.nodes for row in speed.rows)
    return f"Cost of a step from {FIT_FROM} to {most:,} nodes: {' and '.join(words)} (best times)."


def _span(curve: Curve) -> str:
    scale, unit = (1e3, "ms") if curve.refined == "step" else (1.0, "m")
    first, last, finest = (
        f"{scale * size:.3g}" for size in (curve.sizes[0], curve.sizes[-1], curve.reference_size)
    )
    return f"{first} to {last} {unit}, against {finest}"
