"""Hard cases of slack and snap: loads too light, too heavy, too stiff, afloat, in a storm."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rope_twin.studies.driven_twin import Motion
from validation.case import Finding, limited
from validation.hard_cases.explicit import explicit_top_tension
from validation.hard_cases.limits import all_converged, hard_case, off, rms_off
from validation.hard_cases.rigs import RigBench, settled, sine
from validation.hard_cases.waves import HangingBar
from validation.hard_cases.waves import top_tension as exact_top_tension
from validation.rigs import NOTHING, WATER, Rig, faded
from validation.state_bench import Vector

GRAVITY = 9.81


def study_rope(displaced: float, nominal: float) -> Rig:
    """Return a rope of 3.6 kg/m, EA 150 MN; Cdn 1.2, Cdt 0.01, Ca 1 on `nominal` diameter [m].

    The diameter is the one that displaces that mass; the coefficients are scaled so that drag and
    added mass stay those of the nominal one.
    """
    diameter = math.sqrt(4.0 * displaced / (math.pi * WATER))
    scale = nominal / diameter
    return Rig(
        mass=3.6, EA=1.5e8, diameter=diameter, density=WATER, gravity=GRAVITY,
        drag=(1.2 * scale, 0.01 * scale), added_mass=scale**2,
    )  # fmt: skip


SMOOTH_2KM = replace(
    study_rope(displaced=3.6 - 0.04, nominal=0.076), length=2000.0, damping=5e5, load=20e3,
    volume=2.927, added=(WATER * 2.927,) * 3, area=(6.0,) * 3,
    current=((0.0, (0.5, 0.0)), (-2000.0, (0.0, 0.0))),
)  # fmt: skip
SNAP_VERTICAL = replace(
    SMOOTH_2KM, elements=250, load=2e3, volume=0.5, added=(WATER * 0.5,) * 3, area=(8.0,) * 3,
    current=((0.0, (0.0, 0.0)),),
)  # fmt: skip
SNAP_2KM = replace(SNAP_VERTICAL, elements=1000, current=((0.0, (0.2, 0.0)),))
SLACK_5KM = replace(
    study_rope(displaced=3.6 * WATER / 975.0, nominal=0.08), length=5000.0, elements=1000,
    load=20e3, volume=4.0, added=(8e3,) * 3, area=(8.0,) * 3, step=0.02,
    current=((0.0, (1.0, 0.0)), (-5000.0, (0.2, 0.0))),
)  # fmt: skip
HMPE_3IN = Rig(
    length=3000.0, elements=100, mass=2.88, EA=206e6, diameter=0.8 * 0.0762, density=WATER,
    drag=(1.2, 0.01), added_mass=1.0, load=2e3, volume=0.5, damping=5e5,
    added=(512.5,) * 3, area=(4.0,) * 3,
)  # fmt: skip
PERIOD_S = 8.0
REST_S = 600.0
HEAVE_4M = sine(4.0, PERIOD_S)


def run_at_rest_in_heave(rig: Rig, heave: Motion, seconds: float) -> tuple[Vector, int]:
    """Return the force on the hang-off after each step, and the number of unconverged substeps."""
    bench = settled(rig)
    pull = bench.heave(heave, 0, round(seconds / rig.step))
    return pull, bench.unconverged


def against_explicit(rig: Rig, heave: Motion) -> list[Finding]:
    """Compare peak and impulse of three heaves with the explicit method; test the return to rest.

    The impulse and not the samples themselves: a knock of 20 ms that comes 5 ms late is no error of
    physics, but what the hang-off has received by then would be. Three heaves of the seven: later
    knocks of a bare end differ by 15 % between two explicit runs of different step.
    """
    bench = settled(rig)
    pull = bench.heave(heave, 0, round(7.0 * PERIOD_S / rig.step))
    reference = np.abs(explicit_top_tension(rig, heave, 3.0 * PERIOD_S))
    compared = pull[: len(reference)]
    behind = float(np.abs(np.cumsum(compared - reference)).max() / reference.sum())
    last_pull = float(bench.hold(round(REST_S / rig.step))[-1])
    return [
        off("peak of the top tension", float(compared.max()), float(reference.max()), 1.0),
        limited("impulse so far, largest difference over the whole", 100.0 * behind, 1.0),
        off("pull after the ship has stopped against W + w·L", last_pull, rig.top_weight, 0.1),
        all_converged(bench.unconverged),
    ]


def light_payload() -> list[Finding]:
    """Run 2 t in heave 4 m / 8 s: slack for 65 % of the time, vertical and with lateral loops."""
    vertical, first = run_at_rest_in_heave(SNAP_VERTICAL, HEAVE_4M, 60.0)
    loops, second = run_at_rest_in_heave(SNAP_2KM, HEAVE_4M, 60.0)
    return [
        off("peak against the explicit 172.36 kN", float(vertical.max()), 172.36e3, 0.25),
        off("peak with loops against 133.5 kN", float(loops.max()), 133.5e3, 0.3),
        all_converged(first + second),
    ]


def payload_of_200_kg() -> list[Finding]:
    """Run 200 kg on 2 km of rope in heave 4 m / 8 s."""
    rig = replace(
        SNAP_VERTICAL, elements=100, load=200.0, volume=0.05, added=(51.25,) * 3, area=(1.0,) * 3
    )
    return against_explicit(rig, HEAVE_4M)


def no_payload() -> list[Finding]:
    """Run the bare lower end in heave 4 m / 8 s."""
    rig = replace(SNAP_VERTICAL, elements=100, load=0.0, volume=0.0, added=NOTHING, area=NOTHING)
    return against_explicit(rig, HEAVE_4M)


def storm() -> list[Finding]:
    """Run 20 t in irregular heave of Hs 6.5 m, and on 5 km in a regular 5 m."""
    rig = replace(SMOOTH_2KM, elements=100, current=((0.0, (0.0, 0.0)),))
    pull, first = run_at_rest_in_heave(rig, storm_heave(), 120.0)
    reference = explicit_top_tension(rig, storm_heave(), 120.0)
    slack, unconverged = run_at_rest_in_heave(SLACK_5KM, sine(5.0, 8.0, 16.0), 60.0)
    return [
        off("peak of the top tension", float(pull.max()), float(reference.max()), 0.1),
        off("minimum top tension", float(pull.min()), float(reference.min()), 0.1),
        rms_off("its history, rms", pull, reference, 0.1),
        off("peak on 5 km against 355.19 kN", float(slack.max()), 355.19e3, 0.1),
        all_converged(first + unconverged),
    ]


def storm_heave() -> Motion:
    """Return 40 components of a Pierson-Moskowitz spectrum, Hs 6.5 m, Tp 12 s, fixed phases."""
    significant, peak_hz = 6.5, 1.0 / 12.0
    f = np.linspace(0.5 * peak_hz, 3.0 * peak_hz, 40)
    shape = f**-5 * np.exp(-1.25 * (peak_hz / f) ** 4)
    amplitude = np.sqrt(shape / shape.sum() * significant**2 / 8.0)
    omega = 2.0 * math.pi * f
    phase = np.random.default_rng(4).uniform(0.0, 2.0 * math.pi, len(f))

    def at(time: float) -> tuple[float, float]:
        angle = omega * time + phase
        z, v = amplitude * np.sin(angle), amplitude * omega * np.cos(angle)
        return float(z.sum()), float(v.sum())

    return faded(at, 8.0)


def stiff_rope() -> list[Finding]:
    """Run an EA of 150 GN: rope and payload move as one body with the ship.

    F = W + w·L + (M' + m·L)·a + k·|v|·v + k_t·L·|v|·v at the hang-off's own v and a.
    """
    rig = replace(SMOOTH_2KM, EA=1.5e11, elements=100, current=((0.0, (0.0, 0.0)),))
    heave, seconds = sine(1.5, 8.0), 60.0
    pull, unconverged = run_at_rest_in_heave(rig, heave, seconds)
    t = rig.step * np.arange(1, len(pull) + 1)
    v = np.array([heave(float(x))[1] for x in t])
    a = np.array([heave(float(x) + 1e-4)[1] - heave(float(x) - 1e-4)[1] for x in t]) / 2e-4
    moving = rig.load + rig.added[2] + rig.mass * rig.length
    skin = math.pi * rig.diameter * rig.drag[1] * rig.length
    drag = 0.5 * rig.density * (rig.area[2] + skin) * np.abs(v) * v
    rigid = rig.top_weight + moving * a + drag
    return [
        rms_off("top tension against a rigid rod", pull, rigid, 0.1),
        all_converged(unconverged),
    ]


def floating_rope() -> list[Finding]:
    """Run 3 in HMPE: added mass 1.04 of its mass, 3 km buoyant under 2 t, heave 4 m / 8 s."""
    rig = HMPE_3IN
    snap = against_explicit(rig, HEAVE_4M)
    resting = settled(rig)
    pull = float(resting.hold(10)[-1])
    return [
        *snap,
        off("pull at rest against W + w·L, w < 0", pull, rig.top_weight, 1e-4),
        string_frequency(),
    ]


def string_frequency() -> Finding:
    """Compare the first frequency of the same rope as a taut string with √(T/μ)/(2·L)."""
    length, strain = 100.0, 2e-3
    rig = replace(
        HMPE_3IN, length=length / (1.0 + strain), elements=50, fixed_at=(-length, 0.0, 0.0),
        gravity=0.0, drag=(0.0, 0.0), damping=0.0, tolerance=1e-3,
    )  # fmt: skip
    bench = RigBench(rig)
    x = np.linspace(0.0, math.pi, rig.elements + 1)
    bench.position[1] = 1e-3 * np.sin(x)
    bench.find_acceleration()
    middle = np.array([bench.hold(1) and bench.position[1, rig.elements // 2] for _ in range(400)])
    added = WATER * 0.25 * math.pi * rig.diameter**2
    tension = rig.EA * strain
    # the displaced shape is the mode itself: y = y0·cos(ωt), its first zero at a quarter period
    k = int(np.flatnonzero(middle < 0.0)[0])
    quarter = rig.step * (k + middle[k - 1] / (middle[k - 1] - middle[k]))
    expected = math.sqrt(tension * (1.0 + strain) / (rig.mass + added)) / (2.0 * length)
    return off("first frequency across the water", 0.25 / quarter, expected, 0.2)


def heavy_load() -> list[Finding]:
    """Run 500 t on 1,000 m of 40 mm wire, stretched by 7.6 %, in heave 1.5 m / 8 s."""
    rig = Rig(load=500e3)
    heave, seconds = sine(1.5, 8.0), 60.0
    bench = settled(rig)
    depth = -float(bench.position[2, 0])
    pull = bench.heave(heave, 0, round(seconds / rig.step))
    bar = HangingBar(rig.mass, rig.weight, rig.EA, rig.load, rig.load_weight)
    exact = exact_top_tension(bar, lambda t: (rig.length, 0.0), heave, seconds, 1e-3)
    return [
        off("depth at rest against L + (W + w·L/2)·L/EA", depth, rig.hanging_depth, 1e-7),
        rms_off("top tension against travelling waves, rms", pull, exact[10::10], 0.05),
        all_converged(bench.unconverged),
    ]


EXPLICIT = "explicit 1-D computation of the same elements"
CASES = (
    hard_case("light_payload", "2 t on 2 km, heave 4 m / 8 s: slack and snap",
              "fine explicit peaks, 172.36 kN vertical and 133.5 kN with loops",
              light_payload, 2.0),
    hard_case("payload_200kg", "200 kg on 2 km, heave 4 m / 8 s", EXPLICIT, payload_of_200_kg, 5.0),
    hard_case("no_payload", "a bare end on 2 km, heave 4 m / 8 s", EXPLICIT, no_payload, 5.0),
    hard_case("storm_20t", "20 t, irregular heave of Hs 6.5 m; 20 t on 5 km, heave 5 m / 8 s",
              f"{EXPLICIT}; explicit peak 355.19 kN", storm, 12.0),
    hard_case("stiff_rope", "EA times 1,000: 150 GN", "rigid rod: W + M·a + drag in closed form",
              stiff_rope, 1.0, True),
    hard_case("floating_hmpe", "rope that floats, added mass above its mass, 2 t, heave 4 m / 8 s",
              f"{EXPLICIT}; W + w·L; √(T/μ)/(2L), μ with added mass", floating_rope, 8.0),
    hard_case("heavy_500t", "500 t on a 40 mm wire", "closed form at rest; exact travelling waves",
              heavy_load, 2.0, True),
)  # fmt: skip
