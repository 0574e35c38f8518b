"""Plausibility checks: valid but unlikely values, reported in numbers with a remedy.

A check never stops or changes anything. Each yields sentences `where: what; remedy.`
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from math import asin, ceil, degrees, floor, hypot, inf, pi, sqrt

from rope_twin.effects.bending import BendingParams
from rope_twin.effects.current import CurrentParams
from rope_twin.effects.drag import DragParams
from rope_twin.effects.hull_contact import HullContactParams
from rope_twin.effects.rigid_body import RigidBodyParams, Sling
from rope_twin.effects.rope_in_air import WettingParams
from rope_twin.errors import phrase
from rope_twin.quantity import kilonewtons
from rope_twin.scene.grid import tension_at_length
from rope_twin.scene.lift import (
    LiftFigures,
    alone,
    lift_figures,
    listed_effects,
    schedule_meets_limit,
    suspended_weights,
)
from rope_twin.scene.rigging import NetPart, is_joined, places
from rope_twin.scene.rope_data import SAFETY_FACTOR
from rope_twin.scene.schema import RopeLine, Scene
from rope_twin.scene.shapes import Box
from rope_twin.scene.vortex import (
    check_vortex_inputs,
    check_vortex_resolution,
    model_beside,
    shedding_model,
)
from rope_twin.scene.water_warnings import (
    check_compensator,
    check_current,
    check_depth_profiles,
    check_environment,
    check_slamming,
    check_water,
    check_winch,
    is_air,
    moored_up,
)


def check_load(scene: Scene, figures: LiftFigures) -> Iterator[str]:
    """Check the static load at the start and at maximum payout."""
    line = scene.ropes[0]
    lengths = {"ropes[0]": (line.length_m, "")}
    if scene.winch:
        shortest_m, longest_m = scene.winch.min_line_out_m, scene.winch.max_line_out_m
        if figures.suspended.dry_share(shortest_m) > 0.0:
            when = f" with {shortest_m:g} m out, above the water,"
            lengths["winch.min_line_out_m"] = (shortest_m, when)
        lengths["winch.max_line_out_m"] = (longest_m, f" with {longest_m:g} m out")
    for path, (length, when) in lengths.items():
        rope, tension = figures.weakest(length)
        if line.fixed_at_m or tension <= rope.breaking_load_n / SAFETY_FACTOR:
            continue
        called = rope.about or f"the {1e3 * rope.diameter_m:g} mm rope"
        top = "top tension" if len(figures.bars) == 1 else f"tension of {called}"
        words = f"static {top} {kilonewtons(tension)}{when}"
        yield _weak(path, words, tension / rope.breaking_load_n, rope.breaking_load_n)
        return


def load_together(scene: Scene) -> Iterator[str]:
    """Check what the ropes from the ship carry together; the actual distribution is less even."""
    load = suspended_weights(scene)
    if load is None:
        return
    path, when, tension = "ropes[0]", "", load.weight_n
    if len(load.lines) > 1:
        path, words = "ropes", f"{len(load.lines)} ropes from the ship together carry"
    else:
        words = "static top tension"
        if scene.winch and tension <= load.breaking_load_n / SAFETY_FACTOR:
            longest_m = scene.winch.max_line_out_m
            tension, when = load.weight_at(longest_m), f" with {longest_m:g} m out"
            path = "winch.max_line_out_m"
    if tension > load.breaking_load_n / SAFETY_FACTOR:
        words = f"{words} {kilonewtons(tension)}{when}"
        yield _weak(path, words, tension / load.breaking_load_n, load.breaking_load_n)


def _weak(path: str, words: str, utilisation: float, breaking_n: float) -> str:
    """Return the warning of a tension beyond the safety factor, or beyond the MBL."""
    problem = f"{words} against a breaking load of {kilonewtons(breaking_n)}"
    if utilisation >= 1.0:
        problem, remedy = f"{problem}: rope breaks", "take stronger rope or a lighter load"
    else:
        problem = f"{problem}, a safety factor of {1.0 / utilisation:.2f}"
        remedy = f"below {SAFETY_FACTOR:g} take stronger rope or a lighter load"
    return phrase(path, problem, remedy)


ANOTHER_SIZE = 0.2  # relative difference of a length of shape and outline that is accepted
FLATTEST_DEG = 60.0  # of a sling from the vertical: its tension is then twice its share
LONGEST_STRETCH = 0.1  # of a sling's length


def check_body(scene: Scene, figures: LiftFigures) -> Iterator[str]:
    """Check the outline, and slings that are too flat or too soft."""
    body = scene.listed(RigidBodyParams)
    if body is None:
        return
    yield from _size(scene, body)
    numbers_of: dict[str, list[str]] = {}
    for number, sling in enumerate(body.slings):
        for warning in _sling(body, sling, figures.payload_weight_n):
            numbers_of.setdefault(warning, []).append(str(number))
    for warning, numbers in numbers_of.items():
        yield f"effects.rigid_body.slings[{', '.join(numbers)}]{warning}"


def _size(scene: Scene, body: RigidBodyParams) -> Iterator[str]:
    shape = scene.payloads[0].shape
    if not isinstance(shape, Box):
        return
    box = (shape.length_m, shape.width_m, shape.height_m)
    if any(abs(a - b) > ANOTHER_SIZE * max(a, b) for a, b in zip(box, body.size_m, strict=True)):
        sides = [" × ".join(f"{side:g}" for side in size) for size in (body.size_m, box)]
        problem = f"{sides[0]} m, and the payload's shape is a box of {sides[1]} m"
        remedy = "give one size: inertia and contact use the first, drag and added mass this one"
        yield phrase("effects.rigid_body.size_m", problem, remedy)


def _sling(body: RigidBodyParams, sling: Sling, weight_n: float) -> Iterator[str]:
    """Check one sling, with the hook above the middle of the attachment points."""
    middle = [sum(one.to_m[axis] for one in body.slings) / len(body.slings) for axis in (0, 1)]
    offset_m = hypot(sling.to_m[0] - middle[0], sling.to_m[1] - middle[1])
    length = sling.length_m
    if offset_m >= length:
        problem = f"{length:g} m does not reach the hook at a lateral offset of {offset_m:.2f} m"
        yield phrase(".length_m", problem, f"give more than {offset_m:.2f} m")
        return
    angle = degrees(asin(offset_m / length))
    if angle > FLATTEST_DEG:
        lean = f"{length:g} m is {angle:.0f}° from the vertical"
        problem = f"{lean}: more than twice its share of the load"
        yield phrase(".length_m", problem, f"give {offset_m / sqrt(0.75):.1f} m or more")
    pull = max(weight_n, 0.0) / len(body.slings) * length / sqrt(length**2 - offset_m**2)
    stretch = pull / sling.stiffness_n_per_m
    if stretch > LONGEST_STRETCH * length:
        problem = f"its share of the load, {kilonewtons(pull)}, stretches it by {stretch:.2g} m"
        yield phrase(".stiffness_n_per_m", problem, "give EA over length in N/m, not kN/m")


LONGEST_ELEMENT_M, SHORTEST_ELEMENT_M = 50.0, 0.5
SMEARED_SHARE = 0.05  # of the side force of the hull, h/(4·z)
CLAMP_EXCESS = 0.12  # of a bend radius at a clamp: that of elements of √(EI/T)
LARGEST_DAMPING = 0.1  # damping ratio
# Measured with TR-BDF2 on snapping ropes: peak 0.2, 1 and 6 % low at T/h = 200, 100 and 40.
STEPS_PER_PERIOD = 100.0
STEPS_PER_ROPE_WAVE = 10.0
STEPS_PER_WAVE = 50.0
SHORTEST_WAVE_S = 2.5  # 0.4 Hz, the end of a measured wave spectrum
SHORTEST_RAMP_S = 2.0
WAVE_SPEEDS_M_PER_S = (800.0, 12000.0)  # nylon and polyester to HMPE under load
ROPE_DENSITIES_KG_PER_M3 = (300.0, 9000.0)
# A smooth cylinder in the drag crisis has about 0.3; mooring chain 2.4 across it and 1.15/π along
# it (DNV-OS-E301):
MIN_NORMAL_DRAG, CHAIN_NORMAL_DRAG, MAX_TANGENTIAL_DRAG = 0.3, 2.0, 0.2
DRY_ROPE_SHARE = 0.005  # of the static top tension: error accepted for rope above the water
Check = Callable[[Scene, LiftFigures], Iterator[str]]


def sense_checks(scene: Scene) -> list[str]:
    """Return every warning that the scene does not accept, one sentence each.

    Raises:
        SceneError: the payload's properties are incomplete.
    """
    return _without_accepted(scene, _warnings(scene))


def _without_accepted(scene: Scene, warnings: list[str]) -> list[str]:
    return [words for words in warnings if not any(a.matches(words) for a in scene.accept)]


def validity_warnings(scene: Scene) -> list[str]:
    """Return the warnings on what the scene's model leaves out or has in an unlikely size.

    Those that the scene does not accept. Mesh and step belong to its convergence study, loads and
    schedules to its limits.

    Raises:
        SceneError: the payload's properties are incomplete.
    """
    return _without_accepted(scene, _warnings(scene, [check for check in CHECKS if CHECKS[check]]))


def accepted_warnings(scene: Scene) -> tuple[list[str], list[str]]:
    """Return the accepted warnings with their reasons, and the entries without a warning.

    Raises:
        SceneError: the payload's properties are incomplete.
    """
    warnings, accepted, idle = _warnings(scene), [], []
    for number, entry in enumerate(scene.accept):
        matching = [words for words in warnings if entry.matches(words)]
        accepted += [f"{words} Reason: {entry.reason.rstrip('.')}." for words in matching]
        if not matching:
            problem = f"the scene has no warning at '{entry.key}' with the words '{entry.says}'"
            idle.append(phrase(f"accept[{number}]", problem, "remove it, or name another"))
    return accepted, idle


def _warnings(scene: Scene, some: Sequence[Check] = ()) -> list[str]:
    """Return all warnings of some checks (default: all)."""
    checks = some or [*CHECKS]
    if is_joined(scene):
        return list(_joined(scene, checks))
    figures = lift_figures(scene)
    return [warning for check in checks for warning in check(scene, figures)]


def _joined(scene: Scene, checks: Sequence[Check]) -> Iterator[str]:
    """Check the first rope with the total suspended load, and mesh and properties of the others."""
    if check_load in checks:
        yield from load_together(scene)
    first, clamps = alone(scene, 0), list[str]()
    for check in checks:
        if check is not check_load:
            checked = scene if check is check_slamming else first
            warnings = list(check(checked, lift_figures(first)))
            clamps += warnings if check is _bending else []
            yield from warnings
    for number, line in enumerate(scene.ropes):
        if number == 0 or isinstance(line, NetPart):
            continue
        single = alone(scene, number)
        figures = lift_figures(single)
        for check in (_elements, _bend_radius, _rope_figures, _damping, _bending):
            if check not in checks or (check is _bending and line.from_ not in places(scene)):
                continue  # a rope that does not begin at the ship begins at a hinge
            for warning in check(single, figures):
                words = warning.replace("ropes[0]", f"ropes[{number}]", 1)
                if check is not _bending or words not in clamps:  # the effect's is of all ropes
                    clamps.append(words)
                    yield words


def _fixed_end(scene: Scene, figures: LiftFigures) -> Iterator[str]:
    line = scene.ropes[0]
    if not line.fixed_at_m:
        return
    weakest = min(bar.rope.breaking_load_n for bar in figures.bars)
    tension = tension_at_length(figures.bars, figures.chord_m)
    if tension > weakest / SAFETY_FACTOR:
        problem = (
            f"the fixed end is {figures.chord_m:.1f} m from the hang-off, which stretches "
            f"{line.length_m:g} m of rope to {kilonewtons(tension)}"
        )
        yield phrase("ropes[0].fixed_at_m", problem, "give more rope, or a nearer end")


def _elements(scene: Scene, figures: LiftFigures) -> Iterator[str]:
    line, length = scene.ropes[0], figures.longest_element_m
    if length > LONGEST_ELEMENT_M:
        problem = f"elements of {length:.1f} m are coarse for waves and curvature of the rope"
        fewest = ceil(line.length_m / LONGEST_ELEMENT_M)
        remedy = f"give at least {fewest} (4 m where slack matters)"
        yield phrase("ropes[0].elements", problem, remedy)
    length = figures.shortest_element_m
    fine = line.grading is not None or (shedding_model(scene) and model_beside(scene) is None)
    sufficient = max(3, floor(line.length_m / SHORTEST_ELEMENT_M))
    if length < SHORTEST_ELEMENT_M and line.elements > sufficient and not fine:
        problem = f"elements of {length:.2g} m cost time and bring no accuracy"
        yield phrase("ropes[0].elements", problem, f"{sufficient} elements are sufficient")


def _hull_edges(scene: Scene, figures: LiftFigures) -> Iterator[str]:
    """Check elements that cross the hull's edges: their side force is up to h/(4·z) too large."""
    hull = scene.listed(HullContactParams)
    depths = [0.5 * box.size_m[2] - box.centre_m[2] for box in hull.boxes] if hull else []
    z = min((depth for depth in depths if depth > 0.0), default=inf)
    h = figures.longest_element_m
    if h > 4.0 * SMEARED_SHARE * z:
        problem = f"elements of {h:.1f} m spread the bend at an edge {z:g} m below the hang-off"
        fewest = ceil(scene.ropes[0].length_m / (4.0 * SMEARED_SHARE * z))
        remedy = f"expect a side force up to {25.0 * h / z:.0f} % too large, or give {fewest}"
        yield phrase("ropes[0].elements", problem, remedy)


