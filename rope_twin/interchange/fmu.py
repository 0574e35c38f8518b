"""FMU 3.0 for co-simulation of a scene: its model in Python, and its export by PythonFMU3.

The FMU contains the scene's file and a module of three lines; the twin is the installed
rope_twin of the Python that loads it. Inputs are displacement, velocity and acceleration of the
hang-off, and of the lower end if the scene leaves that to another simulator, at the time of the
step's beginning. From these they are extrapolated over the step: p + v·h + a·h²/2, so that a step's
error is of the third order in h (of the second without a, of the first without v). Outputs are
those at the step's end.
"""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path
from typing import Any

from rope_twin.errors import InputError, RopeTwinError, require
from rope_twin.scene.load import load_scene
from rope_twin.scene.rigging import is_joined
from rope_twin.scene.schema import Scene
from rope_twin.twin.motion.ship_motion import ShipPose, Vector3
from rope_twin.twin.snapshot import SPEED, Snapshot
from rope_twin.twin.twin import Twin
from rope_twin.twin.winch.commands import WinchCommand

AXES = "xyz"  # east, north, up
MOTION = {"{}_{}_m": "displacement", "{}_v{}_m_per_s": "velocity",
          "{}_a{}_m_per_s2": "acceleration"}  # fmt: skip
TIP_INPUTS, LOWER_INPUTS = (
    {
        name.format(end, axis): f"{what} of {point} along {axis}"
        for name, what in MOTION.items()
        for axis in AXES
    }
    for end, point in (("tip", "the hang-off"), ("low", "the rope's lower end"))
)
INPUTS = TIP_INPUTS | {"winch_speed_m_per_s": "commanded speed, positive: pay-out"}
LOWER_OUTPUTS = {f"low_force_{axis}_n": f"force on what holds the lower end along {axis}"
                 for axis in AXES}  # fmt: skip
OUTPUTS = {
    **{f"hook_force_{axis}_n": f"force on the hang-off along {axis}" for axis in AXES},
    "hook_load_n": "tension at the hang-off",
    "payload_tension_n": "tension at the lower end",
    **{f"payload_{axis}_m": f"position of the payload, {axis}" for axis in AXES},
    "line_out_m": "paid-out length",
    "min_tension_n": "minimum tension of any element",
}
# names of FMI's units by the ends of the variables' names, longest first, with their SI exponents
UNITS = {
    "_m_per_s2": ("m/s2", {"m": 1, "s": -2}),
    "_m_per_s": ("m/s", {"m": 1, "s": -1}),
    "_m": ("m", {"m": 1}),
    "_n": ("N", {"kg": 1, "m": 1, "s": -2}),
}
STEP_TOL = 1e-6  # of a time step
SCRIPT = '''"""FMU of scene {scene}, by rope_twin."""

from pythonfmu3 import Fmi3Slave
from rope_twin.interchange.fmu import SceneModel, register


class {name}(Fmi3Slave):
    """Rope, winch and payload of {scene}."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.model = SceneModel(kwargs["resources"], "{file}")
        register(self)

    def do_step(self, current_time, step_size):
        return self.model.step_into(self, current_time, step_size)
'''


def inputs_of(scene: Scene) -> dict[str, str]:
    """Return what each input of a scene's FMU is; those of the lower end, where it is led."""
    return INPUTS | LOWER_INPUTS if scene.ropes[0].is_led else INPUTS


def outputs_of(scene: Scene) -> dict[str, str]:
    """Return what each output of a scene's FMU is."""
    return OUTPUTS | LOWER_OUTPUTS if scene.ropes[0].end_motion is not None else OUTPUTS


