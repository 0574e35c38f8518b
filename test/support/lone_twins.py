"""Randomly drawn members of ensembles, and the single twins that they are compared with."""

from __future__ import annotations

import math
from collections.abc import Sequence

from hypothesis import strategies as st
from small_scene import figures

from rope_twin import Snapshot, Twin
from rope_twin.core.jit.wide import LANES
from rope_twin.scene.load import Change, change_scene
from rope_twin.scene.rigging import winches_by_name
from rope_twin.scene.schema import WINCH, Scene
from rope_twin.twin.ensemble.ensemble import Ensemble, Variation
from rope_twin.twin.motion.heave_track import HeaveSeries
from rope_twin.twin.snapshot import SPEED
from rope_twin.twin.winch.commands import CommandSample, WinchCommand, schedule_samples

SAMPLE_NS = 50_000_000
SECOND_NS = 1_000_000_000


def sea(height_m: float, period_s: float, seconds: float) -> list[tuple[int, float, float]]:
    """Return samples of a growing heave of two waves, from before the start to beyond the end."""
    w, samples = 2.0 * math.pi / period_s, []
    for k in range(-2, round(seconds * SECOND_NS / SAMPLE_NS) + 6):
        t = k * SAMPLE_NS * 1e-9
        z = height_m * (math.sin(w * t) + 0.3 * math.sin(2.3 * w * t))
        v = height_m * w * (math.cos(w * t) + 0.69 * math.cos(2.3 * w * t))
        samples.append((k * SAMPLE_NS, z, v))
    return samples


def alone(scene: Scene, variation: Variation, seconds: int) -> Snapshot:
    """Return the last snapshot of a single twin with the member's scene and inputs."""
    twin = Twin(change_scene(scene, variation.changes))
    twin.prescribe_motion()  # as a series is: computed
    if variation.heave is not None:
        columns = (
            variation.heave.stamp_ns,
            variation.heave.position_m,
            variation.heave.velocity_m_per_s,
        )
        for stamp, z, v in zip(*(column.tolist() for column in columns), strict=True):
            stamp_ns = stamp - variation.heave.start_ns
            if stamp_ns > -SECOND_NS:
                assert not twin.submit_heave(stamp_ns, z, v)
            if stamp_ns > (seconds + 1) * SECOND_NS:
                break
    for second in range(seconds):
        for command in variation.commands or ():
            if second <= command.stamp_ns / SECOND_NS < second + 1:
                assert not twin.submit_command(command.stamp_ns, command.command)
        for name, winch in winches_by_name(scene).items():
            span = second * SECOND_NS, (second + 1) * SECOND_NS
            for command in schedule_samples(winch, *span) if name != WINCH else ():
                assert not twin.submit_command(command.stamp_ns, command.command, name)
        twin.advance(round(1.0 / twin.step_s))
    return twin.snapshot()


def differing(actual: Snapshot, expected: Snapshot) -> list[str]:
    """Return the figures that differ in a bit, extremes since the last snapshot included."""
    a, b = figures(actual), figures(expected)
    recorded = ("bend of", "touchdown of")  # by twins only
    compared = [name for name in b if name in a or not name.startswith(recorded)]
    names = [name for name in compared if a[name].tobytes() != b[name].tobytes()]
    for name in ("solves", "substeps", "splits", "merges"):
        if getattr(actual.solver, name) != getattr(expected.solver, name):
            names.append(name)
    return names


def differing_ropes(actual: Snapshot, expected: Snapshot) -> list[str]:
    """Return the values along the ropes that differ in a bit."""
    return [
        f"{rope.name}: {name}"
        for rope, other in zip(actual.ropes, expected.ropes, strict=True)
        for name in ("node_position_m", "element_tension_n")
        if getattr(rope, name).tobytes() != getattr(other, name).tobytes()
    ]


def assert_equal_members(ensemble: Ensemble, lone: Ensemble) -> None:
    """Assert that members in lanes and without lanes are bit-identical."""
    assert ensemble.figures() == lone.figures()
    for number in range(len(ensemble.figures())):
        snapshot, expected = ensemble.snapshot(number), lone.snapshot(number)
        assert not differing(snapshot, expected), number
        assert not differing_ropes(snapshot, expected), number


def stepped_both_ways(
    scene: Scene, members: Sequence[Variation], spans: tuple[int, ...] = (1, 9)
) -> tuple[Ensemble, Ensemble]:
    """Step members in lanes and without lanes over these spans [s]; assert that they are equal."""
    ensemble = Ensemble(scene, members, threads=1)
    lone = Ensemble(scene, members, threads=1, max_lanes=1)
    assert ensemble.lanes().members == LANES
    for seconds in spans:
        ensemble.advance(seconds)
        lone.advance(seconds)
    assert_equal_members(ensemble, lone)
    return ensemble, lone


@st.composite
def variations(draw: st.DrawFn) -> Variation:
    """Draw a load, a rope, current and drag, a sea and a winch schedule."""
    number = st.floats
    changes = (
        Change("payloads[0].mass_kg", draw(st.sampled_from([1700.0, 4000.0, 8000.0, 20000.0]))),
        Change("ropes[0].rope.axial_stiffness_n", draw(number(0.3, 3.0)), multiply=True),
        Change("ropes[0].damping.fraction_of_first_axial_mode", draw(number(0.0, 0.1))),
        Change("effects.current.profile[*][1][*]", draw(number(0.0, 2.0)), multiply=True),
        Change("effects.drag.normal", draw(number(0.5, 2.5))),
        Change("ropes[0].elements", draw(st.sampled_from([10, 20, 33]))),
    )
    heave = HeaveSeries.of(sea(draw(number(0.0, 4.0)), draw(number(4.0, 10.0)), 60.0))
    speeds = draw(st.lists(number(-1.5, 1.5), max_size=3))
    commands = tuple(
        CommandSample(2 * k * SECOND_NS, WinchCommand(SPEED, v)) for k, v in enumerate(speeds)
    )
    return Variation(changes, heave.starting_at(draw(st.integers(0, 20 * SECOND_NS))), commands)
