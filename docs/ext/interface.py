"""The ROS interface: topics, QoS profiles, node parameters and rows of the diagnostics."""

from __future__ import annotations

import ast
import dataclasses
import re
import typing
from collections.abc import Iterator
from pathlib import Path

from markdown import code, prose, table, words

import rope_twin
from rope_twin.ros import params
from rope_twin.topics import QOS_ROWS, SERVICES, TOPICS

PACKAGE = Path(rope_twin.__file__).parent
ROW = re.compile(r"(simulation|recorder|feed|forecast): ?[a-z -]*")
NODES = {
    "simulation": params.SimulationParams,
    "sea_state": params.SeaStateParams,
    "winch_schedule": params.WinchScheduleParams,
    "feed": params.FeedParams,
    "forecast": params.ForecastParams,
    "recorder": params.RecorderParams,
    "viewer": params.ViewerParams,
    "console": params.ConsoleParams,
}
# What a row reports, in the terms of a reader of /diagnostics; test/docs holds the list complete.
ROWS_MEAN = {
    "feed: ...": "one row per instrument: accepted and refused lines by reason, holes; ERROR while "
    "it is silent or not connected",
    "forecast: worker": "forecasts made and their CPU time; WARN while there is none, and why",
    "recorder: bag": "progress of the recording; ERROR if the bag cannot be written",
    "simulation: accuracy": "bound of the discretisation error of the top tension, or why unknown",
    "simulation: bend": "minimum bend radius of each line; WARN below the permitted one",
    "simulation: clocks": "ROS time against the steady clock; in lockstep what a cycle waits for",
    "simulation: compensator": "stroke and force of the heave compensator; WARN at an end stop",
    "simulation: crew limits": "limits that the crew has set, stricter than the scene's",
    "simulation: energy": "energy balance and its residual, in runs that keep it",
    "simulation: error interval": "95 % discretisation-error interval, in runs that compute it",
    "simulation: fatigue": "accumulated (Miner) damage, in runs that compute it",
    "simulation: faults": "fault that the tests of the measured tension found, and since when",
    "simulation: fluid ramp": "factors on the forces of the water, in scenes that build them up",
    "simulation: input ...": "one row per input (heave, lower end, winch command, current, "
    "measured values): accepted and rejected samples, age, faults",
    "simulation: learned figures": "learned from the measured tension, and why learning pauses",
    "simulation: limits": "limits of the scene that were exceeded",
    "simulation: messages": "messages that could not be decoded",
    "simulation: pacing": "CPU load, deadline misses, lag behind real time",
    "simulation: publishing": "whether results are published",
    "simulation: quality": "lowest quality index of the functional elements and its reason; WARN "
    "below 0.7, ERROR below 0.5",
    "simulation: residuals": "measured less computed values; WARN if outside for long",
    "simulation: rope": "a line that was cut",
    "simulation: run": "summary of the run so far, where nodes are separate processes",
    "simulation: accuracy level": "accuracy level in use (time step, elements) and why",
    "simulation: saving": "the newest saved state",
    "simulation: seabed": "contact of payload and rope with the seabed",
    "simulation: seat ...": "one row per winch: which node commands it, rejected commanders",
    "simulation: senders": "several senders of one input",
    "simulation: solver": "convergence, substeps, recoveries from failed steps",
    "simulation: sources": "which nodes publish each input",
    "simulation: start-up": "build-up (ramp) of vessel motion at the start",
    "simulation: state": "lifecycle state, and the error that prevents a start",
    "simulation: strength": "utilisation of each line (tension over MBL)",
    "simulation: touchdown": "touchdown point of each line",
    "simulation: vibration": "VIV response, in runs that compute it",
    "simulation: winch": "payout, speed, tension, active limit of the winch",
}


def topics() -> str:
    """Return the topic table."""
    rows = (
        (
            code(topic.name),
            code(topic.type_name.replace("/msg/", "/")),
            topic.publisher or "a sensor",
            f"{topic.rate_hz:g} Hz" if topic.rate_hz else "on change",
            f"[{topic.qos.value}](#qos-profiles)",
            prose(topic.about),
        )
        for topic in TOPICS
    )
    return table(("topic", "type", "publisher", "rate", "QoS", "content and units"), rows)


