"""Multi-line scenes: refusals in one sentence, and the system that is built."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scene_text import GOOD, assert_refused, written

from rope_twin import load_scene
from rope_twin.core.jit.decorators import jit_entry
from rope_twin.core.joined.initial_guess import initial_shape
from rope_twin.core.joined.joints import LOOSE
from rope_twin.core.joined.stack import effects_at
from rope_twin.core.state import Floats
from rope_twin.scene.joined_model import build_joined, first_places
from rope_twin.scene.lift import alone
from rope_twin.scene.rope_warnings import sense_checks

Place = tuple[float, float, float]

DAMPING = "damping: {newton_seconds: 100000.0}"
NET = "net: {width_m: 2.0, height_m: 1.0, solidity: 0.1}"
NET_AT = "net: {width_m: 2.0, height_m: 1.0, solidity: 0.1, payload: %s}"
CLAMPED = "bending: {stiffness_n_m2: 1.0, clamped_along: [0.0, 0.0, -1.0]}"
LEG = "rope: steel_wire_40mm, length_m: 10.0, elements: 5, " + DAMPING
MEETING = (
    GOOD.replace("    to: tool\n", "    to: hook\n")
    .replace(
        "payloads:\n",
        f"  - {{name: leg, {LEG}, from: hook, to: tool}}\n"
        f"  - {{name: tug, {LEG}, from: hook, fixed_at_m: [9.0, 0.0, -500.0]}}\n"
        f"  - {{name: aft, {LEG}, from: stern, to: hook}}\n"
        "joints:\n  - {name: hook, mass_kg: 100.0}\n"
        "struts:\n  - {name: bar, between: [hook, tool], length_m: 9.0}\n"
        "hang_offs:\n  - {name: stern, at_m: [-9.0, 0.0, 0.0]}\n"
        "payloads:\n",
        1,
    )
    .replace("length_m: 10.0, elements: 5, " + DAMPING + ", from: stern",
             "length_m: 501.0, elements: 50, " + DAMPING + ", from: stern")
)  # fmt: skip


def spoilt(old: str, new: str) -> str:
    """Return MEETING with its only occurrence of `old` replaced."""
    assert MEETING.count(old) == 1, f"'{old}' occurs {MEETING.count(old)} times"
    return MEETING.replace(old, new)


BAD: list[tuple[str, str, str, tuple[str, ...]]] = [
    ("unknown upper end", spoilt("from: stern", "from: sterm"),
     "ropes[3].from", ("nothing is named 'sterm'", "did you mean 'stern'?")),
    ("unknown lower end", spoilt("to: tool}", "to: tol}"),
     "ropes[1].to", ("no payload 'tol'", "did you mean 'tool'?")),
    ("rope onto itself", spoilt("from: hook, to: tool", "from: tool, to: tool"),
     "ropes[1].from", ("begins and ends at 'tool'",)),
    ("rope up to the ship", spoilt("from: stern, to: hook", "from: stern, to: winch"),
     "ropes[3].to", ("no payload 'winch'", "ropes leave the ship by `from`")),
    ("two ropes of one winch", spoilt("from: stern", "from: winch"),
     "ropes[0].from", ("2 ropes come from the winch", "hang_offs")),
    ("first rope from a joint", spoilt("    to: hook\n", "    from: stern\n    to: hook\n"),
     "ropes[0].from", ("the first rope comes from 'stern'", "from: winch")),
    ("a mooring from its float", spoilt("    to: hook\n", "    from: tool\n    to: hook\n"),
     "ropes[0].from", ("the first rope comes from 'tool'", "from its anchor, ship.hang_off_m")),
    ("loop that hangs on nothing",
     spoilt("payloads:\n", "  - {name: float, at_m: [0.0, 0.0, 0.0]}\npayloads:\n")
     .replace("joints:\n", f"  - {{name: x, {LEG}, from: a, to: b}}\n"
              f"  - {{name: y, {LEG}, from: b, to: a}}\n"
              "joints:\n  - {name: a, mass_kg: 1.0}\n  - {name: b, mass_kg: 1.0}\n")
     .replace("  - {name: float, at_m: [0.0, 0.0, 0.0]}\n", ""),
     "ropes[4]", ("'x' is part of a loop or chain without a hang-off",)),
    ("joint without a rope", spoilt("joints:\n", "joints:\n  - {name: ring}\n"),
     "joints[0]", ("no rope holds 'ring' from above",)),
    ("unjoined end",
     spoilt("joints:\n", f"  - {{name: x, {LEG}, from: hook, to: ring}}\n"
            "joints:\n  - {name: ring}\n"),
     "joints[0]", ("only one rope ends at 'ring'", "hang a payload on it")),
    ("two payloads at one point", spoilt("name: hook, mass", "name: tool, mass"),
     "payloads[0].name", ("'tool' is the name of another", "give each a name of its own")),
    ("hang-off without a rope", spoilt("from: stern, to: hook", "from: hook, to: tool"),
     "hang_offs[0]", ("no rope comes from 'stern'",)),
    ("bar to nowhere", spoilt("between: [hook, tool]", "between: [hook, tol]"),
     "struts[0].between[1]", ("no payload or joint 'tol'", "did you mean 'tool'?")),
    ("bar onto itself", spoilt("between: [hook, tool]", "between: [tool, tool]"),
     "struts[0].between", ("both ends are at 'tool'",)),
    ("bar with three ends", spoilt("between: [hook, tool]", "between: [hook, tool, hook]"),
     "struts[0].between", ("3 values in the list", "give 2")),
    ("unknown key of a joint", spoilt("mass_kg: 100.0", "mas_kg: 100.0"),
     "joints[0].mas_kg", ("unknown key", "did you mean 'mass_kg'?")),
    ("bending that is not listed",
     spoilt("from: stern,", "from: stern, bending: {stiffness_n_m2: 1.0},"),
     "ropes[3].bending", ("the effect `bending` is not listed", "list it")),
    ("a joint that holds a direction",
     spoilt("from: hook, to: tool", f"{CLAMPED}, from: hook, to: tool")
     .replace("  - weight: {}", "  - weight: {}\n  - bending: {stiffness_n_m2: 1.0}"),
     "ropes[1].bending.clamped_along", ("begins at 'hook', which is a hinge", "only a hang-off")),
    ("a net at no payload", spoilt("  - weight: {}", f"  - weight: {{}}\n  - {NET_AT % 'tol'}"),
     "effects.net.payload", ("there is no payload 'tol'", "did you mean 'tool'?")),
    ("a net of its own that is not listed",
     spoilt("  - name: tool\n", f"  - name: tool\n    {NET}\n"),
     "payloads[0].net", ("the effect `net` is not listed", "list it")),
    ("a payload's net that is at another",
     spoilt("  - name: tool\n", f"  - name: tool\n    {NET_AT % 'hook'}\n"),
     "payloads[0].net.payload", ("unknown key",)),
    ("a fairing that is towed and one that is not",
     spoilt("  - name: tool\n", "  - name: tool\n    fairing: {face_m2: 1.0}\n")
     .replace("  - weight: {}", "  - weight: {}\n  - fairing: {face_m2: 1, tow_speed_m_per_s: 1}"),
     "payloads[0].fairing", ("one has a tow speed", "give both a tow_speed_m_per_s, or neither")),
    ("no payload effect", spoilt("  - payload: {}\n", ""),
     "effects", ("`payload` is not listed", "add `- payload: {}`")),
]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "place", "words"), [row[1:] for row in BAD], ids=[row[0] for row in BAD]
)
def test_invalid_rigging_is_rejected(
    text: str, place: str, words: tuple[str, ...], tmp_path: Path
) -> None:
    assert_refused(text, place, words, tmp_path)


def test_ropes_are_connected_as_the_scene_lists_them(tmp_path: Path) -> None:
    """Joints, ends, the payload with the first rope that holds it, the bar's weight at its ends."""
    scene = load_scene(written(tmp_path, MEETING))
    assert [line.from_ for line in scene.ropes] == ["winch", "hook", "hook", "stern"]
    built = build_joined(scene)
    joints = built.system.joints
    assert joints.lower.tolist() == [1, 0, LOOSE, 1], "payloads are counted before joints"
    assert joints.upper.tolist() == [LOOSE, 1, 1, LOOSE]
    assert built.owners == {"hook": 0, "tool": 1}
    assert joints.ties.shape[1] == 1
    assert [rope.model.first_free for rope in built.system.ropes] == [1, 1, 1, 1]
    masses = [rope.effects[-1].Mx for rope in built.system.ropes]
    assert masses[0] == pytest.approx(100.0)
    assert masses[1] > 20e3
    assert masses[2:] == [0.0, 0.0]
    assert len({rope.model.tolerance for rope in built.system.ropes}) == 1
    whole = alone(scene, 3)
    assert whole.ropes[0].length_m == 501.0
    assert whole.payloads[0].mass_kg == pytest.approx(20100.0)
    assert not any("ropes[1].damping" in warning for warning in sense_checks(scene))