class SceneModel:
    """Twin of an FMU, stepped from one communication point to the next."""

    def __init__(self, folder: str, file: str) -> None:
        """Build the twin of the scene's file in the FMU's resources.

        Raises:
            RopeTwinError: the scene is invalid.
        """
        path = folder.removeprefix("file://")
        self.twin = Twin(load_scene(Path(path) / file))
        self.twin.prescribe_motion()
        self._speed: float | None = None
        self.snapshot: Snapshot = self.twin.snapshot()

    def step(self, inputs: dict[str, float], time_s: float, step_s: float) -> None:
        """Advance from a communication point by this step.

        Raises:
            InputError: the step is no whole number of time steps, or an input is impossible.
            SolverError: the next state would not be finite.
        """
        twin, steps = self.twin, round(step_s / self.twin.step_s)
        if steps < 1 or abs(steps * twin.step_s - step_s) > STEP_TOL * twin.step_s:
            remedy = f"give a multiple of the scene's time step, {twin.step_s:g} s"
            raise InputError("FMU", f"a communication step of {step_s:g} s", remedy)
        at_ns, until_ns = twin.time_ns, twin.time_ns + steps * twin.step_ns
        if abs(time_s - at_ns * 1e-9) > STEP_TOL:
            problem = f"a step from {time_s:g} s, where the twin is at {at_ns * 1e-9:g} s"
            raise InputError("FMU", problem, "step without gaps, from 0 on")
        now, ahead = _motion(inputs, "tip", 0.0), _motion(inputs, "tip", step_s)
        if at_ns == 0:
            _raise_refusal(twin.submit_pose(ShipPose(0, *now)))
        _raise_refusal(twin.submit_pose(ShipPose(until_ns, *ahead)))
        line = twin.scene.ropes[0]
        if line.is_led and line.fixed_at_m is not None:
            a, b, c = line.fixed_at_m
            (x, y, z), rate = _motion(inputs, "low", step_s)
            _raise_refusal(twin.submit_lower_end(until_ns, (a + x, b + y, c + z), rate))
        speed = inputs["winch_speed_m_per_s"]
        if twin.scene.winch is not None and speed != self._speed:
            _raise_refusal(twin.submit_command(at_ns, WinchCommand(SPEED, speed)))
            self._speed = speed
        twin.advance(steps)
        self.snapshot = twin.snapshot()

    def outputs(self) -> dict[str, float]:
        """Return the outputs at the present."""
        snapshot = self.snapshot
        force, place = snapshot.hang_off_force_n.tolist(), snapshot.payload_position_m.tolist()
        return {
            **{f"hook_force_{axis}_n": value for axis, value in zip(AXES, force, strict=True)},
            "hook_load_n": float(snapshot.tension_top_n),
            "payload_tension_n": float(snapshot.tension_payload_n),
            **{f"payload_{axis}_m": value for axis, value in zip(AXES, place, strict=True)},
            "line_out_m": float(snapshot.line_out_m),
            "min_tension_n": float(snapshot.element_tension_n.min()),
            **{
                f"low_force_{axis}_n": value
                for axis, value in zip(AXES, snapshot.lower_end_force_n, strict=False)
            },
        }

    def step_into(self, slave: Any, time_s: float, step_s: float) -> bool:
        """Advance with the slave's inputs and set its outputs; False, and logged, if it fails."""
        try:
            inputs = inputs_of(self.twin.scene)
            self.step({name: float(getattr(slave, name)) for name in inputs}, time_s, step_s)
        except RopeTwinError as error:
            from pythonfmu3.enums import Fmi3Status  # of the FMU that calls

            slave.log(str(error), Fmi3Status.error)
            return False
        for name, value in self.outputs().items():
            setattr(slave, name, value)
        return True


def _motion(inputs: dict[str, float], end: str, after_s: float) -> tuple[Vector3, Vector3]:
    """Return displacement [m] and velocity [m/s] of an end this long after the inputs."""
    p, v, a = ([inputs[name.format(end, axis)] for axis in AXES] for name in MOTION)
    x, y, z = (s + after_s * (u + 0.5 * after_s * w) for s, u, w in zip(p, v, a, strict=True))
    r, s, t = (u + after_s * w for u, w in zip(v, a, strict=True))
    return (x, y, z), (r, s, t)


def unit_of(name: str) -> str:
    """Return the unit of a variable of the FMU, by the end of its name."""
    return next(unit for end, (unit, _) in UNITS.items() if name.endswith(end))


def _raise_refusal(refusal: str) -> None:
    if refusal:
        raise InputError(refusal)


def register(slave: Any) -> None:
    """Register the variables of an FMU and their units on its slave, with values at the start."""
    from pythonfmu3 import Float64, Fmi3Causality, Fmi3Variability, Unit  # of the FMU that calls

    slave.time = 0.0
    slave.author = "rope_twin"
    slave.register_units([Unit("s", s=1), *(Unit(unit, **si) for unit, si in UNITS.values())])
    independent = {"causality": Fmi3Causality.independent,
                   "variability": Fmi3Variability.continuous}  # fmt: skip
    slave.register_variable(Float64("time", unit="s", **independent))
    scene = slave.model.twin.scene
    inputs, outputs, abouts = inputs_of(scene), slave.model.outputs(), outputs_of(scene)
    variables = [(name, 0.0, Fmi3Causality.input, about) for name, about in inputs.items()]
    variables += [
        (name, value, Fmi3Causality.output, abouts[name]) for name, value in outputs.items()
    ]
    for name, value, causality, about in variables:
        setattr(slave, name, value)
        unit = unit_of(name)
        slave.register_variable(Float64(name, unit=unit, causality=causality, description=about))


def export_fmu(name_or_path: str, out: Path) -> Scene:
    """Write the FMU of a scene of one rope and return the scene.

    Raises:
        InputError: PythonFMU3 is not installed, the file is no FMU or cannot be written, or ropes
            meet.
        SceneError: the scene is invalid, or names files beside it.
    """
    if out.suffix != ".fmu" or not out.stem.isidentifier():
        remedy = "give a name of letters, digits and _ that ends with .fmu"
        raise InputError(f"--out {out}", "it is no name of an FMU", remedy)
    require("pythonfmu3", "an FMU needs it and it is not there", "fmu")
    scene = load_scene(name_or_path)
    if is_joined(scene):
        raise InputError("FMU", f"the ropes of '{scene.name}' meet", "give a scene of one rope")
    from pythonfmu3 import FmuBuilder  # an optional package

    with tempfile.TemporaryDirectory(prefix="rope_twin_fmu_") as folder:
        script, scene_copy = Path(folder) / f"{out.stem}_model.py", Path(folder) / scene.path.name
        shutil.copy(scene.path, scene_copy)
        source = SCRIPT.format(scene=scene.name, name=out.stem, file=scene_copy.name)
        script.write_text(source, encoding="utf-8")
        built = FmuBuilder.build_FMU(script, dest=folder, project_files=[scene_copy])
        try:
            shutil.copy(built, out)
        except OSError as error:
            problem = f"it cannot be written ({error.strerror})"
            raise InputError(str(out), problem, "give a place that can be written") from None
    return scene
