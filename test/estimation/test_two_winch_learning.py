"""Learning of a load on two winches: one algorithm, with a load pin on each rope."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from rope_twin import Twin
from rope_twin.cli import main
from rope_twin.core.state import Floats
from rope_twin.errors import BagError, InputError
from rope_twin.estimation import report
from rope_twin.estimation.alarms import FaultWatch
from rope_twin.estimation.estimator import Estimator, begin_at_rest
from rope_twin.estimation.figures import (
    BIAS,
    GAIN,
    INDEX,
    LINE_OFFSET,
    LINE_SLIP,
    NAMES,
    ROPE_FIGURES,
    WINCH_FIGURES,
    Prior,
    factors_of,
    of_winch,
    scene_prior,
    static_tops_n,
)
from rope_twin.estimation.hanging import hanging_of
from rope_twin.estimation.lift_model import step_of
from rope_twin.estimation.live import AlarmTask, Learner, LiveLearning
from rope_twin.estimation.measured_lift import MeasuredLift, Series
from rope_twin.estimation.noise import (
    FREQUENCY_HZ,
    SHARE_ERROR_M,
    bars_of,
    first_axial_period_s,
    share_autocovariances,
)
from rope_twin.estimation.recorded_lift import read_lift
from rope_twin.estimation.worker import Motion, Reading, Restart
from rope_twin.messages import encode_heave, templates
from rope_twin.messages.cdr import serialise
from rope_twin.messages.inputs import encode_measurement
from rope_twin.messages.templates import joint_state
from rope_twin.recording.bag_writer import BagWriter
from rope_twin.scene.instruments import Learning
from rope_twin.scene.lift import alone, lift_figures
from rope_twin.scene.load import Change, change_scene, load_scene
from rope_twin.scene.schema import Scene
from rope_twin.topics import BY_NAME, WINCH_MEASURED
from rope_twin.twin.ensemble.fleet import Fleet, FleetInputs
from rope_twin.twin.ensemble.live_state import live_state
from rope_twin.twin.input_queue import InputQueue
from rope_twin.twin.readings import WINCH_SENSORS, Measurement

AFT = "aft_sheave"
SECONDS, STEP_S, SENSOR_S = 245.0, 0.02, 0.05
BEFORE_S = 150.0  # in which the ropes come to their true lengths and the load to rest
SENSORS = BIAS, GAIN, *(of_winch(AFT, name) for name in (BIAS, GAIN, LINE_OFFSET, LINE_SLIP))
NORMAL_90 = 1.6448536269514722
START_NS = 1_700_000_000_000_000_000


@cache
def two_lines(length_m: float = 600.0) -> Scene:
    """The module on two winches, with load pins without friction and heave without delay."""
    known = Learning(
        friction_pct=0.0, friction_uncertainty_pct=0.001,
        heave_delay_s=0.0, heave_delay_uncertainty_s=0.001,
    )  # fmt: skip
    lengths = [Change(f"ropes[{r}].length_m", length_m) for r in (0, 1)]
    return replace(change_scene(load_scene("two_line_lift"), lengths), learning=known)


@cache
def prior(length_m: float = 600.0) -> Prior:
    """The prior of load pins that are tared."""
    return scene_prior(two_lines(length_m), tared=True)


def counters(t: Floats, length_m: float) -> tuple[Floats, Floats, Floats, Floats]:
    """Line out of both winches and their rates: down and up together, then one alone by 0.2 m."""
    at = 0.0, 60.0, 90.0, 100.0, 130.0, 150.0, 154.0, 200.0, 204.0, SECONDS
    fore = np.interp(t, at, (0.0, 0.0, 12.0, 12.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    alone = np.interp(t, at, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.2, 0.2, 0.0, 0.0))
    half = round(0.5 / (t[1] - t[0]))
    window = np.hanning(2 * half + 3)[1:-1]
    smooth = [
        length_m + np.convolve(np.pad(one, half, mode="edge"), window / window.sum(), "valid")
        for one in (fore, fore + alone)
    ]
    return smooth[0], np.gradient(smooth[0], t), smooth[1], np.gradient(smooth[1], t)


def heave(t: Floats, seed: int) -> tuple[Floats, Floats]:
    """Heave of four waves whose phases a seed draws, and its rate; it builds up in 10 s."""
    rng = np.random.default_rng(seed)
    z, v = np.zeros_like(t), np.zeros_like(t)
    for height, period in ((0.3, 8.5), (0.15, 6.3), (0.35, 11.0), (0.1, 14.0)):
        w, phase = 2.0 * np.pi / period, rng.uniform(0.0, 2.0 * np.pi)
        z += height * np.sin(w * t + phase)
        v += height * w * np.cos(w * t + phase)
    ramp = np.clip(t / 10.0, 0.0, 1.0)
    return z * ramp, v * ramp + z * np.where((ramp > 0.0) & (ramp < 1.0), 0.1, 0.0)


def drawn(count: int, seed: int) -> Floats:
    """θ of truths drawn from the prior within two standard deviations, (count, figures)."""
    rng = np.random.default_rng(seed)
    thetas = np.tile(prior().mean, (count, 1))
    names = prior().names
    for name in (*ROPE_FIGURES, *SENSORS):
        k = names.index(name)
        thetas[:, k] = prior().sd[k] * rng.standard_normal(count).clip(-2.0, 2.0)
    return thetas


def measured(
    thetas: Floats, seed: int, step_s: float, elements: int, rolls_m: float = 0.0,
    length_m: float = 600.0,
) -> list[MeasuredLift]:  # fmt: skip
    """Return the measured series of truths on a mesh and step, with noise of a seed.

    rolls_m: amplitude of a heave that the aft hang-off has more, which nobody measures.
    """
    t = step_s * np.arange(round(-BEFORE_S / step_s), round(SECONDS / step_s) + 1)
    (z, v), (fore, fore_rate, aft, aft_rate) = heave(t, seed), counters(t, length_m)
    offset, slip = (
        thetas[:, prior().names.index(of_winch(AFT, name))] for name in (LINE_OFFSET, LINE_SLIP)
    )
    ramp = np.clip(1.0 + t / BEFORE_S, 0.0, 1.0)[:, None]
    smooth, rate = ramp**2 * (3.0 - 2.0 * ramp), 6.0 * ramp * (1.0 - ramp) / BEFORE_S
    own = aft[:, None] + smooth * offset + slip * (aft - length_m)[:, None]
    own_rate = aft_rate[:, None] * (1.0 + slip) + rate * offset
    if rolls_m > 0.0:  # the aft hang-off heaves unlike the other, as the ship rolls
        w = 2.0 * np.pi / 9.0
        grows = np.clip(t / 10.0, 0.0, 1.0)
        own = own - (rolls_m * grows * np.sin(w * t))[:, None]
        own_rate = own_rate - np.gradient(rolls_m * grows * np.sin(w * t), t)[:, None]
    fleet = Fleet(two_lines(length_m), len(thetas), elements=elements, step_s=step_s)
    fleet.set_figures(factors_of(thetas))
    inputs = FleetInputs(z, v, fore, fore_rate, {AFT: (own, own_rate)})
    record = fleet.advance(inputs, interval_steps=100)
    assert not record.failures
    rng, every, made = np.random.default_rng(seed + 1), round(SENSOR_S / step_s) or 1, []
    first = int(np.argmin(np.abs(t)))  # the sensors are heard from there on
    heard = slice(first, None, every)
    for k, theta in enumerate(thetas):
        lift = MeasuredLift(prior().pin_noise_n)
        lift.others[AFT] = MeasuredLift(np.nan)
        lift.heave.extend(t[heard], z[heard], v[heard])
        for rope, winch, name, line in zip(
            lift.ropes, ("", AFT), ("fore", "aft"), (fore, aft), strict=True
        ):
            noise_n = prior().pin_noise_n * prior().ranges.get(winch, 1.0)
            bias, gain = (theta[prior().names.index(of_winch(winch, one))] for one in (BIAS, GAIN))
            tension = (1.0 + gain) * record.suspended_tension_n[name][:, k] + bias
            noise = noise_n * rng.standard_normal(len(t) - 1)
            rope.tension.extend(t[1:][heard], (tension + noise)[heard])
            rope.line_out.extend(t[heard], line[heard])
        made.append(lift)
    return made


def learned(lift: MeasuredLift, length_m: float = 600.0) -> Estimator:
    """An estimator that has learned all of a lift."""
    made = begin_at_rest(two_lines(length_m), lift, tared=True)
    made.run()
    return made


@pytest.mark.long
def test_figures_of_a_load_on_two_winches_are_covered() -> None:
    """90 % intervals of truths drawn by seed, in heave of other seeds, hold 83 to 97 %."""
    inside, off = [], []
    names = (*ROPE_FIGURES[:6], *SENSORS)
    places = [prior().names.index(name) for name in names]
    for seed in (11, 12):
        thetas = drawn(8, seed)
        for theta, lift in zip(thetas, measured(thetas, seed, STEP_S, 40, 0.03), strict=True):
            last = learned(lift).results[-1]
            error = (last.posterior.mean - theta)[places]
            sd = last.posterior.sd[places]
            inside.append(np.abs(error) < NORMAL_90 * sd)
            off.append(error / sd)
    covered = float(np.mean(inside))
    assert 0.83 <= covered <= 0.97
    assert np.abs(off).max() < 3.5


def short(fault: Callable[[Floats, Floats], Floats] | None = None) -> MeasuredLift:
    """A truth on the model's own mesh, with a fault in the tension of the aft pin."""
    lift = measured(drawn(1, 3), 3, 0.05, 20)[0]
    if fault is not None:
        times, values = lift.others[AFT].tension.table.T
        lift.others[AFT].tension = Series(1)
        lift.others[AFT].tension.extend(times, fault(times, values))
    return lift


