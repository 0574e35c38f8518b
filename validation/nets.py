"""Nets along a rope: N1 the published coefficients, a line that hangs in a current, its modes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rope_twin.core.loads.panel import panel_coefficients
from rope_twin.effects.net_curtain import NetCurtainParams
from rope_twin.scene.schema import Scene
from rope_twin.studies.driven_twin import with_effect
from rope_twin.studies.modes import find_modes
from rope_twin.studies.picture import Line, Panel, Vector
from rope_twin.twin.twin import Twin
from validation.case import Case, Finding, Found, derived, within, within_pct
from validation.rigs import CALM, NOTHING, Rig, with_nothing_below

SOLIDITY, SPEED = 0.2, 0.5
NET = NetCurtainParams(
    to_m=80.0, width_m=4.0, twine_m=0.003, bar_m=0.03, solidity=SOLIDITY, heading_deg=90.0,
    twine_kg_per_m3=1380.0,
)  # fmt: skip
BARE = Rig(  # a line without drag: all that pulls aside is net
    length=100.0, elements=200, mass=0.5, diameter=0.02, EA=1e9, damping=1e5, density=1025.0,
    load=1500.0, current=((0.0, (SPEED, 0.0)), (-200.0, (SPEED, 0.0))),
)  # fmt: skip
PUBLISHED = {"aarsnes": (0.2600, 0.0532), "loeland": (0.2886, 0.0679)}
HEAVY_KG = 1e6  # holds the line upright: it leans by 1e-3
TAUT = replace(
    BARE, load=0.0, fixed_at=(0.0, 0.0, -100.5), current=((0.0, NOTHING[:2]),), EA=2e7,
    added_mass=1.0,
)  # fmt: skip


def _scene(net: NetCurtainParams, rig: Rig) -> Scene:
    """Return the rig's scene with the net, in waves of no height: the step of net_curtain."""
    return with_effect(with_effect(rig.scene(), CALM), net)


def _forces(net: NetCurtainParams, rig: Rig) -> Vector:
    """Return the horizontal force of the net over ½·ρ·A·U², east and north."""
    pull = Twin(_scene(net, rig)).snapshot().hang_off_force_n
    area = net.width_m * (net.to_m - net.from_m)
    return np.asarray(pull[:2] / (0.5 * rig.density * area * SPEED**2))


def _coefficients() -> list[Finding]:
    upright = replace(BARE, load=HEAVY_KG, EA=1e12)
    findings = []
    for law, (drag, lift) in PUBLISHED.items():
        normal, slanting = (
            _forces(replace(NET, law=law, heading_deg=heading), upright) for heading in (90.0, 45.0)
        )
        findings += [
            within(f"{law}: C_D across the flow, Sn 0.2", normal[0], drag, 1e-4),
            within(f"{law}: C_L at 45°, Sn 0.2", abs(float(slanting[1])), lift, 1e-4),
        ]
    return findings


def weighed_n_per_m(net: NetCurtainParams, rig: Rig) -> float:
    """Return the net's weight in water per metre of line, by its twine: 2/l metres a square metre.

    Derived from the meshes, apart from the effect's own code.
    """
    volume = 0.25 * math.pi * net.twine_m**2 * 2.0 / net.bar_m * net.width_m
    return (net.twine_kg_per_m3 - rig.density) * volume * rig.gravity


def solve_line(net: NetCurtainParams, rig: Rig, s: Vector) -> Vector:
    """Return the horizontal and vertical force in the line at s [N], (2, any); s[0] is its end.

    dH/ds = k·C_D(α), dV/ds = w - k·C_L(α) with k = ½·ρ·width·U² and tan α = H/V: a net whose far
    edge is held across the flow leans with its line, so that its lift is up. A free one has C_D
    0.04. Integrated from the payload up.
    """
    from scipy.integrate import solve_ivp

    parallel, facing, lift = panel_coefficients(net.law, SOLIDITY)
    if net.heading_deg is None:
        facing = lift = 0.0
    k, own_weight = 0.5 * rig.density * net.width_m * SPEED**2, weighed_n_per_m(net, rig)

    def slope(at: float, force: Vector) -> Vector:
        a = math.atan2(force[0], force[1])
        covered = 1.0 if at < net.to_m else 0.0
        C_D, C_L = parallel + facing * math.cos(a), lift * math.sin(2.0 * a)
        return np.array([covered * k * C_D, rig.weight + covered * (own_weight - k * C_L)])

    start = np.array([0.0, rig.load_weight])
    done = solve_ivp(slope, (0.0, rig.length), start, t_eval=s, rtol=1e-9, max_step=0.05)
    return np.asarray(done.y)


