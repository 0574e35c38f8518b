"""Co-simulation over DDS: the twin steps only to the time that a master has published."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from ros_bench import Bench

from rope_twin.messages import encode_heave, encode_lower_end
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import EndHarmonic, EndMotion, RegularHeave, SeaState
from rope_twin.studies.driven_twin import fed
from rope_twin.twin.motion.heave_track import ramp
from rope_twin.twin.twin import Twin

pytestmark = pytest.mark.ros
AMPLITUDE_M, OMEGA = 0.3, 2.0 * math.pi / 6.0
START_NS, SLOT_NS, SLOTS = 500_000_000_000, 20_000_000, 40


def heave(time_s: float) -> tuple[float, float]:
    """Return height and speed of the hang-off."""
    return AMPLITUDE_M * math.sin(OMEGA * time_s), AMPLITUDE_M * OMEGA * math.cos(OMEGA * time_s)


class Master:
    """Master of a co-simulation on the bench."""

    def __init__(self, bench: Bench) -> None:
        from rosgraph_msgs.msg import Clock

        self._bench, self._kind = bench, Clock
        self._clock = bench.own.create_publisher(Clock, "/clock", 10)
        self._motion = bench.publisher("ship/heave")
        self.force = bench.listen("hang_off/wrench")
        self.epochs = bench.listen("twin/epoch")

    def tick(self, at_ns: int) -> None:
        """Publish the time."""
        message = self._kind()
        message.clock.sec, message.clock.nanosec = divmod(START_NS + at_ns, 10**9)
        self._clock.publish(message)

    def move(self, at_ns: int) -> None:
        """Publish the motion of the ship at a time."""
        self._motion.publish(encode_heave(START_NS + at_ns, *heave(at_ns * 1e-9)))

    def begin(self, node: Any) -> None:
        """Start the twin at the master's time 0."""
        node.begin()

        def begun() -> bool:
            self.tick(0)
            return bool(self.epochs) and self._motion.get_subscription_count() > 0

        self._bench.until(begun, "the epoch")
        stamp = self.epochs[0]
        assert stamp.sec * 10**9 + stamp.nanosec == START_NS

    def answered(self, at_ns: int) -> bool:
        """Return whether the force at a time has come."""
        stamps = (one.header.stamp for one in reversed(self.force))
        return any(stamp.sec * 10**9 + stamp.nanosec == START_NS + at_ns for stamp in stamps)


def lockstepped(bench: Bench, **parameters: Any) -> Any:
    """Return a simulation node that waits for a master."""
    return bench.make("simulation", scene="shallow_lift", use_sim_time=True, lockstep=True,
                      overload_protection=False, **parameters)  # fmt: skip


def test_twin_steps_to_the_time_of_the_master_alone(bench: Bench) -> None:
    """Neither real time nor motion without a granted time moves it, nor the time without motion;
    the result is that of the same motion in a scene.
    """
    node, master = lockstepped(bench), Master(bench)
    master.begin(node)
    twin = node.paced.twin
    for at_ns in (-SLOT_NS, 0, SLOT_NS):
        master.move(at_ns)
    bench.until(lambda: node.paced.border.motion_ns == SLOT_NS, "the motion")
    bench._spin(0.2)
    assert twin.time_ns == 0, "no time is granted"
    master.tick(2 * SLOT_NS)
    bench.until(lambda: master.answered(SLOT_NS), "the first answer")
    bench._spin(0.2)
    assert twin.time_ns == SLOT_NS, "the motion is not known further"
    for k in range(2, SLOTS + 1):
        at_ns = k * SLOT_NS

        def answered(at_ns: int = at_ns) -> bool:
            master.move(at_ns)
            master.tick(at_ns)
            return master.answered(at_ns)

        bench.until(answered, f"the answer at {at_ns * 1e-9:g} s")
        assert twin.time_ns == at_ns
    scene = load_scene("shallow_lift")
    assert scene.winch is not None
    sea = SeaState(heave=RegularHeave(amplitude_m=AMPLITUDE_M, period_s=6.0))
    same = replace(scene, sea_state=sea, winch=replace(scene.winch, schedule=()))
    right = list(fed(Twin(same), SLOTS * SLOT_NS * 1e-9))
    forces = {one.header.stamp.sec * 10**9 + one.header.stamp.nanosec: one for one in master.force}
    for snapshot in right:
        force = forces[START_NS + snapshot.stamp_ns].wrench.force
        assert force.z == pytest.approx(float(snapshot.hang_off_force_n[2]), rel=1e-8)


def test_a_master_that_begins_again_is_followed(bench: Bench) -> None:
    """A clock that goes back is reported; from the next start on its time alone is granted."""
    node, master = lockstepped(bench), Master(bench)
    said = bench.listen("diagnostics")

    def clocks() -> str:
        return next((str(row.message) for message in reversed(said) for row in message.status
                     if row.name == "simulation: clocks"), "")  # fmt: skip

    master.begin(node)
    twin = node.paced.twin
    bench.until(lambda: "waiting for motion" in clocks(), "what it waits for")

    def reached(at_ns: int) -> bool:
        master.move(at_ns)
        master.tick(at_ns)
        return bool(twin.time_ns == 3 * SLOT_NS)

    for at_ns in (-SLOT_NS, 0, 3 * SLOT_NS):
        master.move(at_ns)
    bench.until(lambda: reached(3 * SLOT_NS), "the first steps")
    bench.until(lambda: "waiting for /clock beyond 500.060 s" in clocks(), "the same of the time")
    back_ns = -400 * 10**9
    master.tick(back_ns)
    bench.until(lambda: "gone back from 500.060 s to 100.000 s" in clocks(), "the step back")
    node.trigger_deactivate()
    master.epochs.clear()
    node.trigger_activate()
    bench.until(lambda: master.epochs, "the new epoch")
    epoch = master.epochs[0]
    assert epoch.sec * 10**9 + epoch.nanosec == START_NS + back_ns - 3 * SLOT_NS
    for k in range(100):  # far more motion than time is granted
        master.move(back_ns + k * SLOT_NS)
    bench.until(lambda: node.paced.border.motion_ns == 102 * SLOT_NS, "the motion")
    bench._spin(0.3)
    assert twin.time_ns == 3 * SLOT_NS, "the time of before is no longer granted"
    master.tick(back_ns + SLOT_NS)
    bench.until(lambda: twin.time_ns == 4 * SLOT_NS, "the next step")