def test_pins_have_errors_of_their_own_and_share_the_load() -> None:
    """Names, tares and static tensions of both; weight and mass of the module count once."""
    own = prior()
    assert own.ranges[AFT] == pytest.approx(1.0, rel=0.05)  # the current pulls
    assert own.names[len(NAMES) :] == tuple(of_winch(AFT, name) for name in WINCH_FIGURES)
    assert len(own.biases) == 2
    for k, sd in own.biases:
        assert own.sd[k] == pytest.approx(sd)
    weight_n = 9.80665 * (25000.0 - 5.0 * 1025.0)
    assert hanging_of(two_lines()).weight_n == pytest.approx(weight_n)
    assert sum(bar.end_mass_kg for bar in bars_of(two_lines())) == pytest.approx(
        hanging_of(two_lines()).mass_kg
    )
    metre_n = (sum(static_tops_n(two_lines())) - weight_n) / 1200.0
    assert metre_n == pytest.approx(static_metre_n(), rel=0.01)


@pytest.mark.parametrize(("length_m", "step_s"), [(600.0, 0.05), (120.0, 0.025), (50.0, 0.0125)])
def test_members_step_a_tenth_of_a_radian_of_the_first_axial_mode(
    length_m: float, step_s: float
) -> None:
    """A mass on springs, 2π·√((M + m/3)/(2·EA/L)): 3.6, 1.6 and 1.0 s.

    M is the module with its added mass, m both ropes, EA their stiffness.
    """
    bars = bars_of(two_lines(length_m))
    M, m = hanging_of(two_lines()).mass_kg, 2.0 * length_m * bars[0].mass_kg_per_m[0]
    omega = np.sqrt(2.0 * bars[0].EA_n[0] / length_m / (M + m / 3.0))
    assert first_axial_period_s(bars) == pytest.approx(2.0 * np.pi / omega, rel=1e-6)
    assert step_of(bars) == pytest.approx(step_s, rel=1e-9)
    assert omega * step_s < 0.1
    assert omega * 2.0 * step_s > 0.1


