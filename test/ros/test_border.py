"""The border of the suite: what it binds to, who may cut the rope, and the policies for SROS 2."""

from __future__ import annotations

import json
import math
import os
import time
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import psutil
import pytest
from feed_samples import SETTINGS
from ros_bench import Bench
from ros_process import Process, Processes, until_running

from rope_twin.console.readings import SHOWN
from rope_twin.console.requests import LEARNING
from rope_twin.files import share_dir
from rope_twin.messages import encode_cut
from rope_twin.ros.feed_node import FeedNode, FeedSimulator
from rope_twin.ros.middleware import DISCOVERY_RANGE
from rope_twin.ros.params import NODES, overrides
from rope_twin.ros.processes import STANDBY
from rope_twin.topics import (
    ALERT_COMMAND,
    BY_NAME,
    CUT_TOPIC,
    FORECAST_RISK,
    INPUTS,
    RELEASE,
    SERVICES,
    TAKE,
    TOPICS,
    WINCH_TOPICS,
    service_name,
)

pytestmark = pytest.mark.ros
SCENE = "still_water"
FEEDS = "feed", "feed_simulator"
_FIRST_PORT, _PORTS_PER_DOMAIN = 7400, 250  # of DDS over UDP


def receiving_addresses(process: Process, domain: int) -> dict[int, str]:
    """The addresses that a run and its children receive DDS messages at, by port.

    Sending sockets have a port of the system's choice, and nobody reads from them.
    """
    first = _FIRST_PORT + _PORTS_PER_DOMAIN * domain
    own = psutil.Process(process.popen.pid)
    found = {}
    for one in (own, *own.children(recursive=True)):
        for connection in one.net_connections("udp"):
            ip, port = connection.laddr
            if first <= port < first + _PORTS_PER_DOMAIN:
                found[port] = ip
    return found


def start(processes: Processes, *words: str, **environment: str) -> Process:
    """A run that nothing in its environment restricts or opens."""
    for name in (DISCOVERY_RANGE, "FASTDDS_BUILTIN_TRANSPORTS"):
        os.environ.pop(name, None)
    process = processes.start(
        ["-m", "rope_twin", "run", SCENE, "--headless", "--no-record", *words], **environment
    )
    process.until_says("late")
    return process


@pytest.fixture
def _environment(monkeypatch: pytest.MonkeyPatch) -> None:
    """Restores what `start` takes away."""
    for name in (DISCOVERY_RANGE, "FASTDDS_BUILTIN_TRANSPORTS"):
        monkeypatch.setenv(name, os.environ[name])


@pytest.mark.usefixtures("_environment")
@pytest.mark.parametrize(
    "words",
    [[], pytest.param(["--processes"], marks=pytest.mark.long)],
    ids=["one process", "processes"],
)
def test_a_run_receives_on_the_loopback_interface_only(
    words: list[str], processes: Processes, domain: int
) -> None:
    addresses = receiving_addresses(start(processes, *words), domain)
    assert len(addresses) >= 2
    assert set(addresses.values()) == {"127.0.0.1"}


def test_a_profile_that_does_not_exist_is_refused(processes: Processes, tmp_path: Path) -> None:
    """Fast DDS ignores it: the run would receive on every interface."""
    profile = str(tmp_path / "loopback.xml")
    for command in (["run", SCENE, "--headless"], ["run", SCENE, "--headless", "--processes"]):
        arguments = ["-m", "rope_twin", *command, "--no-record", "--duration", "1"]
        run = processes.start(arguments, FASTDDS_DEFAULT_PROFILES_FILE=profile)
        assert run.wait() == 1
        assert len(run.text.strip().splitlines()) == 1
        assert f"FASTDDS_DEFAULT_PROFILES_FILE: there is no file '{profile}'" in run.text


@pytest.mark.usefixtures("_environment")
def test_a_run_is_open_where_it_is_asked_to_be(processes: Processes, domain: int) -> None:
    by_option = start(processes, "--network")
    assert "0.0.0.0" in receiving_addresses(by_option, domain).values()
    by_option.kill()
    by_variable = start(processes, **{DISCOVERY_RANGE: "SUBNET"})
    assert "0.0.0.0" in receiving_addresses(by_variable, domain).values()


