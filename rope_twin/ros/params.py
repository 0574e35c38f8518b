"""The parameters of every node: one frozen dataclass each, and the one loop that declares them.

A parameter is a field with `quantity` (a number with unit and range) or `text` (words and
switches). The same metadata becomes the ROS descriptor, so `ros2 param describe` says it all.
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
from rope_twin.run.options import SPEED_HIGH, SPEED_LOW
from rope_twin.run.seat import PRIORITY

P = TypeVar("P")

_TYPES = {bool: "true or false", int: "a whole number", float: "a number such as 2.0", str: "text"}
# Parameters that every rclpy node may be given without declaring them itself.
_OF_ROS = ("use_sim_time", "qos_overrides.", "start_type_description_service")


@dataclasses.dataclass(frozen=True, kw_only=True)
class SimulationParams:
    """Of the node that steps the rope."""

    scene: str = text("name of a scene in config/scenes, or a path to one", "deep_lift")
    input_delay_s: float = quantity(
        "the twin runs this far behind ROS time, so that heave samples on both sides of each step "
        "are there", "s", 0.0, 10.0, default=0.15,
    )  # fmt: skip
    speed: float = quantity("twin time over real time", "", SPEED_LOW, SPEED_HIGH, default=1.0)
    stop_after_s: float = quantity("twin time after which to stop; 0: never", "s", 0.0, 1e7,
                                   default=0.0)  # fmt: skip
    autostart: bool = text("configure and activate without waiting to be told", True)
    wait_for: str = text(
        "topics, separated by spaces, to await at the start: inputs until somebody publishes them, "
        "own topics until somebody listens", "",
    )  # fmt: skip
    wait_for_s: float = quantity("how long to await them", "s", 0.0, 60.0, default=5.0)
    save_to: str = text("file that the state is saved to, now and then and at the end; empty: none",
                        "")  # fmt: skip
    save_every_s: float = quantity("real time between two saved states", "s", 0.1, 3600.0,
                                   default=10.0)  # fmt: skip
    start_from: str = text(
        "saved state to go on from; empty: from rest. The file of save_to may be missing, then it "
        "is from rest too: so a simulation that was killed goes on, and a first one begins", "",
    )  # fmt: skip
    failure_directory: str = text(
        "folder for the state at which the solver gave up; empty: the working directory", "",
    )  # fmt: skip
    elements: int = quantity("elements in place of the scene's; 0: the scene's", "", 0, 20000,
                             default=0)  # fmt: skip
    step_s: float = quantity("step in place of the scene's; 0: the scene's", "s", 0.0, 0.2,
                             default=0.0)  # fmt: skip
    energy: bool = text("keep the energy balance and tell it in the diagnostics; slower", False)
    ladder: bool = text(
        "take larger steps, then fewer elements, while the machine cannot keep up", True
    )
    error_band: bool = text(
        "keep a band around the top tension in which the converged one lies; slower",
        False,
    )
    other_sea: bool = text(
        "the ship moves otherwise than in the scene: by its card no error of the tension is known",
        False,
    )
    command_priority: str = text(
        "nodes that may command a winch, highest priority first; * stands for all others, the last "
        "one may plan ahead", PRIORITY,
    )  # fmt: skip
    allow_cut: bool = text("listen to rope/cut: whoever publishes there cuts the rope", False)
    vibration: str = text("keep how the rope shakes, by this model; empty: do not", "")
    fatigue: str = text("keep the fatigue used of each metre by this curve; empty: do not", "")
    sender_lead_s: float = quantity(
        "a replay may publish ship motion so long before its time; a stamp further ahead of its "
        "arrival is a fault of the sender's clock", "s", 0.0, 5.0, default=0.2,
    )  # fmt: skip
    correct_sender_clocks: bool = text(
        "correct stamps of ship motion by the measured offset of their sender's clock", False
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class SeaStateParams:
    """Of the node that moves the ship: a recorded heave, or one made from a spectrum."""

    scene: str = text("scene whose recorded sea is played when no bag is named", "deep_lift")
    bag: str = text("name in bags/ or path of a bag with a heave topic; empty: the scene's", "")
    poses: str = text("bag of the ship's poses to replay in place of heave; empty: none", "")
    topic: str = text("its topic in the bag; empty: the only one that fits", "")
    start_s: float = quantity("offset into the bag, on top of the scene's if it is the scene's",
                              "s", 0.0, 1e6, default=0.0)  # fmt: skip
    loop: bool = text("start again at the end", True)
    significant_height_m: float = quantity(
        "make the sea from a JONSWAP spectrum of this height instead; 0: replay a bag",
        "m", 0.0, 20.0, default=0.0,
    )  # fmt: skip
    peak_period_s: float = quantity("peak period of that spectrum", "s", 2.0, 30.0, default=9.0)
    seed: int = quantity("seed of the made sea", "", 0, 2**31 - 1, default=1)
    lead_s: float = quantity("samples are published this long before their time", "s", 0.0, 5.0,
                             default=0.2)  # fmt: skip
    speed: float = quantity("twin time over real time", "", SPEED_LOW, SPEED_HIGH, default=1.0)
    wait_for_epoch: bool = text(
        "stamp from the twin's epoch (exact repeats); false: from now on, as a motion sensor does",
        True,
    )
    simulation_node: str = text(
        "node whose twin/epoch is followed; with its namespace if that is another", "simulation"
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class WinchScheduleParams:
    """Of the node that plays the scene's winch schedule."""

    scene: str = text("scene whose winch schedule is played", "deep_lift")
    cut: str = text(
        "cut the rope: PLACE@SECONDS, metres below the hang-off (or end) and twin time; empty: "
        "never",
        "",
    )
    lead_s: float = quantity("commands are published this long before their time", "s", 0.0, 5.0,
                             default=0.2)  # fmt: skip
    speed: float = quantity("twin time over real time", "", SPEED_LOW, SPEED_HIGH, default=1.0)
    simulation_node: str = text(
        "node whose twin/epoch is followed; with its namespace if that is another", "simulation"
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class RecorderParams:
    """Of the node that writes every topic of the suite to a bag."""

    directory: str = text("bag directory to make; empty: rope_twin_DATE_TIME here", "")
    beside: bool = text(
        "where the directory is in use already, record beside it, as DIRECTORY_2 and so on: for a "
        "recorder that is started again", False,
    )  # fmt: skip
    standby: str = text(
        "begin only when this file is there, in place of a recorder that died; empty: at once", ""
    )
    allow_cut: bool = text("record rope/cut too, where the simulation listens to it", False)


@dataclasses.dataclass(frozen=True, kw_only=True)
class ViewerParams:
    """Of the node that shows the suite in rerun."""

    file: str = text("write this .rrd file; empty: open a window", "")
    rate_hz: float = quantity("pictures a second", "Hz", 0.5, 10.0, default=10.0)
    simulation_node: str = text(
        "node whose twin/epoch is believed; with its namespace if that is another", "simulation"
    )


def declare(node: Node, params: type[P]) -> P:
    """Declare every field of `params` at the node and read it.

    Raises:
        InputError: one sentence for a value of the wrong type or out of range.
    """
    fields = dataclasses.fields(params)  # type: ignore[arg-type]
    _warn_of_unknown(node, [field.name for field in fields])
    hints = typing.get_type_hints(params)
    for field in fields:
        if node.has_parameter(field.name):
            continue
        try:
            node.declare_parameter(field.name, field.default, _descriptor(field, hints[field.name]))
        except (InvalidParameterTypeException, InvalidParameterValueException) as error:
            raise _sentence(node, field, hints[field.name]) from error
    return read(node, params)


def read(node: Node, params: type[P]) -> P:
    """The present values of declared parameters."""
    names = [field.name for field in dataclasses.fields(params)]  # type: ignore[arg-type]
    return params(**{name: node.get_parameter(name).value for name in names})


def overrides(values: dict[str, Any]) -> list[Parameter]:
    """Parameters for a node that is made in this process."""
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
    given = _given(node)[field.name].value
    about = field.metadata.get("quantity")
    right = f"it must be {_TYPES[kind]}"
    if about is not None:
        right += f", {about.range_text()} ({about.about})"
    return InputError(phrase(f"node {node.get_name()}, parameter {field.name}", repr(given), right))


def _warn_of_unknown(node: Node, known: list[str]) -> None:
    """A mistyped name must not become a default in silence; rclpy would let it pass."""
    for name in _given(node):
        if name not in known and not name.startswith(_OF_ROS):
            where = f"node {node.get_name()}, parameter {name}"
            node.get_logger().warning(
                phrase(where, "unknown, it has no effect", did_you_mean(name, known))
            )


def _given(node: Node) -> dict[str, Parameter]:
    """What the node was given by file, command line or its maker (rclpy has no public door)."""
    return dict(getattr(node, "_parameter_overrides", {}))