@pytest.mark.long
def test_mass_and_stiffness_of_short_ropes_have_no_common_error() -> None:
    """On 120 m (axial period 1.6 s) the median errors of eight truths are below 0.8 %, their sd.

    With a line that was smoothed as a cubic and steps of 50 ms they were 1.1 and 1.3 %.
    """
    thetas = drawn(8, 11)
    lifts = measured(thetas, 11, 0.01, 40, length_m=120.0)
    last = [learned(lift, 120.0).results[-1].posterior.mean for lift in lifts]
    error = np.median(np.array(last) - thetas, axis=0)
    assert abs(error[INDEX["oscillating_mass"]]) < 0.008
    assert abs(error[INDEX["axial_stiffness"]]) < 0.008


def test_a_period_far_off_is_found_in_the_first_minute() -> None:
    """A rope of 85 m rings 39 times in the minute, by its scene 44 times.

    From the scene's figures alone the search ends in a minimum between them, with a NIS of 740.
    """
    theta = drawn(1, 3)[0]
    m, k = INDEX["oscillating_mass"], INDEX["axial_stiffness"]
    theta[m], theta[k] = 1.3 * prior().sd[m], -1.3 * prior().sd[k]
    estimator = begin_at_rest(
        two_lines(85.0), measured(theta[None], 3, 0.0125, 20, length_m=85.0)[0], tared=True
    )
    (block,) = estimator.run(121.0)
    error = (block.posterior.mean - theta) / block.posterior.sd
    assert block.nis < 1.5
    assert np.abs(error[[m, k]]).max() < 3.0
    assert abs(error[m] - error[k]) < 3.0