TOWED = "fairing: {face_m2: 3.0, tow_speed_m_per_s: 2.0, axis: [0.0, 1.0, 0.0], payload: second}"


@jit_entry
def pick(effects: Any, r: int, values: Floats) -> None:
    """Return the numbers of rope r's net and towed fairing."""
    net, fairing = effects_at(effects, r)
    values[0], values[1], values[2], values[3], values[4] = net
    values[5], values[6], values[7], values[8], values[9] = fairing


def test_each_rope_has_the_net_and_the_fairing_of_its_payload(tmp_path: Path) -> None:
    """The payload's own, the effect's at the payload that it names, or none; and so stacked."""
    second = "  - {name: second, mass_kg: 9.0, shape: {box: {length_m: 1, width_m: 1, height_m: 1}}"
    text = (
        MEETING.replace("payloads:\n", f"payloads:\n{second}, {NET}}}\n", 1)
        .replace("joints:\n", f"  - {{name: low, {LEG}, from: hook, to: second}}\njoints:\n", 1)
        .replace("  - weight: {}", f"  - weight: {{}}\n  - {NET_AT % 'tool'}\n  - {TOWED}")
        .replace("payload: tool}", "payload: tool, panels: 3}")
    )
    system = build_joined(load_scene(written(tmp_path, text))).system
    own = [rope.effects[-2:] for rope in system.ropes]
    values = np.zeros(10)
    for r, (net, fairing) in enumerate(own):
        pick(system.stack.effects[-2:], r, values)
        assert values.tolist() == [*net, *fairing]
    nets, fairings = zip(*own, strict=True)
    carries_tool, carries_second = 1, 4
    assert [r for r, net in enumerate(nets) if net.along != 0.0] == [carries_tool, carries_second]
    assert nets[carries_tool].along > 2.0 * nets[carries_second].along, "three panels"
    assert [r for r, fairing in enumerate(fairings) if fairing.force] == [carries_second]
    assert fairings[carries_second].force == pytest.approx(-0.5 * 1025.0 * 3.0 * 4.0)


