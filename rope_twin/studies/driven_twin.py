"""Variants of a scene, and a twin that is driven by a given motion."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

from rope_twin.effects import EFFECTS
from rope_twin.effects.payload import PayloadParams
from rope_twin.effects.rigid_body import RigidBodyParams
from rope_twin.errors import InputError, SolverError
from rope_twin.recording.motion_source import FIRST_NS, LEAD_NS, open_sea, submit
from rope_twin.scene.grid import elements_with
from rope_twin.scene.rigging import winches_by_name
from rope_twin.scene.schema import Scene
from rope_twin.twin.pacing import steps_in_slot
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.twin import Twin
from rope_twin.twin.winch.commands import schedule_samples
from rope_twin.twin.winch.winch import input_of


def variant(
    scene: Scene,
    elements: int | None = None,
    step_s: float | None = None,
    tolerance_n: float | None = None,
) -> Scene:
    """Return the scene with these values in place of its own; None keeps the scene's value.

    elements: of the first rope; in multi-line systems the others are scaled in proportion. For
    scenes whose damping is in N·s, or a fraction of the first axial mode, the physics is unchanged.
    """
    present = [line.elements for line in scene.ropes]
    counts = present if elements is None else elements_with(present, elements)
    ropes = (replace(item, elements=n) for item, n in zip(scene.ropes, counts, strict=True))
    time = scene.time
    time = time if step_s is None else replace(time, step_s=step_s)
    time = time if tolerance_n is None else replace(time, newton_tolerance_n=tolerance_n)
    return replace(scene, ropes=tuple(ropes), time=time)


def with_effect(scene: Scene, params: Any) -> Scene:
    """Return the scene with one more effect, in the order of EFFECTS; a 6-DOF body replaces the
    point.
    """
    order = [effect.params for effect in EFFECTS]
    body = isinstance(params, RigidBodyParams)
    others = [item for item in scene.effects if not (body and isinstance(item, PayloadParams))]
    effects = sorted((*others, params), key=lambda item: order.index(type(item)))
    return replace(scene, effects=tuple(effects))


Motion = Callable[[float], tuple[float, float]]  # time [s] to value and rate
# at [s], winch speed from then on [m/s], and the winch's name if it is not the first one
Speeds = Sequence[tuple[float, float] | tuple[float, float, str]]


def feed(twin: Twin, seconds: float, every: int = 0) -> Iterator[None]:
    """Step a twin with its scene's sea and winches; yield after each `every` steps.

    every: 0 for those of a publish period. What the twin has received already is not repeated.

    Raises:
        InputError: the twin is later than that, or it is not a time.
        SolverError: a step that is not finite.
    """
    if not math.isfinite(seconds) or round(seconds * 1e9) < twin.time_ns:
        problem = f"{seconds:g} s is not possible, the twin is at {1e-9 * twin.time_ns:g} s"
        raise InputError("fed", problem, "give a later simulation time")
    sea, winches = open_sea(twin.scene), winches_by_name(twin.scene)
    steps, known_ns = every or steps_in_slot(twin.step_s), twin.inputs.newest_ns()
    submitted_ns = FIRST_NS if twin.steps == 0 else twin.time_ns
    while twin.time_ns < round(seconds * 1e9):
        until_ns = twin.time_ns + steps * twin.step_ns + LEAD_NS
        for heave in sea.between(submitted_ns, until_ns) if sea else ():
            if heave.stamp_ns > known_ns.get("heave", FIRST_NS - 1):
                submit(twin, heave)
        for name, winch in winches.items():
            for command in schedule_samples(winch, submitted_ns, until_ns):
                if command.stamp_ns > known_ns.get(input_of(command.command, name), FIRST_NS - 1):
                    twin.submit_command(command.stamp_ns, command.command, name)
        submitted_ns = until_ns
        twin.advance(steps)
        yield


def fed(twin: Twin, seconds: float) -> Iterator[Snapshot]:
    """Step a twin with its scene's sea and winches; a snapshot after each publish period.

    seconds: simulation time at which it ends. A second call with a later time continues.

    Raises:
        InputError: the twin is later than that, or it is not a time.
        SolverError: a step that is not finite.
    """
    for _ in feed(twin, seconds):
        yield twin.snapshot()


def still(time: float) -> tuple[float, float]:
    """Return zero motion."""
    return 0.0, 0.0


def march(
    twin: Twin, heave: Motion, seconds: float, every: int = 1, speeds: Speeds = ()
) -> Iterator[Snapshot]:
    """Advance with exact heave samples on every border; a snapshot after each `every` steps.

    Winch commands are submitted up to five seconds ahead.

    Raises:
        SolverError: the twin refused a sample, or its next state would not be finite.
    """
    twin.prescribe_motion()
    if twin.steps == 0:
        check_taken(twin.submit_heave(0, *heave(0.0)))
    waiting = deque(speeds)
    for _ in range(round(seconds / (every * twin.step_s))):
        last = twin.steps + every
        while waiting and waiting[0][0] <= last * twin.step_s + 5.0:
            at_s, speed, *name = waiting.popleft()
            check_taken(twin.submit_speed(round(at_s * 1e9), speed, *name))
        for k in range(twin.steps + 1, last + 1):
            check_taken(twin.submit_heave(k * twin.step_ns, *heave(k * twin.step_s)))
        twin.advance(every)
        yield twin.snapshot()


def check_taken(refusal: str) -> None:
    """Check that a twin has taken an input. Raises SolverError: it has refused it."""
    if refusal:
        raise SolverError(refusal)
