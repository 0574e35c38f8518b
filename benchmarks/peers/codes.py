"""MoorDyn and CableDyn, run on a scene in this process: their top tension and their time.

Neither is a dependency. Both run from compiled wheels; only the time of their stepping counts, as
processor time, so that other programs on the machine count for nobody. Each is given the hang-off
as it needs it: MoorDyn moves it at a constant speed over each call, so it gets the speed that leads
exactly to where the hang-off is at the end; CableDyn gets place, speed and acceleration there.
"""

from __future__ import annotations

import contextlib
import importlib.util
import math
import os
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.peers.decks import cabledyn_deck, current_table, figures, moordyn_deck
from rope_twin.errors import InputError
from rope_twin.interchange.moordyn_deck import CURRENT_FILE
from rope_twin.recording.motion_source import RegularSea
from rope_twin.scene.schema import Scene
from rope_twin.twin.motion.heave_track import ramp

PEERS = {"moordyn": "2.7.2", "cabledyn": "0.3.0"}  # the versions that the settings were found for
CALL_S = 0.02  # MoorDyn is called so often at least; its own steps are shorter or this


class PeerRefusal(Exception):
    """A peer code cannot run a scene; the text gives the reason."""


@dataclass(frozen=True)
class Setting:
    """Time stepping of a peer code."""

    scheme: str
    step_s: float
    damping: float  # N·s; negative: a fraction of an element's critical damping

    @property
    def words(self) -> str:
        """Return a short description."""
        how = f"{-self.damping:g} of critical" if self.damping < 0.0 else f"{self.damping:g} N·s"
        return f"{self.scheme}, {1e3 * self.step_s:.3g} ms, {how}"


@dataclass(frozen=True)
class Job:
    """Case to be run."""

    scene: Scene
    segments: int
    seconds: float
    lost_n: float  # a rope that pulls so much is none any more


@dataclass(frozen=True)
class History:
    """The top tension at the ends of equal intervals, and what it took."""

    every_s: float
    tension_n: NDArray[np.float64]
    took_s: float  # processor time of the stepping

    @property
    def real_time_factor(self) -> float:
        """Return simulation time over CPU time."""
        return self.every_s * len(self.tension_n) / max(self.took_s, 1e-9)


def require_peers(names: Sequence[str] = tuple(PEERS), command: str = "bench peers") -> None:
    """Check that the peer codes are installed.

    Raises:
        InputError: one is not installed.
    """
    missing = [name for name in names if importlib.util.find_spec(name) is None]
    if missing:
        what = f"{' and '.join(missing)}, which rope_twin does not need itself, cannot be imported"
        wanted = " ".join(f"{name}=={PEERS[name]}" for name in names)
        them = "them" if len(names) > 1 else "it"
        raise InputError(command, what, f"get {them} with `pip install {wanted}`")


def run_moordyn(job: Job, setting: Setting) -> History:
    """Run MoorDyn from rest; it ends early if the tension exceeds the job's `lost_n`."""
    import moordyn

    scene, segments, seconds = job.scene, job.segments, job.seconds
    given = figures(scene)
    call_s = max(CALL_S, setting.step_s)
    times = call_s * np.arange(math.ceil(seconds / call_s) + 1)
    heights = [_hang_off(scene, float(at))[0] for at in times]
    pulls = list[list[float]]()
    with tempfile.TemporaryDirectory() as folder, silence():
        deck = Path(folder) / "deck.txt"
        deck.write_text(moordyn_deck(given, segments, *_scheme(setting)), encoding="utf-8")
        (Path(folder) / CURRENT_FILE).write_text(current_table(given), encoding="utf-8")
        system = moordyn.Create(str(deck))
        moordyn.Init(system, [0.0, 0.0, heights[0]], [0.0, 0.0, 0.0])
        began = time.process_time()
        with contextlib.suppress(RuntimeError):  # it found a number that is none; what was is shown
            for k in range(len(times) - 1):
                speed = (heights[k + 1] - heights[k]) / call_s
                place = [0.0, 0.0, heights[k]]
                pull = moordyn.Step(system, place, [0.0, 0.0, speed], float(times[k]), call_s)
                pulls.append(pull)
                if not abs(pull[2]) < job.lost_n:
                    break
        took_s = time.process_time() - began
        moordyn.Close(system)
    return History(call_s, _magnitude(pulls), took_s)


def run_cabledyn(job: Job, setting: Setting) -> History:
    """Run CableDyn from its own equilibrium; it ends early if a step does not converge.

    Raises:
        PeerRefusal: CableDyn does not take the scene.
    """
    import cabledyn

    scene, segments, seconds = job.scene, job.segments, job.seconds
    given, step_s = figures(scene), setting.step_s
    motion = [_hang_off(scene, step_s * (k + 1)) for k in range(math.ceil(seconds / step_s))]
    pulls: list[NDArray[np.float64]] = []
    with tempfile.TemporaryDirectory() as folder, silence():
        deck = Path(folder) / "deck.dat"
        deck.write_text(cabledyn_deck(given, segments, step_s, seconds), encoding="utf-8")
        try:
            model = cabledyn.CableDyn(deck)
        except cabledyn.CableDynError as error:
            raise PeerRefusal(str(error)) from error
        still = np.zeros(3 * model.n_points)  # without this the payload feels no water
        model.update_point_fluid_fields(still, still, np.zeros(model.n_points), given.density)
        place, speed, acceleration = model.get_coupled_motion()
        up = model.host_dofs()[2]
        began = time.process_time()
        with contextlib.suppress(cabledyn.CableDynError):  # what it did before is shown
            for z, v, a in motion:
                place[up], speed[up], acceleration[up] = z, v, a
                model.step(step_s, place, speed, acceleration)
                pulls.append(model.calc_output()[up - 2 : up + 1])
        took_s = time.process_time() - began
        model.close()
    return History(step_s, _magnitude(pulls), took_s)


RUNS = {"moordyn": run_moordyn, "cabledyn": run_cabledyn}


def _magnitude(pulls: Sequence[Any]) -> NDArray[np.float64]:
    pull = np.array(pulls, dtype=float).reshape(-1, 3)
    size: NDArray[np.float64] = np.sqrt((pull * pull).sum(axis=1))
    return size


def _scheme(setting: Setting) -> tuple[str, float, float]:
    return setting.scheme, setting.damping, setting.step_s


def _hang_off(scene: Scene, at_s: float) -> tuple[float, float, float]:
    """Return height [m], speed and acceleration of the scene's own heave with its ramp."""
    heave = scene.sea_state.heave
    assert heave is not None, "the scenes of this study have a regular heave"
    z, v = RegularSea(heave, scene.sea_state.start_s).at(at_s)
    a = -((2.0 * math.pi / heave.period_s) ** 2) * z
    whole_s = scene.ship.motion_ramp_s
    share, rate = ramp(at_s, whole_s)
    u = min(at_s / whole_s, 1.0)
    bend = 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) / whole_s**2
    return share * z, share * v + rate * z, share * a + 2.0 * rate * v + bend * z


@contextlib.contextmanager
def silence() -> Iterator[Any]:
    """Suppress console output, which both peers write from compiled code."""
    sys.stdout.flush()
    sys.stderr.flush()
    kept = [os.dup(1), os.dup(2)]
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
        yield
    finally:
        for number, old in zip((1, 2), kept, strict=True):
            os.dup2(old, number)
            os.close(old)
        os.close(nowhere)