@pytest.mark.parametrize("name", ["bridle_lift", "two_line_lift"])
def test_the_initial_shape_keeps_every_length(name: str) -> None:
    """No rope longer than it is by more than 1 %, bars as long as they are by 2 %."""
    scene = load_scene(name)
    where = first_places(scene)
    for line in scene.ropes:
        distance = float(np.linalg.norm(where[line.from_] - where[line.to]))
        assert distance < 1.01 * line.length_m
        assert distance > 0.9 * line.length_m, "it hangs"
    for strut in scene.struts:
        one, other = (where[end] for end in strut.between)
        assert float(np.linalg.norm(one - other)) == pytest.approx(strut.length_m, rel=0.02)


@pytest.mark.parametrize("up", [False, True])
@pytest.mark.parametrize(
    ("low", "high", "length"),
    [
        ((0.0, 0.0, -30.0), (20.0, 10.0, 0.0), 60.0),
        ((5.0, 0.0, -10.0), (5.0, 0.0, -10.5), 12.0),
        ((0.0, 0.0, -9.0), (0.0, 0.0, 0.0), 9.2),
        ((0.0, 0.0, 0.0), (3.0, 4.0, 0.0), 5.001),
    ],
)
def test_a_slack_rope_starts_as_a_catenary(
    low: Place, high: Place, length: float, up: bool
) -> None:
    """Its ends where they belong, its elements of one length, bending one way only."""
    nodes = initial_shape(np.array(low), np.array(high), np.linspace(0.0, length, 201), up)
    assert np.allclose(nodes[:, 0], low, atol=1e-9)
    assert np.allclose(nodes[:, -1], high, atol=1e-6 * length)
    elements = np.linalg.norm(np.diff(nodes), axis=0)
    assert elements.sum() == pytest.approx(length, rel=2e-2)
    assert elements.max() < 1.001 * length / 200
    slopes = np.diff(nodes[2])
    assert ((np.diff(slopes) > -1e-9) != up).all() or ((np.diff(slopes) < 1e-9) == up).all()


def test_the_clamp_of_every_rope_is_checked(tmp_path: Path) -> None:
    """Its own stiffness and clamp at a hang-off; the ropes that begin at a hook have none."""
    text = MEETING.replace(
        "from: stern, to: hook", f"from: stern, to: hook, {CLAMPED.replace('1.0', '1.0e+5', 1)}"
    ).replace("effects:\n", "effects:\n  - bending: {stiffness_n_m2: 1.0e+5}\n")
    computed = [one for one in sense_checks(load_scene(written(tmp_path, text))) if "clamp" in one]
    assert len(computed) == 1, computed
    assert computed[0].startswith("ropes[3].elements: elements of 10 m spread the bend")
    without = load_scene(written(tmp_path, MEETING))
    assert not [one for one in sense_checks(without) if "clamp" in one]