def test_a_coarse_counter_of_a_stiff_rope_has_a_remark() -> None:
    """A quintic over 15 samples leaves 0.24 of the variance Δ²/12 of its rounding, times EA/L."""
    bars = bars_of(two_lines(120.0))
    lift = MeasuredLift(1.0)
    lift.others[AFT] = MeasuredLift(np.nan)
    for rope in lift.ropes:
        rope.line_out.extend(np.arange(3.0), 120.0 + 0.01 * np.arange(3.0))
    left_n = bars[0].EA_n[0] / 120.0 * 0.01 * np.sqrt(11063.0 / 46189.0 / 12.0)
    assert report.counter_words(bars, lift, np.full(2, left_n / 0.69)) == []
    (words,) = report.counter_words(bars, lift, np.array([left_n / 0.69, left_n / 0.71]))
    assert f"its rounding is {left_n * 1e-3:.2g} kN" in words


def static_metre_n() -> float:
    """Weight of a metre of the rope in water, by the tension of a bare rope."""
    made = alone(two_lines(), 0)
    return lift_figures(made).rope_weight_n_per_m


def test_errors_of_the_share_leave_the_sum() -> None:
    """Unlike lengths of three ropes move the load between them; the sum of tensions stays."""
    K = np.array([1e5, 2e5, 4e4])
    psd = np.where(np.abs(FREQUENCY_HZ - 0.1) < 0.02, 5.0, 0.0)
    for colour in share_autocovariances(K, psd, 8, 0.25):
        assert np.abs(colour.sum(axis=0)).max() < 1e-9 * colour.max()
        sds_n = np.sqrt(colour[range(3), range(3), 0])
        assert (sds_n > 0.0).all()
    slow = share_autocovariances(np.array([1e5, 1e5]), psd, 8, 0.25)[0]
    assert slow[0, 0, 0] == pytest.approx(2.0 * (0.5e5 * SHARE_ERROR_M) ** 2)
    assert share_autocovariances(K[:1], psd, 8, 0.25).shape == (0, 1, 1, 8)


def test_both_pins_tell_the_weight_and_one_alone_little() -> None:
    """One minute: with both the weight is in its interval; one alone says so and knows less."""
    k, theta = INDEX["submerged_weight"], drawn(1, 3)[0]
    both = begin_at_rest(two_lines(), short(), tared=True)
    both.run(121.0)
    last = both.results[-1]
    assert last.used_of_pins == (1.0, 1.0)
    assert abs(last.posterior.mean[k] - theta[k]) < 2.5 * last.posterior.sd[k]
    assert last.posterior.sd[k] < 0.3 * prior().sd[k]
    lift = short()
    lift.tension = Series(1)
    one = begin_at_rest(two_lines(), lift, tared=True)
    one.run(121.0)
    alone_of = one.results[-1]
    assert alone_of.used_of_pins == (0.0, 1.0)
    assert alone_of.used == 1.0
    assert alone_of.posterior.sd[k] > 2.0 * last.posterior.sd[k]
    assert report.not_measured(lift) == [
        "no tension of the main winch: learned from the other load pins alone"
    ]
    found = report.estimates(report.base_values(two_lines()), prior(), last.posterior)
    own = {one.name: one for one in found}
    assert own[f"{AFT}/line_offset"].unit == "m"
    printed = report.as_json(found, both.results, {}, both.model.winches)
    assert printed["pins"] == ["winch", AFT]
    assert printed["blocks"][0]["used_of_pins"] == [1.0, 1.0]