def _bend_radius(scene: Scene, figures: LiftFigures) -> Iterator[str]:
    """Check the mesh for the minimum bend radius: a shorter arc is not resolved."""
    line, length = scene.ropes[0], figures.longest_element_m
    radius = min((bar.rope.minimum_bend_radius_m or inf for bar in figures.bars), default=inf)
    if length > radius * (1.0 + 1e-9):
        problem = f"elements of {length:.3g} m cannot resolve minimum_bend_radius_m, {radius:g} m"
        remedy = f"give at least {ceil(line.length_m / radius)}, or shorter ones where it bends"
        yield phrase("ropes[0].elements", problem, remedy)


def _rope_figures(scene: Scene, figures: LiftFigures) -> Iterator[str]:
    for number, bar in enumerate(figures.bars):
        path = "ropes[0].rope" if len(figures.bars) == 1 else f"ropes[0].sections[{number}].rope"
        rope, speed = bar.rope, sqrt(bar.stiffness_n / bar.rope.mass_kg_per_m)
        yield from _coefficients(path, "drag_", rope.drag_normal, rope.drag_tangential)
        low, high = WAVE_SPEEDS_M_PER_S
        if not low <= speed <= high:
            usual = "steel wire 3200, polyester 2500, HMPE 8500"
            problem = f"axial waves travel at {speed:.0f} m/s ({usual})"
            yield phrase(path, problem, "check axial_stiffness_n [N] and mass_kg_per_m")
        density = rope.mass_kg_per_m / (0.25 * pi * rope.hydrodynamic_diameter_m**2)
        low, high = ROPE_DENSITIES_KG_PER_M3
        if not low <= density <= high:
            problem = f"its mass over its volume is {density:.0f} kg/m³ (steel wire 7900, HMPE 975)"
            yield phrase(path, problem, "check mass_kg_per_m and hydrodynamic_diameter_m")