def services() -> str:
    """Return the table of services."""
    rows = (
        (code(one.name), code(one.type_name.replace("/srv/", "/")), prose(one.about))
        for one in SERVICES
    )
    return table(("service", "type", "effect"), rows)


def qos_profiles() -> str:
    """Return the rows of quality of service."""
    rows = (
        (
            name.value,
            "reliable" if row.reliable else "best effort",
            "transient local" if row.for_late_joiners else "volatile",
            f"keep last {row.depth}",
        )
        for name, row in QOS_ROWS.items()
    )
    return table(("profile", "reliability", "durability", "history"), rows)


def parameters() -> str:
    """Return a table for each node."""
    return "\n\n".join(
        f"## {words(name)}\n\n{_parameter_table(kind)}" for name, kind in NODES.items()
    )


def _parameter_table(kind: type) -> str:
    hints = typing.get_type_hints(kind)
    rows = []
    for field in dataclasses.fields(kind):
        quantity = field.metadata.get("quantity")
        about = quantity.about if quantity else field.metadata["about"]
        span = words(quantity.range_text()) if quantity else ""
        default = str(field.default).lower() if hints[field.name] is bool else str(field.default)
        rows.append(
            (code(field.name), hints[field.name].__name__, span, code(default), prose(about))
        )
    return table(("parameter", "type", "range", "default", "meaning"), rows)


def diagnostics() -> str:
    """Return the rows of /diagnostics with the levels that each can have."""
    rows = (
        (code(name), ", ".join(sorted(levels, key=_severity)), ROWS_MEAN.get(name, ""))
        for name, levels in sorted(diagnostic_rows().items())
    )
    return table(("status name", "levels", "reports"), rows)


def diagnostic_rows() -> dict[str, set[str]]:
    """Return the names of all rows that the program can publish, with their levels.

    They are found in the sources: a row is a text like `simulation: solver`, its levels those that
    the same function names.
    """
    found: dict[str, set[str]] = {}
    for folder in ("messages", "estimation", "ros", "run"):
        for path in sorted((PACKAGE / folder).rglob("*.py")):
            tree = ast.parse(path.read_text("utf-8"))
            constants = _text_constants(tree)
            for function in ast.walk(tree):
                if isinstance(function, ast.FunctionDef):
                    for name in _rows_of(function, constants):
                        found.setdefault(name, set()).update(_levels_of(function))
    series = tuple(name.removesuffix("...") for name in found if name.endswith("..."))
    return {
        name: levels
        for name, levels in found.items()
        if name.endswith("...") or not name.startswith(series)
    }


def _text_constants(tree: ast.Module) -> dict[str, str]:
    """Return the texts that a module gives names, also several in one assignment."""
    texts: dict[str, object] = {}
    for node in tree.body:
        if isinstance(node, ast.Assign):
            names = ast.walk(node.targets[0])
            values = [one.value for one in ast.walk(node.value) if isinstance(one, ast.Constant)]
            texts.update(
                zip((one.id for one in names if isinstance(one, ast.Name)), values, strict=False)
            )
    return {name: text for name, text in texts.items() if isinstance(text, str)}


def _rows_of(function: ast.FunctionDef, constants: dict[str, str]) -> Iterator[str]:
    """Yield the row names in a function that makes a Status."""
    nodes = list(ast.walk(function))
    names = {node.id for node in nodes if isinstance(node, ast.Name)}
    if "Status" not in names:
        return
    texts = [node.value for node in nodes if isinstance(node, ast.Constant)]
    texts += [constants[name] for name in names & constants.keys()]
    for text in texts:
        if isinstance(text, str) and ROW.fullmatch(text):
            yield f"{text}..." if text.endswith(" ") else text


def _levels_of(function: ast.FunctionDef) -> set[str]:
    return {
        node.attr
        for node in ast.walk(function)
        if isinstance(node, ast.Attribute)
        and isinstance(node.value, ast.Name)
        and node.value.id == "Level"
    }


def _severity(level: str) -> int:
    return ("OK", "WARN", "ERROR").index(level)