@pytest.mark.usefixtures("_environment")
def test_who_is_on_this_machine_hears_such_a_run(processes: Processes, bench: Bench) -> None:
    """Also with another profile than the run's: this test's own node has none."""
    heard = bench.listen("ropes/tension_top")
    start(processes)
    until_running(bench, heard, "its tension")


def node(bench: Bench, **parameters: Any) -> Any:
    return bench.make("simulation", scene=SCENE, **parameters)


def test_nobody_cuts_a_rope_unless_the_run_allows_it(bench: Bench) -> None:
    simulation = node(bench)
    publisher = bench.publisher(CUT_TOPIC)
    simulation.begin()
    bench.until(lambda: simulation.paced.last.step >= 10, "it runs")
    publisher.publish(encode_cut(0, math.inf, "rope")[1])
    until = time.monotonic() + 2.0
    bench.until(lambda: time.monotonic() > until, "two seconds")
    assert simulation.count_subscribers(CUT_TOPIC) == 0
    assert simulation.paced.last.cut is None
    assert CUT_TOPIC not in {name for name, _ in subscriptions(bench, "simulation")}


def test_where_it_is_allowed_the_rope_is_cut(bench: Bench) -> None:
    simulation = node(bench, allow_cut=True)
    publisher = bench.publisher(CUT_TOPIC)
    simulation.begin()
    bench.until(lambda: publisher.get_subscription_count() == 1, "it listens")
    bench.until(lambda: simulation.paced.last.step >= 10, "it runs")
    publisher.publish(encode_cut(0, math.inf, "rope")[1])
    bench.until(lambda: simulation.paced.last.cut is not None, "the cut")


def subscriptions(bench: Bench, name: str) -> list[tuple[str, list[str]]]:
    found = bench.own.get_subscriber_names_and_types_by_node(name, "/")
    return [(topic.removeprefix("/"), types) for topic, types in found]


@dataclass
class Profile:
    """Rights that the policy grants a node."""

    publish: set[str]
    subscribe: set[str]
    reply: set[str]
    request: set[str] = field(default_factory=set)


def policy() -> dict[str, Profile]:
    """The profiles of the shipped policy by node; its form is checked on the way."""
    root = ElementTree.parse(share_dir() / "config" / "sros2" / "policy.xml").getroot()
    assert (root.tag, root.get("version")) == ("policy", "0.2.0")
    (enclaves,) = root
    found = {}
    for enclave in enclaves:
        ((profile,),) = enclave
        assert (enclave.tag, profile.tag, profile.get("ns")) == ("enclave", "profile", "/")
        assert enclave.get("path") == f"/rope_twin/{profile.get('node')}"
        allowed: dict[str, set[str]] = {}
        for rule in profile:
            ((action, answer),) = rule.attrib.items()
            assert answer == "ALLOW"
            assert {one.tag for one in rule} == {rule.tag.removesuffix("s")}
            names = [str(one.text) for one in rule]
            assert len(set(names)) == len(names)
            allowed[action] = set(names)
        found[str(profile.get("node"))] = Profile(**allowed)
    return found


def test_the_policy_has_a_profile_for_each_node_and_names_known_topics_only() -> None:
    profiles = policy()
    assert set(profiles) == {*NODES, STANDBY, "monitor", *FEEDS}
    of_ros = {"parameter_events", "rosout", "clock", "simulation/transition_event"}
    for name, profile in profiles.items():
        assert profile.publish | profile.subscribe <= {*BY_NAME, *of_ros}, name
        own = {service for service in profile.reply if service.startswith(f"{name}/")}
        served = {one.name for one in SERVICES} if name == "simulation" else set()
        assert profile.reply >= served
        assert profile.reply - own == served - own
        assert CUT_TOPIC not in profile.publish | profile.subscribe
    assert profiles["console"].subscribe == {*SHOWN, "clock"}
    calls = {service_name("winch", what) for what in ("emergency_stop", TAKE, RELEASE)}
    calls |= set(LEARNING.values())
    assert {name: one.request for name, one in profiles.items() if one.request} == {
        "console": calls
    }
    assert calls <= profiles["simulation"].reply
    for topic in TOPICS:
        if topic.publisher and topic.name != CUT_TOPIC:
            assert topic.name in profiles[topic.publisher].publish
    inputs = profiles["simulation"].subscribe
    assert inputs == {*INPUTS, ALERT_COMMAND, FORECAST_RISK, "diagnostics", "clock"} - {CUT_TOPIC}
    assert {name for name, one in profiles.items() if one.publish & set(INPUTS)} == {
        "sea_state", "winch_schedule", "feed", "console"
    }  # fmt: skip