def _drag(scene: Scene, figures: LiftFigures) -> Iterator[str]:
    """Check the drag coefficients of ropes without their own."""
    drag = scene.listed(DragParams)
    if drag is None:
        return
    rows = drag.over_reynolds
    if drag.over_keulegan_carpenter is not None:
        rows = tuple(row for table in drag.over_keulegan_carpenter.tables for row in table.rows)
    factor = max((factor for _, factor in rows), default=1.0)
    yield from _coefficients("effects drag", "", factor * drag.normal, drag.tangential)


def _coefficients(
    path: str, prefix: str, normal: float | None, tangential: float | None
) -> Iterator[str]:
    if normal is not None and normal < MIN_NORMAL_DRAG:
        problem = f"{normal:g} is below the normal drag of a smooth cylinder in the drag crisis"
        remedy = "wire and fibre rope have 1 to 1.8, chain 2.4"
        yield phrase(f"{path}.{prefix}normal", problem, remedy)
    chain = normal is not None and normal >= CHAIN_NORMAL_DRAG
    if tangential is not None and tangential > MAX_TANGENTIAL_DRAG and not chain:
        problem = f"{tangential:g} is too large for tangential drag, on π times the diameter"
        remedy = "wire and fibre rope have 0.01 to 0.1, chain 0.37 with 2.4 normal to it"
        yield phrase(f"{path}.{prefix}tangential", problem, remedy)


