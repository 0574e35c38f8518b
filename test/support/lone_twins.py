"""Members of ensembles at random, and what they are held against: twins of their own."""

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
    """Samples of a heave that grows on two waves, from before the start to beyond the end."""
    w, samples = 2.0 * math.pi / period_s, []
    for k in range(-2, round(seconds * SECOND_NS / SAMPLE_NS) + 6):
        t = k * SAMPLE_NS * 1e-9
        z = height_m * (math.sin(w * t) + 0.3 * math.sin(2.3 * w * t))
        v = height_m * w * (math.cos(w * t) + 0.69 * math.cos(2.3 * w * t))
        samples.append((k * SAMPLE_NS, z, v))
    return samples


def alone(scene: Scene, own: Variation, seconds: int) -> Snapshot:
    """What a twin of the member's scene and inputs comes to, a second at a time."""
    twin = Twin(change_scene(scene, own.changes))
    twin.prescribe_motion()  # as a series is: computed
    if own.heave is not None:
        columns = (own.heave.stamp_ns, own.heave.position_m, own.heave.velocity_m_per_s)
        for stamp, z, v in zip(*(column.tolist() for column in columns), strict=True):
            at_ns = stamp - own.heave.start_ns
            if at_ns > -SECOND_NS:
                assert not twin.offer_heave(at_ns, z, v)
            if at_ns > (seconds + 1) * SECOND_NS:
                break
    for second in range(seconds):
        for command in own.commands or ():
            if second <= command.stamp_ns / SECOND_NS < second + 1:
                assert not twin.offer_command(command.stamp_ns, command.command)
        for name, winch in winches_by_name(scene).items():
            span = second * SECOND_NS, (second + 1) * SECOND_NS
            for command in schedule_samples(winch, *span) if name != WINCH else ():
                assert not twin.offer_command(command.stamp_ns, command.command, name)
        twin.advance(round(1.0 / twin.step_s))
    return twin.snapshot()


def differing(found: Snapshot, expected: Snapshot) -> list[str]:
    """The figures of which a bit differs; the tensions since the last snapshot too."""
    a, b = figures(found), figures(expected)
    recorded = ("bend of", "touchdown of")  # by twins only
    kept = [name for name in b if name in a or not name.startswith(recorded)]
    names = [name for name in kept if a[name].tobytes() != b[name].tobytes()]
    for name in ("solves", "substeps", "splits", "merges"):
        if getattr(found.solver, name) != getattr(expected.solver, name):
            names.append(name)
    return names


def differing_ropes(found: Snapshot, expected: Snapshot) -> list[str]:
    """Values along the ropes that differ in any bit."""
    return [
        f"{rope.name}: {name}"
        for rope, other in zip(found.ropes, expected.ropes, strict=True)
        for name in ("node_position_m", "element_tension_n")
        if getattr(rope, name).tobytes() != getattr(other, name).tobytes()
    ]


def assert_equal_members(ensemble: Ensemble, lone: Ensemble) -> None:
    """Figures and states of members in lanes are those of members without them, to the bit."""
    assert ensemble.figures() == lone.figures()
    for number in range(len(ensemble.figures())):
        shot, expected = ensemble.snapshot(number), lone.snapshot(number)
        assert not differing(shot, expected), number
        assert not differing_ropes(shot, expected), number


def stepped_both_ways(
    scene: Scene, own: Sequence[Variation], spans: tuple[int, ...] = (1, 9)
) -> tuple[Ensemble, Ensemble]:
    """Members in lanes and without them after these spans [s], which are equal."""
    ensemble = Ensemble(scene, own, threads=1)
    lone = Ensemble(scene, own, threads=1, abreast=1)
    assert ensemble.lanes().members == LANES
    for seconds in spans:
        ensemble.advance(seconds)
        lone.advance(seconds)
    assert_equal_members(ensemble, lone)
    return ensemble, lone


@st.composite
def variations(draw: st.DrawFn) -> Variation:
    """A load from light to heavy, another rope, current and drag, a sea, a winch that runs."""
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
