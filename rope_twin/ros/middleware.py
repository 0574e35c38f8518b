"""The middleware of this installation: its versions, its reach, and a round trip through it."""

from __future__ import annotations

import os
import time
from typing import NamedTuple

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import Float64

from rope_twin.errors import InputError
from rope_twin.files import share_dir

DISCOVERY_RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
_PATIENCE_S = 0.05  # with a message, which is lost while the participants do not know each other
_COUNTED = 5  # messages; the fastest is reported


class RoundTrip(NamedTuple):
    """Time until two participants found each other, and of one message between them."""

    discovery_s: float
    latency_s: float


def keep_to_loopback() -> None:
    """Restrict the nodes of this process and of its child processes to this machine.

    To be called before `initialise`. An environment that already has ROS_AUTOMATIC_DISCOVERY_RANGE
    is left unchanged. The variable limits discovery only; the Fast DDS profile restricts reception
    to the loopback interface, unless the environment names another profile.
    """
    if DISCOVERY_RANGE in os.environ:
        return
    os.environ[DISCOVERY_RANGE] = "LOCALHOST"
    profile = share_dir() / "config" / "ros" / "fastdds_loopback.xml"
    os.environ.setdefault("FASTDDS_DEFAULT_PROFILES_FILE", str(profile))


def rmw_name() -> str:
    """Return the name of the RMW implementation, which is loaded for it."""
    return str(rclpy.get_rmw_implementation_identifier())


def round_trip(timeout_s: float) -> RoundTrip:
    """Publish from one DDS participant to another on this machine, as nodes of a run do.

    Raises:
        InputError: rclpy cannot be initialised, or no message arrives in time.
    """
    keep_to_loopback()
    contexts = Context(), Context()
    try:
        for context in contexts:
            rclpy.init(args=[], context=context)
        return _exchange(contexts, timeout_s)
    except InputError:
        raise
    except Exception as error:  # rcl raises RuntimeErrors of several kinds
        remedy = "check RMW_IMPLEMENTATION and that ROS is sourced or its wheels are installed"
        raise InputError("ROS", str(error).splitlines()[0].rstrip("."), remedy) from error
    finally:
        for context in contexts:
            if context.ok():
                context.shutdown()


def _exchange(contexts: tuple[Context, Context], timeout_s: float) -> RoundTrip:
    name, topic = f"doctor_{os.getpid()}", f"rope_twin_doctor_{os.getpid()}"
    talker = rclpy.create_node(f"{name}_talker", context=contexts[0])
    listener = rclpy.create_node(f"{name}_listener", context=contexts[1])
    executor = SingleThreadedExecutor(context=contexts[1])
    executor.add_node(listener)
    received: list[float] = []  # when the messages were sent that have arrived
    listener.create_subscription(Float64, topic, lambda message: received.append(message.data), 10)
    publisher = talker.create_publisher(Float64, topic, 10)
    began_s, found_s = time.monotonic(), 0.0
    latencies: list[float] = []
    try:
        while len(latencies) < _COUNTED:
            sent_s = time.monotonic()
            if sent_s - began_s > timeout_s:
                problem = f"no message from one node to another within {timeout_s:g} s"
                raise InputError("DDS", problem, "allow UDP on the loopback interface")
            publisher.publish(Float64(data=sent_s))
            while sent_s not in received and time.monotonic() - sent_s < _PATIENCE_S:
                executor.spin_once(timeout_sec=_PATIENCE_S)
            if sent_s in received:
                found_s = found_s or time.monotonic()
                latencies.append(time.monotonic() - sent_s)
    finally:
        executor.shutdown()
        talker.destroy_node()
        listener.destroy_node()
    return RoundTrip(found_s - began_s, min(latencies))