def _payload_floats(scene: Scene, figures: LiftFigures) -> Iterator[str]:
    if figures.payload is None or moored_up(scene, figures):
        return
    in_air = figures.payload.mass_kg * scene.environment.gravity_m_per_s2
    weight, volume = figures.payload_weight_n, figures.payload.volume_m3
    if weight >= 0.05 * in_air and weight > 0.0:
        return
    state = "floats" if weight <= 0.0 else "nearly floats"
    problem = (
        f"it {state}: {kilonewtons(in_air, 1)} in air displaces {volume:.2f} m³ and weighs "
        f"{kilonewtons(weight, 1)} in water"
    )
    remedy = "give more mass_kg, or the displaced_volume_m3 of a frame or flooded body"
    yield phrase("payloads[0]", problem, remedy)


def _rope_floats(scene: Scene, figures: LiftFigures) -> Iterator[str]:
    line = scene.ropes[0]
    lift = -figures.rope_weight_n_per_m * line.length_m
    if figures.payload is None or lift <= max(figures.payload_weight_n, 0.0) / SAFETY_FACTOR:
        return
    problem = (
        f"the rope floats with {kilonewtons(lift, 2)} over {line.length_m:g} m against "
        f"{kilonewtons(figures.payload_weight_n, 2)} of payload"
    )
    yield phrase("ropes[0]", problem, "give a heavier payload, or the rope goes slack or rises")


