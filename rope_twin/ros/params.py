"""Parameters of every node, a frozen dataclass each, and their declaration.

A parameter is a field with `quantity` (a number with unit and range) or `text` (text and
switches). The same metadata becomes the ROS descriptor that `ros2 param describe` prints.
"""

from __future__ import annotations

import dataclasses
import math
import typing
from typing import Any, TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter

from rope_twin.errors import InputError, did_you_mean, phrase
from rope_twin.quantity import Quantity, quantity, text
from rope_twin.run.options import SPEED_HIGH, SPEED_LOW, RunOptions
from rope_twin.run.seat import PRIORITY

P = TypeVar("P")

_TYPES = {bool: "true or false", int: "a whole number", float: "a number such as 2.0", str: "text"}
# Parameters that every rclpy node may be given without declaring them itself.
_OF_ROS = ("use_sim_time", "qos_overrides.", "start_type_description_service")


@dataclasses.dataclass(frozen=True, kw_only=True)
class SimulationParams:
    """Parameters of the simulation node."""

    scene: str = text("name of a scene in config/scenes, or path of a scene file", "deep_lift")
    input_delay_s: float = quantity(
        "delay of the simulation behind ROS time, so that heave samples before and after each time "
        "step have arrived", "s", 0.0, 10.0, default=0.15,
    )  # fmt: skip
    speed: float = quantity("simulation time over real time", "", SPEED_LOW, SPEED_HIGH,
                            default=1.0)  # fmt: skip
    stop_after_s: float = quantity("simulation time after which to stop; 0: never", "s", 0.0, 1e7,
                                   default=0.0)  # fmt: skip
    autostart: bool = text("configure and activate at start-up", True)
    lockstep: bool = text(
        "co-simulation: step only to the time that a master has published on /clock, and to which "
        "the ship motion is known; use_sim_time must be true", False,
    )  # fmt: skip
    wait_for: str = text(
        "topics, separated by spaces, to wait for at the start: inputs until they have a "
        "publisher, outputs until they have a subscriber", "",
    )  # fmt: skip
    wait_for_s: float = quantity("timeout of wait_for", "s", 0.0, 60.0, default=5.0)
    save_state: str = text("file for the saved state, written periodically and at the end; empty: "
                        "none", "")  # fmt: skip
    save_every_s: float = quantity("real time between two saved states", "s", 0.1, 3600.0,
                                   default=10.0)  # fmt: skip
    from_state: str = text(
        "saved state to resume from; empty: start from static equilibrium. If it is the file of "
        "save_state, it may be missing: a first run starts from static equilibrium, and a "
        "restarted one resumes", "",
    )  # fmt: skip
    failure_directory: str = text(
        "folder for the state at a solver failure; empty: the working directory", "",
    )  # fmt: skip
    elements: int = quantity("number of elements; 0: the scene's", "", 0, 20000,
                             default=0)  # fmt: skip
    step_s: float = quantity("time step; 0: the scene's", "s", 0.0, 0.2,
                             default=0.0)  # fmt: skip
    energy: bool = text("report the energy balance in diagnostics; slower", False)
    overload_protection: bool = text(
        "overload protection: longer time steps, then fewer elements, while the deadline is missed",
        True,
    )
    error_interval: bool = text(
        "publish a 95 % discretisation-error interval of the top tension; slower", False
    )
    other_sea: bool = text(
        "the ship motion differs from the scene's: its convergence study gives no error", False
    )
    command_priority: str = text(
        "nodes that may command a winch, highest priority first; * stands for all others, the last "
        "one may send commands ahead of time", PRIORITY,
    )  # fmt: skip
    allow_cut: bool = text("subscribe to ropes/cut: any publisher there can cut the rope", False)
    vibration: str = text("VIV response: time-domain or frequency-domain; empty: none", "")
    fatigue: str = text("S-N curve of the monitored fatigue damage; empty: none", "")
    sender_lead_s: float = quantity(
        "time by which a replay may publish ship motion in advance; a stamp further ahead of its "
        "arrival is a fault of the sender's clock", "s", 0.0, 5.0, default=0.2,
    )  # fmt: skip
    correct_sender_clocks: bool = text(
        "correct the stamps of ship motion by the measured clock offset of the sender", False
    )
    follow_measured: bool = text(
        "every winch follows its line out measured on winch/measured instead of commands", False
    )
    learn: bool = text(
        "learn weight, mass, drag and stiffness from the tension measured on winch/measured", False
    )
    apply_learned: bool = text(
        "take learned figures over after each minute, in 20 s; false: by the service "
        "estimate/apply", False,
    )  # fmt: skip