def test_a_stuck_pin_of_the_other_winch_is_found() -> None:
    """The plain rules hear each load pin, and name whose it is."""
    lift = short(lambda t, y: np.where(t > 90.0, y[np.searchsorted(t, 90.0)], y))
    estimator = begin_at_rest(two_lines(), lift, tared=True)
    alarm = FaultWatch(two_lines(), estimator).advance(100.0)
    assert alarm is not None
    assert alarm.causes == (f"load pin stuck ({AFT})",)
    assert alarm.begun_s == pytest.approx(90.0, abs=0.2)


@pytest.mark.long
@pytest.mark.parametrize("offset_n", [0.0, 8000.0])
def test_an_offset_of_the_other_pin_is_named(offset_n: float) -> None:
    """Two learned minutes, then its zero moves: found in seconds, and not taken for a slip."""
    lift = short(lambda t, y: np.where(t > 200.0, y + offset_n, y))
    estimator = begin_at_rest(two_lines(), lift, tared=True)
    watch = FaultWatch(two_lines(), estimator)
    for now in np.arange(1.0, SECONDS - 1.0):
        watch.advance(float(now))
        if not watch.frozen and estimator.block_end_s <= now:
            estimator.run(float(now))
            watch.learned(estimator)
        assert now > 200.0 or watch.alarm is None
    if offset_n == 0.0:
        assert watch.alarm is None
        return
    assert watch.alarm is not None
    assert watch.alarm.found_s < 206.0
    assert watch.alarm.causes[0] == f"load pin offset ({AFT})"


@pytest.mark.long
def test_a_live_twin_learns_from_both_pins() -> None:
    """From its state: the weight lies within 3 sd, no fault is seen, the factors are accepted."""
    twin, lift = Twin(two_lines()), short()
    learner = Learner(two_lines())
    watch = AlarmTask(two_lines(), learner)
    learner.tare()
    learner.take(Restart(live_state(twin)))
    lines = [one.line_out.table[:, 1] for one in lift.ropes]
    for (t, z, v), fore, aft in zip(lift.heave.table, *lines, strict=True):
        learner.take(Motion(t, z, v, fore, (aft,)))
    for one, winch in zip(lift.ropes, ("", AFT), strict=True):
        for t, force in one.tension.table:
            learner.take(Reading(t, force, winch=winch))
    while learner.work():
        watch.work()
    assert learner.trouble == ""
    assert watch.newest is None
    newest = learner.newest
    assert newest is not None
    own = {one.name: one for one in newest.figures}
    weight, k = own["submerged_weight"], INDEX["submerged_weight"]
    truth_n = weight.prior * np.exp(drawn(1, 3)[0, k])
    assert abs(np.log(weight.value / truth_n)) < 3.0 * weight.sd
    assert own[f"{AFT}/line_offset"].state == report.LEARNED
    assert not twin.submit_figures(ramp_s=20.0, **learner.factors_to_apply())


def test_readings_of_a_live_twin_go_to_their_winch() -> None:
    """By hang-off or rope; the motion of both lines comes with each snapshot."""
    twin = Twin(two_lines())
    learning = LiveLearning(two_lines(), InputQueue(twin, twin))
    twin.advance(10)
    learning.see(twin.snapshot())
    rows = (("aft", 600.0, 0.0, 170e3), ("", 600.5, 0.0, 165e3), ("else", 1.0, 0.0, 1.0))
    learning.hear(Measurement(WINCH_SENSORS, 1_000_000_000, rows))
    learning.worker.work()
    lift = learning.learner._lift
    assert [one.tension.table[0, 1] for one in lift.ropes] == [165e3, 170e3]
    assert [one.line_out.table[0, 1] for one in lift.ropes] == pytest.approx(
        [600.0, 600.0], abs=0.1
    )