def _effects(scene: Scene, figures: LiftFigures) -> Iterator[str]:
    listed = listed_effects(scene)
    if "weight" not in listed:
        problem = "`weight` is not listed: the rope has neither weight nor buoyancy"
        yield phrase("effects", problem, "add `- weight: {}`")
    if scene.payloads and not {"payload", "rigid_body"}.intersection(listed):
        problem = f"`payload` is not listed: '{scene.payloads[0].name}' has no mass, weight or drag"
        yield phrase("effects", problem, "add `- payload: {}`")
    for name, loss in (("waves", "only the water's acceleration acts on the rope"),
                       ("current", "it has no effect on the rope")):  # fmt: skip
        if name in listed and "drag" not in listed:
            problem = f"`{name}` is listed without `drag`: {loss}"
            yield phrase("effects", problem, "add `- drag: {normal: ..., tangential: ...}`")


def _bending(scene: Scene, figures: LiftFigures) -> Iterator[str]:
    bending = scene.ropes[0].bending or scene.listed(BendingParams)
    if scene.winch and bending and bending.clamped_along is not None:
        problem = "rope from a winch is clamped in one direction (transients where elements split)"
        yield phrase("effects bending.clamped_along", problem, "remove it, or the winch")
    elif bending and bending.clamped_along is not None:
        yield from _clamp(bending.stiffness_n_m2, scene.ropes[0], figures)


