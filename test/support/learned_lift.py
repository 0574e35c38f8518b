"""Measured series of a small rope with known figures, for tests of learning."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
from small_scene import small_scene

from rope_twin.core.state import Floats
from rope_twin.estimation.figures import COUNT, ROPE_FIGURES
from rope_twin.estimation.measured_lift import MeasuredLift
from rope_twin.messages import encode_heave
from rope_twin.messages.inputs import encode_measurement
from rope_twin.recording.bag_writer import BagWriter
from rope_twin.recording.session import encode_json
from rope_twin.scene.schema import Scene
from rope_twin.topics import BY_NAME, INPUT_LOG_TOPIC
from rope_twin.twin.ensemble.fleet import Fleet, FleetInputs
from rope_twin.twin.input_queue import Call, plain_calls
from rope_twin.twin.readings import Measurement

START_NS = 1_700_000_000_000_000_000
SECONDS = 182.0
NOISE_N = 500.0


@cache
def scene() -> Scene:
    """Return a rope of 200 m with a tool of 8 t."""
    return small_scene(Path(mkdtemp()))


def motion(t: Floats, waves: float = 1.0) -> tuple[Floats, Floats, Floats, Floats]:
    """Return heave of three waves, its rate, line out hauled and paid out, and its rate.

    waves: factor on their heights.
    """
    z, v = np.zeros_like(t), np.zeros_like(t)
    for height, period, phase in ((0.7, 7.0, 0.3), (0.4, 5.2, 1.0), (0.3, 11.0, 2.0)):
        w = 2.0 * np.pi / period
        z += waves * height * np.sin(w * t + phase)
        v += waves * height * w * np.cos(w * t + phase)
    ramp = np.clip(t / 10.0, 0.0, 1.0)
    rate = np.where(ramp < 1.0, 0.1, 0.0)
    return z * ramp, v * ramp + z * rate, 200.0 + 3.0 * np.sin(0.1 * t), 0.3 * np.cos(0.1 * t)


@cache
def recorded(waves: float = 1.0) -> tuple[Floats, Floats, Floats]:
    """Return θ, times and tension of a rope of 40 elements at 20 ms, with all sensors perfect."""
    theta = np.zeros(COUNT)
    theta[:3] = 0.05, -0.10, 0.25  # weight, mass, drag
    theta[3] = 0.03
    step = 0.02
    t = step * np.arange(round(SECONDS / step) + 1)
    z, v, line, speed = motion(t, waves)
    fleet = Fleet(scene(), 1, elements=40, step_s=step)
    fleet.set_figures({name: float(np.exp(theta[k])) for k, name in enumerate(ROPE_FIGURES)})
    record = fleet.advance(FleetInputs(z, v, line, speed), interval_steps=100)
    return theta, t[1:], record.top_tension_n[:, 0]


def lift(seed: int = 0, lost: tuple[float, float] = (0.0, 0.0), waves: float = 1.0) -> MeasuredLift:
    """Return the measured series with a noise of NOISE_N and without tension in an interval.

    waves: factor on their heights; the rope goes slack in those four times as high.
    """
    _, t, tension = recorded(waves)
    made = MeasuredLift(NOISE_N)
    at = np.arange(0.0, SECONDS + 0.01, 0.05)
    z, v, line, _ = motion(at, waves)
    made.heave.extend(at, z, v)
    made.line_out.extend(at, line)
    noise = NOISE_N * np.random.default_rng(seed).standard_normal(len(at))
    y = np.interp(at, t, tension) + noise
    y[(at > lost[0]) & (at < lost[1])] = np.nan
    made.tension.extend(at, y)
    return made


def write_bag(
    folder: Path,
    seconds: float = SECONDS,
    *,
    unit_n: float = 1.0,
    stuck_s: float = np.inf,
    earlier: tuple[float, float] = (0.0, -1.0),
    **applied: float,
) -> Path:
    """Return a bag with winch/measured and ship/heave of the lift, as sensors publish them.

    unit_n: of the tension; 1000: a sensor that publishes kN.
    stuck_s: time from which on the load pin repeats itself.
    earlier: how long before that, and for how long, the bag has its beginning too [s].
    applied: factors on figures that the run took over.
    """
    made = lift()
    topics = [BY_NAME[name] for name in ("winch/measured", "ship/heave", INPUT_LOG_TOPIC)]
    with BagWriter(folder, topics) as bag:
        if applied:
            calls = plain_calls([Call("submit_figures", (), {"ramp_s": 20.0, **applied})])
            data = encode_json({"time_ns": 0, "calls": calls})
            bag.write(INPUT_LOG_TOPIC, START_NS, data)
        for before_s, end_s in (earlier, (0.0, seconds)):
            for t, z, v in made.heave.table:
                stamp_ns = START_NS + round((t - before_s) * 1e9)
                if t <= end_s:
                    bag.write("ship/heave", stamp_ns, encode_heave(stamp_ns, z, v))
            tables = made.tension.table, made.line_out.table
            force = np.nan
            for (t, new), (_, length) in zip(*tables, strict=True):
                force = new if t < stuck_s else force
                stamp_ns = START_NS + round((t - before_s) * 1e9)
                reading = Measurement.of_winch(stamp_ns, length, 0.0, force / unit_n, "winch")
                name, data = encode_measurement(stamp_ns, reading)
                if t <= end_s:
                    bag.write(name, stamp_ns, data)
    return folder