def test_a_bag_has_both_winches(tmp_path: Path) -> None:
    """Rows of winch/measured go by hang-off or rope; a winch of another name is the main one."""
    at = np.arange(0.0, 20.0, 0.1)
    topics = [BY_NAME[name] for name in (WINCH_MEASURED, "ship/heave")]
    with BagWriter(tmp_path / "bag", topics) as bag:
        for t in at.tolist():
            ns = START_NS + round(t * 1e9)
            rows = ("crane", 600.0, 0.0, 1e5 + t), (AFT, 600.0, 0.0, 2e5 + t)
            name, data = encode_measurement(ns, Measurement(WINCH_SENSORS, ns, rows))
            bag.write(name, ns, data)
            bag.write("ship/heave", ns, encode_heave(ns, np.sin(t), np.cos(t)))
    lift = read_lift(tmp_path / "bag", scene=two_lines()).lift
    assert lift.tension.table[0].tolist() == [0.0, 1e5]
    assert lift.others[AFT].tension.table[0].tolist() == [0.0, 2e5]


def test_line_out_that_is_not_measured_is_that_of_the_winch_s_own_rope(tmp_path: Path) -> None:
    """By name, whatever the order in ropes/length; of a rope of another name it is unknown."""
    line = joint_state(("aft_line", "fore_line"), ("position",))
    line.position = np.array([610.0, 600.0])
    bags = {name: tmp_path / name for name in ("own", "other")}
    topics = [BY_NAME[name] for name in (WINCH_MEASURED, "ship/heave", "ropes/length")]
    for kind, path in bags.items():
        if kind == "own":
            line.name = [one.name for one in reversed(two_lines().ropes[:2])]
        else:
            line.name = ["hoist", "tugger"]
        with BagWriter(path, topics) as bag:
            for k in range(200):
                ns = START_NS + k * 100_000_000
                rows = ("winch", None, None, 1e5), (AFT, None, None, 2e5)
                name, data = encode_measurement(ns, Measurement(WINCH_SENSORS, ns, rows))
                bag.write(name, ns, data)
                bag.write("ship/heave", ns, encode_heave(ns, 0.1 * k, 0.0))
                line.header.stamp = templates.time(ns)
                bag.write("ropes/length", ns, serialise(line))
    lift = read_lift(bags["own"], scene=two_lines()).lift
    assert lift.line_out.table[0, 1] == 600.0
    assert lift.others[AFT].line_out.table[0, 1] == 610.0
    with pytest.raises(BagError, match="0 samples of line out"):
        read_lift(bags["other"], scene=two_lines())
    with pytest.raises(InputError, match=f"winch '{AFT}': it carries the load with the main one"):
        read_lift(bags["own"], AFT, two_lines())


@pytest.mark.long
def test_learn_prints_both_pins(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Figures of both winches, what a tare and manoeuvres of both would tell, and their shares."""
    lift = short()
    topics = [BY_NAME[name] for name in (WINCH_MEASURED, "ship/heave")]
    with BagWriter(tmp_path / "bag", topics) as bag:
        for t, z, v in lift.heave.table:
            ns = START_NS + round(t * 1e9)
            bag.write("ship/heave", ns, encode_heave(ns, z, v))
        tables = [table for one in lift.ropes for table in (one.line_out.table, one.tension.table)]
        for (t, fore), (_, fore_n), (_, aft), (_, aft_n) in zip(*tables, strict=False):
            ns = START_NS + round(t * 1e9)
            rows = ("winch", fore, 0.0, fore_n), (AFT, aft, 0.0, aft_n)
            name, data = encode_measurement(ns, Measurement(WINCH_SENSORS, ns, rows))
            bag.write(name, ns, data)
    words = ["learn", str(tmp_path / "bag"), "--scene", "two_line_lift", "--json"]
    assert main(words) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["pins"] == ["winch", AFT]
    assert printed["alarm"] is None
    assert printed["remarks"] == []
    own = {one["name"]: one for one in printed["figures"]}
    assert own[f"{AFT}/line_offset"]["state"] == "learned"
    assert f"{AFT}/tension_bias" in own
    assert "tare" in own["submerged_weight"]["advice"]
    assert len(printed["blocks"][-1]["used_of_pins"]) == 2