def _clamp(EI: float, line: RopeLine, figures: LiftFigures) -> Iterator[str]:
    """Check the mesh at a clamp, from which the bend decays over √(EI/T).

    With x = l/√(EI/T) the turns of the elements l from there decay by r, r + 1/r - 2 = x², and of
    the clamp's angle θ the first has s·θ, 1/s = 1 + (1 - r + x²)/2: curvature 2·(1 - s)·θ/l instead
    of θ/√(EI/T) (derived from the balance of moments in effects/bending.py, small angles).
    """
    tension = figures.top_tension_n(line.length_m)
    if line.fixed_at_m:
        tension = tension_at_length(figures.bars, figures.chord_m)
    if EI == 0.0 or tension <= 0.0:
        return
    reach, length = sqrt(EI / tension), figures.longest_element_m
    x = length / reach
    decay = 1.0 + 0.5 * x * x - x * sqrt(1.0 + 0.25 * x * x)
    turned = 1.0 / (1.0 + 0.5 * (1.0 - decay + x * x))
    excess = 0.5 * x / (1.0 - turned) - 1.0
    if excess > CLAMP_EXCESS:
        problem = (
            f"elements of {length:.2g} m spread the bend at clamped_along, which decays over "
            f"√(EI/T) = {reach:.2g} m: its radius is {100.0 * excess:.0f} % too large"
        )
        yield phrase("ropes[0].elements", problem, f"give {ceil(line.length_m / reach)} or more")


def _step(scene: Scene, figures: LiftFigures) -> Iterator[str]:
    step = scene.time.step_s
    rope_wave = 2.0 * scene.ropes[0].length_m / figures.axial_wave_speed_m_per_s
    limits = [
        (rope_wave, STEPS_PER_ROPE_WAVE, "the rope's own axial wave", "that wave is damped out"),
        (SHORTEST_WAVE_S, STEPS_PER_WAVE, "the shortest sea waves", "they are not resolved"),
    ]
    if figures.payload is not None:
        name = "the first axial period of rope and payload"
        limits.append((figures.first_axial_period_s, STEPS_PER_PERIOD, name, "snap loads too low"))
    for period, steps, name, loss in limits:
        if step * steps > period * (1.0 + 1e-9):
            problem = f"{step:g} s is coarse for {name}, {period:.3g} s ({loss})"
            yield phrase("time.step_s", problem, f"give {period / steps:.2g} s or less")


def _damping(scene: Scene, figures: LiftFigures) -> Iterator[str]:
    path, fraction = "ropes[0].damping", figures.damping_fraction
    line = scene.ropes[0]
    if line.damping.fraction_of_one_element is not None:
        c = max(figures.damping_newton_seconds)
        problem = (
            f"given per element: {line.elements} elements give {c:.3g} N·s, "
            f"{100.0 * fraction:.2g} % of critical on the first axial mode, twice as many give half"
        )
        remedy = f"give `fraction_of_first_axial_mode: {fraction:.3g}`, independent of the mesh"
        yield phrase(path, problem, remedy)
    if fraction > LARGEST_DAMPING:
        problem = f"{100.0 * fraction:.0f} % of critical on the first axial mode"
        yield phrase(path, problem, "steel wire has 1 to 2 %, HMPE 3 to 5 %")
    if fraction == 0.0:
        problem = "without damping the peak of a snap load has no limit with mesh refinement"
        yield phrase(path, problem, "steel wire has 1 to 2 % of critical, HMPE 3 to 5 %")


def _schedule(scene: Scene, figures: LiftFigures) -> Iterator[str]:
    winch = scene.winch
    if winch is None:
        return
    met = schedule_meets_limit(winch, scene.ropes[0].length_m)
    if met is not None:
        when, limit = met
        name = "max_line_out_m" if limit == winch.max_line_out_m else "min_line_out_m"
        problem = f"it drives the paid-out length to {name} ({limit:g} m) after {when:.0f} s"
        remedy = "the winch stops there; let the schedule return, or change the limit"
        yield phrase("winch.schedule", problem, remedy)
    fastest = max((row.speed_m_per_s or 0.0 for row in winch.schedule), default=0.0)
    sinking = figures.sinking_speed_m_per_s(scene.environment.water_density_kg_per_m3)
    if figures.payload is not None and fastest > sinking:
        problem = f"it lowers at {fastest:g} m/s but the payload sinks at {sinking:.2f} m/s"
        yield phrase("winch.schedule", problem, "lower more slowly, or the rope goes slack")


