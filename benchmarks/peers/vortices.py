"""Speed of MoorDyn's VIV model and of the wake oscillator, on the curved pipe of [QM].

MoorDyn's is a synchronisation model: a lift of given magnitude at each node whose frequency is
drawn to that of the node's motion; the wake has no memory but a phase. Pipe, weight, bending,
current, number of elements and time step are the same. MoorDyn states that its model was tested
with RK2 and RK4 only; each scheme uses the largest fraction of a millisecond with which it remains
finite, critically damped in its elements. Speeds are by CPU time, run in turns.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from benchmarks.peers.codes import PEERS, require_peers, silence
from benchmarks.peers.decks import Figures, current_table, figures, moordyn_deck
from rope_twin.core.state import Floats
from rope_twin.effects.bending import BendingParams
from rope_twin.effects.wake_oscillator import WakeOscillatorParams
from rope_twin.interchange.moordyn_deck import CURRENT_FILE
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import Scene
from rope_twin.studies.driven_twin import variant
from validation.case import Listener, announced
from validation.state_bench import Bench

PEER, COMMAND = "moordyn", "bench vortices"
SCENE = "curved_pipe"
STEP_S = 1e-3
CALL_S = 0.02  # that a code is asked for at once; the hang-off is at rest
LIFT = 0.8  # Cl of MoorDyn's own example
CRITICAL = -1.0
SCHEMES = (("Euler", 3), ("RK2", 3), ("RK4", 2), ("Midpoint4", 1), ("Midpoint5", 1))


@dataclass(frozen=True)
class Plan:
    """Settings of the comparison."""

    elements: int
    seconds: float  # simulated in a turn
    turns: int
    schemes: tuple[tuple[str, int], ...] = SCHEMES  # with its steps in STEP_S


FULL = Plan(200, 2.0, 3)
QUICK = Plan(20, 0.2, 2, (("RK2", 1), ("Midpoint5", 1)))


@dataclass(frozen=True)
class PeerVortexRow:
    """MoorDyn with one scheme and rope_twin, with equal elements and step."""

    peer: str  # with its version
    scheme: str
    elements: int
    step_s: float
    peer_real_time_factor: float | None  # None: it was lost
    peer_rms_diameters: float | None  # of the node that moves most, second half of all turns
    real_time_factor: float
    rms_diameters: float  # likewise
    ratio: float | None


def race_vortices(plan: Plan, listen: Listener) -> Iterator[dict[str, Any]]:
    """Return a row per scheme, as a dictionary.

    Raises:
        InputError: MoorDyn is not installed.
        SolverError: the pipe finds no rest, or a step is not finite.
    """
    require_peers((PEER,), COMMAND)
    scene = load_scene(SCENE)
    given = pipe_figures(scene)
    for how in announced(plan.schemes, listen, lambda one: f"{SCENE}, MoorDyn by {one[0]}"):
        yield asdict(_raced(plan, scene, given, how))


def race_table(rows: Sequence[dict[str, Any]]) -> list[tuple[str, ...]]:
    """Return the rows as text, below a head."""
    head = ("peer", "scheme", "elements", "step ms", "× real time", "rms D", "rope_twin",
            "rms D", "times faster")  # fmt: skip
    table: list[tuple[str, ...]] = [head]
    for row in rows:
        lost = row["peer_real_time_factor"] is None
        theirs = ("lost", "", "") if lost else (
            f"{row['peer_real_time_factor']:.2f}", f"{row['peer_rms_diameters']:.2f}",
            f"{row['ratio']:.1f}",
        )  # fmt: skip
        table.append(
            (row["peer"], row["scheme"], f"{row['elements']}", f"{1e3 * row['step_s']:.3g}",
             *theirs[:2], f"{row['real_time_factor']:.1f}", f"{row['rms_diameters']:.2f}",
             theirs[2])
        )  # fmt: skip
    return table


def pipe_figures(scene: Scene) -> Figures:
    """Return the scene as MoorDyn has it: bending and lift as line properties."""
    apart = (BendingParams, WakeOscillatorParams)
    plain = tuple(own for own in scene.effects if not isinstance(own, apart))
    EI = sum(own.stiffness_n_m2 for own in scene.effects if isinstance(own, BendingParams))
    return replace(figures(replace(scene, effects=plain)), EI=EI, lift=LIFT)


class _OurPipe:
    """rope_twin's pipe, at rest in its current."""

    def __init__(self, scene: Scene, elements: int, step_s: float) -> None:
        self._bench = Bench(variant(scene, elements, step_s))
        self._steps = round(CALL_S / step_s)
        self._bench.hold(1)  # compiled now, if it was not

    def call(self) -> None:
        """Advance by CALL_S."""
        self._bench.hold(self._steps)

    def across(self) -> Floats:
        """Return the cross-flow position of the nodes [m]."""
        return np.asarray(self._bench.position[1]).copy()