@dataclasses.dataclass(frozen=True, kw_only=True)
class SeaStateParams:
    """Parameters of the sea_state node: ship motion from a record or a spectrum."""

    scene: str = text("scene whose recorded sea is replayed if no bag is named", "deep_lift")
    bag: str = text("name in bags/ or path of a bag with a heave topic; empty: the scene's", "")
    poses: str = text("bag of ship poses to replay in place of heave; empty: none", "")
    topic: str = text("topic in the bag; empty: the only suitable one", "")
    sea_offset_s: float = quantity("offset into the bag, added to the scene's if it is its bag",
                                   "s", 0.0, 1e6, default=0.0)  # fmt: skip
    loop: bool = text("repeat the record from its beginning", True)
    significant_height_m: float = quantity(
        "significant wave height Hs of a JONSWAP sea; 0: replay a bag",
        "m", 0.0, 20.0, default=0.0,
    )  # fmt: skip
    peak_period_s: float = quantity("peak period Tp of that spectrum", "s", 2.0, 30.0, default=9.0)
    seed: int = quantity("random seed for the wave phases", "", 0, 2**31 - 1, default=1)
    lead_s: float = quantity("time by which samples are published in advance", "s", 0.0, 5.0,
                             default=0.2)  # fmt: skip
    speed: float = quantity("simulation time over real time", "", SPEED_LOW, SPEED_HIGH,
                            default=1.0)  # fmt: skip
    wait_for_epoch: bool = text(
        "stamp samples from the simulation's epoch (reproducible); false: from now on, like a "
        "motion sensor", True,
    )  # fmt: skip
    simulation_node: str = text(
        "node whose twin/epoch is followed, with its namespace if that differs", "simulation"
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class WinchScheduleParams:
    """Parameters of the winch_schedule node."""

    scene: str = text("scene whose winch schedule is published", "deep_lift")
    cut: str = text(
        "cut the rope: PLACE@SECONDS, metres below the hang-off (or end) and simulation time; "
        "empty: never", "",
    )  # fmt: skip
    lead_s: float = quantity("time by which commands are published in advance", "s", 0.0, 5.0,
                             default=0.2)  # fmt: skip
    speed: float = quantity("simulation time over real time", "", SPEED_LOW, SPEED_HIGH,
                            default=1.0)  # fmt: skip
    simulation_node: str = text(
        "node whose twin/epoch is followed, with its namespace if that differs", "simulation"
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class RecorderParams:
    """Parameters of the recorder node."""

    out: str = text("bag directory to create; empty: rope_twin_DATE_TIME here", "")
    beside: bool = text(
        "if the directory exists, record to OUT_2 and so on: for a restarted recorder", False
    )
    standby: str = text(
        "start recording when this file exists, to replace a failed recorder; empty: immediately",
        "",
    )
    allow_cut: bool = text("record ropes/cut too, if the simulation subscribes to it", False)


@dataclasses.dataclass(frozen=True, kw_only=True)
class ViewerParams:
    """Parameters of the viewer node."""

    file: str = text("write this .rrd file; empty: open a window", "")
    rate_hz: float = quantity("update rate", "Hz", 0.5, 10.0, default=10.0)
    simulation_node: str = text(
        "node whose twin/epoch is used, with its namespace if that differs", "simulation"
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class ConsoleParams:
    """Parameters of the console node."""

    address: str = text("HOST:PORT to serve the page at", "127.0.0.1:8420")
    scene: str = text("scene whose limits are shown; empty: that of twin/session", "")
    control: bool = text("allow pages that give the token to command winches", False)
    load_chart: str = text("load chart of a plan that the pages show; empty: none", "")


@dataclasses.dataclass(frozen=True, kw_only=True)
class FeedParams:
    """Parameters of the feed node."""

    settings: str = text("settings of the instruments: name in config/feeds/ or path of a file", "")
    feed: str = text("name of the only feed of the file to run; empty: all", "")
    source: str = text("source in place of that in the settings; empty: that one", "")
    speed: float = quantity("speed at which a file is replayed; 0: as fast as possible", "", 0.0,
                            1000.0, default=1.0)  # fmt: skip
    faults: str = text("faults of the lines of a file, or of those sent, as lost:0.01,seed:2", "")
    stop_after_s: float = quantity("real time after which to stop; 0: never", "s", 0.0, 1e7,
                                   default=0.0)  # fmt: skip


@dataclasses.dataclass(frozen=True, kw_only=True)
class ForecastParams:
    """Parameters of the forecast node."""

    scene: str = text("scene of the lift", "deep_lift")
    members: int = quantity("ropes of a forecast", "", 19, 960, default=48)
    interval_s: float = quantity("real time between two forecasts", "s", 0.5, 60.0, default=1.0)
    motion_error_m: float = quantity("coloured error of the motion sensor, standard deviation",
                                     "m", 0.0, 1.0, default=0.02)  # fmt: skip
    tension_limit_n: float = quantity("tension limit of the risk, of each rope from a hang-off; 0: "
                                      "the scene's", "N", 0.0, 1e9, default=0.0)  # fmt: skip
    contact_limit_m_per_s: float = quantity("limit of the payload's speed at contact", "m/s", 0.01,
                                            10.0, default=0.5)  # fmt: skip
    quiet_m_per_s: float = quantity("payload speed below which it is quiet", "m/s", 0.01, 10.0,
                                    default=0.3)  # fmt: skip
    quiet_s: float = quantity("length of a quiet window", "s", 1.0, 50.0, default=10.0)
    wave_heading_deg: float = quantity(
        "direction that waves measured up-sea travel to, from east to north", "deg", -360.0, 360.0,
        default=180.0,
    )  # fmt: skip
    wave_noise_m: float = quantity("standard deviation of waves measured up-sea", "m", 0.001, 10.0,
                                   default=0.2)  # fmt: skip


# Nodes of a run, in the order of their shutdown: publishing ones first, subscribing ones last.
NODES = (
    "simulation", "sea_state", "winch_schedule", "forecast", "console", "viewer", "recorder",
)  # fmt: skip


def node_parameters(options: RunOptions) -> dict[str, dict[str, Any]]:
    """Return the parameters of each node to be started with these options, by node."""

    def shared(*names: str) -> dict[str, Any]:
        return {name: getattr(options, name) for name in names}

    cut = {"allow_cut": options.allow_cut or bool(options.cut)}
    nodes: dict[str, dict[str, Any]] = {}
    nodes["sea_state"] = shared("scene", "bag", "poses", "topic", "sea_offset_s", "speed")
    nodes["winch_schedule"] = shared("scene", "cut", "speed")
    if options.ahead:
        nodes["forecast"] = shared("scene")
    # After the nodes that read named files: nothing is written to disk for a mistyped name.
    if options.record is not None:
        nodes["recorder"] = {"out": str(options.record), **cut}
    if options.view is not None:
        nodes["viewer"] = {"file": str(options.view_file or "")}
    if options.console:
        nodes["console"] = {"address": options.console, **shared("scene", "control")}
    nodes["simulation"] = {
        **shared("scene", "speed", "energy", "error_interval", "other_sea", "learn"),
        **shared("apply_learned"),
        "stop_after_s": options.end_s or 0.0,
        "save_state": str(options.save or ""),
        "from_state": str(options.start_from or ""),
        "failure_directory": str(options.failure_folder),
        "elements": options.elements or 0,
        "step_s": options.step_s or 0.0,
        "vibration": options.watch.vibration if options.watch else "",
        "fatigue": options.watch.fatigue if options.watch else "",
        **cut,
    }
    return nodes


def declare(node: Node, params: type[P], *, read_only: bool = True) -> P:
    """Declare every field of `params` at the node and read it.

    read_only: the node reads them once, so that a later change is refused.

    Raises:
        InputError: a value has the wrong type or is out of range; one sentence.
    """
    fields = dataclasses.fields(params)  # type: ignore[arg-type]
    _warn_of_unknown(node, [field.name for field in fields])
    hints = typing.get_type_hints(params)
    for field in fields:
        if node.has_parameter(field.name):
            continue
        descriptor = _descriptor(field, hints[field.name])
        descriptor.read_only = read_only
        try:
            node.declare_parameter(field.name, field.default, descriptor)
        except (InvalidParameterTypeException, InvalidParameterValueException) as error:
            raise _sentence(node, field, hints[field.name]) from error
    return read(node, params)


def read(node: Node, params: type[P]) -> P:
    """Return the current values of declared parameters."""
    names = [field.name for field in dataclasses.fields(params)]  # type: ignore[arg-type]
    return params(**{name: node.get_parameter(name).value for name in names})


def overrides(values: dict[str, Any]) -> list[Parameter]:
    """Return parameter overrides for a node that is made in this process."""
    return [Parameter(name, value=value) for name, value in values.items()]


def _descriptor(field: dataclasses.Field[Any], kind: type) -> ParameterDescriptor:
    about = field.metadata.get("quantity")
    if about is None:
        return ParameterDescriptor(description=field.metadata["about"])
    assert isinstance(about, Quantity)
    unit = f" [{about.unit}]" if about.unit else ""
    descriptor = ParameterDescriptor(description=f"{about.about}{unit}")
    if math.isfinite(about.low) and math.isfinite(about.high):
        if kind is int:
            span = IntegerRange(from_value=int(about.low), to_value=int(about.high), step=1)
            descriptor.integer_range = [span]
        else:
            reach = FloatingPointRange(from_value=float(about.low), to_value=float(about.high))
            descriptor.floating_point_range = [reach]
    return descriptor


def _sentence(node: Node, field: dataclasses.Field[Any], kind: type) -> InputError:
    value = _given(node)[field.name].value
    about = field.metadata.get("quantity")
    remedy = f"it must be {_TYPES[kind]}"
    if about is not None:
        remedy += f", {about.range_text()} ({about.about})"
    return InputError(f"node {node.get_name()}, parameter {field.name}", repr(value), remedy)


def _warn_of_unknown(node: Node, known: list[str]) -> None:
    """Warn about unknown parameter names, which rclpy would ignore silently."""
    for name in _given(node):
        if name not in known and not name.startswith(_OF_ROS):
            where = f"node {node.get_name()}, parameter {name}"
            node.get_logger().warning(
                phrase(where, "unknown, it has no effect", did_you_mean(name, known))
            )


def _given(node: Node) -> dict[str, Parameter]:
    """Return the overrides of a node by file, command line or constructor (rclpy has no API)."""
    return dict(getattr(node, "_parameter_overrides", {}))