def _limits(scene: Scene, figures: LiftFigures) -> Iterator[str]:
    utilisation = scene.limits.utilisation
    if utilisation > 1.0:
        problem = f"{utilisation:g} allows {utilisation:g} times the MBL of a rope"
        yield phrase("limits.utilisation", problem, "give a fraction of the MBL, as 0.3 for 30 %")


def _ship(scene: Scene, figures: LiftFigures) -> Iterator[str]:
    ramp = scene.ship.motion_ramp_s
    heave = scene.sea_state.heave
    fastest = 2.0 * pi * heave.amplitude_m / heave.period_s if heave else 0.0
    sinking = figures.sinking_speed_m_per_s(scene.environment.water_density_kg_per_m3)
    if 0.0 < sinking < fastest:
        down = f"the hang-off descends at up to {fastest:.2f} m/s"
        problem = f"{down}, the payload sinks at {sinking:.2f}"
        remedy = "expect a slack rope and snap loads, or less heave"
        yield phrase("sea_state.heave", problem, remedy)
    if scene.sea_state.moves and ramp < SHORTEST_RAMP_S:
        problem = f"the ship's motion builds up within {ramp:g} s, which excites the rope"
        yield phrase("ship.motion_ramp_s", problem, "give 8 s or so")


def _dry_rope(scene: Scene, figures: LiftFigures) -> Iterator[str]:
    """Check rope above the water, which is computed with the water's buoyancy and current."""
    height = min(scene.ship.hang_off_m[2], scene.ropes[0].length_m)
    if height <= 0.0 or is_air(scene) or scene.listed(WettingParams) is not None:
        return
    rope, environment = figures.bars[-1].rope, scene.environment
    density = environment.water_density_kg_per_m3
    area = 0.25 * pi * rope.hydrodynamic_diameter_m**2
    lift = density * environment.gravity_m_per_s2 * area * height
    current, drag = scene.listed(CurrentParams), scene.listed(DragParams)
    push = 0.0
    if current is not None and drag is not None:
        frontal = drag.normal * rope.hydrodynamic_diameter_m * height
        push = 0.5 * density * frontal * hypot(*current.points[0][1][:2]) ** 2
    tension = abs(figures.top_tension_n(scene.ropes[0].length_m))
    if scene.ropes[0].fixed_at_m:
        tension = tension_at_length(figures.bars, figures.chord_m)
    if max(lift, push) > DRY_ROPE_SHARE * tension:
        problem = (
            f"{height:g} m of rope above the water is computed as submerged, with "
            f"{lift:.0f} N of buoyancy and {push:.0f} N of drag in the surface current in excess"
        )
        remedy = f"expect this error in the top tension of {kilonewtons(tension, 1)}"
        yield phrase("ship.hang_off_m[2]", problem, remedy)


# Every check in its order, and whether it is of what the model contains and of unlikely figures.
CHECKS: dict[Check, bool] = {
    check_load: False,
    _fixed_end: False,
    _elements: False,
    _hull_edges: False,
    _bend_radius: False,
    _rope_figures: True,
    _drag: True,
    _payload_floats: True,
    _rope_floats: False,
    _effects: True,
    _bending: True,
    _step: False,
    _damping: True,
    _schedule: False,
    check_winch: False,
    check_compensator: False,
    check_water: True,
    check_slamming: False,
    check_body: True,
    _limits: False,
    _dry_rope: True,
    _ship: False,
    check_current: True,
    check_depth_profiles: True,
    check_vortex_resolution: False,
    check_vortex_inputs: True,
    check_environment: True,
}