def test_lower_end_is_held_by_the_master(bench: Bench, tmp_path: Path) -> None:
    """An ROV on a tether, of which the master knows the motion: the twin waits for it, and the
    force on the ROV is that of the same motion in a scene.
    """
    amplitude = (AMPLITUDE_M, -0.1, 0.2)
    text = load_scene("rov_tether").path.read_text()
    for old, new in (("-860.0]", "-860.0]\n    end_motion: {from_outside: true}"),
                     ("sea_state: {bag: sea_2p5m}\n", ""), ("step_s: 0.01", "step_s: 0.02"),
                     ("elements: 50", "elements: 12")):  # fmt: skip
        assert old in text
        text = text.replace(old, new, 1)
    (tmp_path / "led.yaml").write_text(text)
    node = bench.make("simulation", scene=str(tmp_path / "led.yaml"), use_sim_time=True,
                      lockstep=True, overload_protection=False)  # fmt: skip
    master, motion = Master(bench), bench.publisher("lower_end/odometry")
    forces = bench.listen("lower_end/wrench")
    scene = load_scene(tmp_path / "led.yaml")
    line, place = scene.ropes[0], scene.ropes[0].fixed_at_m
    assert place is not None

    def share(time_s: float) -> tuple[float, float]:
        value, slope = ramp(time_s, 1.0)
        s, c = math.sin(OMEGA * time_s), OMEGA * math.cos(OMEGA * time_s)
        return value * s, slope * s + value * c

    def move(at_ns: int) -> None:
        moved, speed = share(at_ns * 1e-9)
        at = tuple(x + moved * a for x, a in zip(place, amplitude, strict=True))
        motion.publish(encode_lower_end(START_NS + at_ns, at, [speed * a for a in amplitude]))

    def answered(at_ns: int) -> bool:
        stamps = (one.header.stamp for one in reversed(forces))
        return any(one.sec * 10**9 + one.nanosec == START_NS + at_ns for one in stamps)

    master.begin(node)
    master.tick(5 * SLOT_NS)
    bench._spin(0.2)
    assert node.paced.twin.time_ns == 0, "the motion of the lower end is not known"
    for k in range(SLOTS + 1):
        at_ns = k * SLOT_NS

        def done(at_ns: int = at_ns) -> bool:
            move(at_ns)
            master.tick(at_ns)
            newest_ns = node.paced.border.lower_end_ns
            return answered(at_ns) if at_ns else newest_ns is not None

        bench.until(done, f"the answer at {at_ns * 1e-9:g} s")
        assert node.paced.twin.time_ns == at_ns
    own = EndMotion(harmonics=(EndHarmonic(amplitude_m=amplitude, period_s=6.0),), ramp_s=1.0)
    assert scene.winch is not None
    same = replace(scene, ropes=(replace(line, end_motion=own),),
                   winch=replace(scene.winch, schedule=()))  # fmt: skip
    by_stamp = {one.header.stamp.sec * 10**9 + one.header.stamp.nanosec: one.wrench.force
                for one in forces}  # fmt: skip
    twin = Twin(same)
    for k in range(1, SLOTS + 1):
        twin.advance(1)
        found, right = by_stamp[START_NS + k * SLOT_NS], twin.snapshot().lower_end_force_n
        apart = max(abs(a - b) for a, b in zip((found.x, found.y, found.z), right, strict=True))
        assert apart <= 1e-8 * math.hypot(*right)


def test_lockstep_needs_simulated_time(bench: Bench) -> None:
    """One sentence."""
    from rope_twin.errors import InputError

    node = bench.make("simulation", scene="shallow_lift", lockstep=True)
    with pytest.raises(InputError, match="lockstep: it needs the time of /clock; set use_"):
        node.begin()


def test_master_of_the_guide(bench: Bench) -> None:
    """The example in docs/how-to/cosimulation.md, in a process of its own, 25 cycles long."""
    page = Path(__file__).parents[2] / "docs" / "how-to" / "cosimulation.md"
    script = page.read_text(encoding="utf-8").partition("```python\n")[2].partition("```")[0]
    assert script.count("\n") < 45
    node = lockstepped(bench)
    node.begin()
    domain = bench.own.context.get_domain_id()
    with subprocess.Popen(
        [sys.executable, "-c", script.replace("range(501)", "range(26)")],
        env=os.environ | {"ROS_DOMAIN_ID": str(domain)},
    ) as master:
        try:
            bench.until(lambda: master.poll() is not None, "the master's end")
        finally:
            master.kill()
    assert master.returncode == 0
    assert node.paced.twin.time_ns == 25 * SLOT_NS
    assert node.paced.last.heave_m != 0.0