def _hanging(net: NetCurtainParams, name: str) -> tuple[list[Finding], Line, Line]:
    snapshot = Twin(_scene(net, BARE)).snapshot()
    place = snapshot.node_position_m[::-1]
    steps = np.diff(place, axis=0)
    leans = np.degrees(np.arctan2(-steps[:, 0], steps[:, 2]))
    middles = (np.arange(BARE.elements) + 0.5) * BARE.length / BARE.elements
    H, V = solve_line(net, BARE, np.concatenate([[0.0], middles, [BARE.length]]))
    exact = np.degrees(np.arctan2(H, V))
    half = int(np.searchsorted(middles, 0.5 * net.to_m))
    findings = [
        within_pct(f"{name}: lean halfway up the net", leans[half], exact[half + 1], 0.3, "°"),
        within_pct(f"{name}: lean above the net", leans[-1], exact[-2], 0.3, "°"),
        within_pct(
            f"{name}: top tension", snapshot.tension_top_n, math.hypot(H[-1], V[-1]), 0.1, "N"
        ),
    ]
    if net.heading_deg is None:  # closed form: H and V are linear in s
        k = 0.5 * BARE.density * net.width_m * SPEED**2
        V_top = BARE.load_weight + BARE.weight * middles[-1] + weighed_n_per_m(net, BARE) * net.to_m
        lean = math.degrees(math.atan2(0.04 * k * net.to_m, V_top))
        findings.append(within_pct(f"{name}: the same, closed form", leans[-1], lean, 0.1, "°"))
    return findings, Line(exact[1:-1], middles, name), Line(leans[::10], middles[::10], "", "k.")


def _taut(scene: Scene) -> list[float]:
    """Return the two lowest transverse frequencies, one in each direction [Hz]."""
    return sorted(mode.frequency_hz for mode in find_modes(scene, 4).lowest)[:2]


def _vibrating() -> list[Finding]:
    """Return the first mode along and across the panel: f = 1/(2·L)·√(T/m)."""
    net = replace(NET, to_m=TAUT.length)
    scene = with_nothing_below(_scene(net, TAUT))
    length = -TAUT.fixed_at[2] if TAUT.fixed_at else 0.0
    tension = TAUT.EA * (length / TAUT.length - 1.0)
    section = 0.25 * math.pi * net.twine_m**2 * 2.0 / net.bar_m * net.width_m
    line = TAUT.mass + TAUT.density * 0.25 * math.pi * TAUT.diameter**2
    slow, fast = _taut(scene)
    findings = []
    for name, ours, added in (("normal to the net", slow, 1.0), ("along its width", fast, 0.5)):
        m = line + section * (net.twine_kg_per_m3 + added * TAUT.density)
        m *= TAUT.length / length  # per stretched metre
        exact = 0.5 / length * math.sqrt(tension / m)
        findings.append(within_pct(f"taut between ends, mode 1 {name}", ours, exact, 0.1, "Hz"))
    return findings


def _nets() -> Found:
    free, *of_free = _hanging(replace(NET, heading_deg=None), "free edge")
    fixed, *of_held = _hanging(NET, "edge held across the flow")
    lean = Panel("lean in a current of 0.5 m/s; dots: ours", "[°]", "from the payload [m]",
                 (*of_free, *of_held))  # fmt: skip
    derived_findings = map(derived, (*free, *fixed, *_vibrating()))
    return Found((*_coefficients(), *derived_findings), (lean,))


CASES = (
    Case("N1", "net of panels along a line: coefficients, lean in a current, modes",
         "[SJTU] 2.4.2, values of the polynomials of Aarsnes, Rudi, Løland 1990 and Løland 1991 at "
         "Sn 0.2; the rest is derived: statics integrated by scipy, closed forms", _nets, 2.0),
)  # fmt: skip