def test_the_policy_allows_what_the_nodes_do_and_nothing_else(
    bench: Bench, processes: Processes, tmp_path: Path
) -> None:
    """The graph of a suite that runs with all its nodes shows it."""
    profiles = policy()
    heard = bench.listen("ropes/tension_top")
    processes.cli(
        "run", "shallow_lift", "--processes", "--headless", "--out", str(tmp_path / "bag"),
        "--learn", "--ahead", "--console", "127.0.0.1:0", "--control",
    )  # fmt: skip
    own = bench.own
    for name in FEEDS:
        del profiles[name]  # not of the suite: test_the_policy_allows_what_feeds_do
    bench.until(lambda: set(profiles) <= set(own.get_node_names()), "all nodes are there")
    until_running(bench, heard, "the simulation, whose services are there from then on")
    not_always = {  # by scene and option
        "ship/heave", "ship/odometry", *WINCH_TOPICS, "clock",
    }  # fmt: skip
    assert profiles[STANDBY].subscribe == profiles["recorder"].subscribe
    together = {"console": ("console", "console_view")}  # nodes of one process, with one enclave
    for name, profile in profiles.items():
        if name == STANDBY:  # it listens when it has taken over
            continue
        for allowed, read in (
            (profile.publish, own.get_publisher_names_and_types_by_node),
            (profile.subscribe, own.get_subscriber_names_and_types_by_node),
            (profile.reply, own.get_service_names_and_types_by_node),
        ):

            def used(name: str = name, read: Any = read) -> set[str]:
                nodes = together.get(name, (name,))
                return {one.removeprefix("/") for node in nodes for one, _ in read(node, "/")}

            bench.until(
                lambda allowed=allowed, used=used: allowed - not_always <= used() <= allowed,
                f"what {name} does is what it may do: {sorted(used() ^ allowed)}",
                60.0,
            )


@pytest.mark.parametrize("name", FEEDS)
def test_the_policy_allows_what_feeds_do(bench: Bench, tmp_path: Path, name: str) -> None:
    """Each with a line monitor, heave of the crane tip, and motion of a reference point."""
    tip = {"format": "tss1", **SETTINGS["tss1"], "source": str(tmp_path / "tip")}
    point = {**tip, "heave_of": "reference", "rest_heading_deg": 0.0, "replay_rate_hz": 10.0}
    feeds = {
        "winch": {"format": "lci90", **SETTINGS["lci90"], "source": "udp://127.0.0.1:46224"},
        "tip": {**tip, "replay_rate_hz": 10.0},
        "point": point,
    }
    (tmp_path / "tip").touch()
    settings = tmp_path / "feeds.yaml"
    settings.write_text(json.dumps({"feeds": feeds}), "utf-8")
    kind = {"feed": FeedNode, "feed_simulator": FeedSimulator}[name]
    node = bench.add(kind(parameter_overrides=overrides({"settings": str(settings)})))
    node.begin()
    profile, own = policy()[name], bench.own
    for allowed, read in (
        (profile.publish, own.get_publisher_names_and_types_by_node),
        (profile.subscribe, own.get_subscriber_names_and_types_by_node),
        (profile.reply, own.get_service_names_and_types_by_node),
    ):
        bench.until(
            lambda allowed=allowed, read=read: (
                {one.removeprefix("/") for one, _ in read(name, "/")} == allowed - {"clock"}
            ),
            f"{name} does what it may do",
            60.0,
        )