class _MoorDynPipe:
    """Hanging straight; its folder holds the deck."""

    def __init__(self, given: Figures, elements: int, deck: Path) -> None:
        import moordyn

        (deck.parent / CURRENT_FILE).write_text(current_table(given), encoding="utf-8")
        self._code, self._nodes, self._calls = moordyn, range(elements + 1), 0
        self._system = moordyn.Create(str(deck))
        moordyn.Init(self._system, [0.0, 0.0, 0.0], [0.0, 0.0, 0.0])
        self._line = moordyn.GetLine(self._system, 1)

    def call(self) -> None:
        """Advance by CALL_S; RuntimeError where it finds a number that is none."""
        still = [0.0, 0.0, 0.0]
        self._code.Step(self._system, still, still, self._calls * CALL_S, CALL_S)
        self._calls += 1

    def across(self) -> Floats:
        """Return the cross-flow position of the nodes [m]."""
        return np.array([self._code.GetLineNodePos(self._line, k)[1] for k in self._nodes])

    def close(self) -> None:
        """Close MoorDyn."""
        self._code.Close(self._system)


class _Timed:
    """A pipe's turns: simulated over processor time of each, and where its nodes were."""

    def __init__(self, pipe: _OurPipe | _MoorDynPipe) -> None:
        self.pipe, self.factors, self._seen, self.lost = pipe, list[float](), list[Floats](), False

    def turn(self, seconds: float) -> None:
        """Advance for a time; no effect once the solution has failed."""
        spent = 0.0
        for _ in range(round(seconds / CALL_S)):
            if self.lost:
                return
            began = time.process_time()
            try:
                self.pipe.call()
            except RuntimeError:
                self.lost = True
            spent += time.process_time() - began
            self._seen.append(self.pipe.across())
            self.lost = self.lost or not bool(np.isfinite(self._seen[-1]).all())
        self.factors.append(seconds / spent)

    def rms(self) -> float:
        """Return the RMS of the node with the largest motion, second half of all turns [m]."""
        return float(np.array(self._seen[len(self._seen) // 2 :]).std(axis=0).max())


def _raced(plan: Plan, scene: Scene, given: Figures, how: tuple[str, int]) -> PeerVortexRow:
    scheme, parts = how
    step_s = STEP_S / parts
    with tempfile.TemporaryDirectory() as folder, silence():
        deck = Path(folder) / "deck.txt"
        text = moordyn_deck(given, plan.elements, scheme, CRITICAL, step_s)
        deck.write_text(text, encoding="utf-8")
        peer = _MoorDynPipe(given, plan.elements, deck)
        ours, theirs = _Timed(_OurPipe(scene, plan.elements, step_s)), _Timed(peer)
        for _ in range(plan.turns):
            theirs.turn(plan.seconds)
            ours.turn(plan.seconds)
        peer.close()
    factor, d = median(ours.factors), given.diameter
    other = None if theirs.lost else median(theirs.factors)
    return PeerVortexRow(
        f"MoorDyn {PEERS[PEER]}", scheme, plan.elements, step_s, other,
        None if theirs.lost else theirs.rms() / d, factor, ours.rms() / d,
        None if other is None else factor / other,
    )  # fmt: skip
