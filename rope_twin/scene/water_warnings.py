"""Warnings on a scene's water, ship motion and winches."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import pairwise
from math import dist, hypot, pi, radians, tanh

import numpy as np

from rope_twin.effects.compensator import CompensatorParams
from rope_twin.effects.current import CurrentParams, Point, Velocity
from rope_twin.effects.depth_profiles import DepthProfilesParams
from rope_twin.effects.fluid_ramp import FluidRampParams
from rope_twin.effects.payload import SplashZoneParams
from rope_twin.effects.seabed import SeabedParams
from rope_twin.effects.waves import WavesParams, components_of
from rope_twin.errors import phrase
from rope_twin.quantity import kilonewtons
from rope_twin.scene.environment import bed_at, reference_point_m, spectrum_of, vessel_raos
from rope_twin.scene.lift import LiftFigures, listed_effects, point_figures
from rope_twin.scene.rigging import body_payload, places, winches_by_name
from rope_twin.scene.schema import Scene
from rope_twin.sea.raos import FADE, long_wave_doubts
from rope_twin.sea.spectrum import BREAKING, steepness_warning

LONGEST_ARM_M = 400.0  # the longest ships
FASTEST_CURRENT_M_PER_S = 2.5  # maximum of the Gulf Stream; a tidal race may exceed it
THROUGH_M_PER_S = 0.01  # accepted vertical current through the surface or the seabed
LEFT_OUT = 0.01  # of a variance: accepted loss beyond an RAO table
ANOTHER = 0.2  # of the water depth: accepted difference of the waves' depth on a sloping seabed
SAGGING = 1.01  # length over depth up to which a rope hangs free
OTHER_MASS = 2.0  # accepted factor between the mass of water that slamming moves and added mass
SAGGING_UP = 10.0  # length over depth of the anchor up to which a mooring is taut


def check_water(scene: Scene, figures: LiftFigures) -> Iterator[str]:
    """Check ropes, winches and waves."""
    yield from _ends(scene, moored_up(scene, figures))
    for check in (_depth_orders, _steepness, _sea_steepness, _another_sea, _reach_of_responses,
                  _depth_of_waves, _arm, _never_whole, _wet_in_the_air):  # fmt: skip
        yield from check(scene)


def moored_up(scene: Scene, figures: LiftFigures) -> bool:
    """Return whether a buoyant payload is moored from below, by an anchor in the water."""
    return figures.rises and scene.ship.hang_off_m[2] < -figures.line.length_m / SAGGING_UP


def _ends(scene: Scene, at_top: bool) -> Iterator[str]:
    bed = scene.listed(SeabedParams)
    line, (x, y, z) = scene.ropes[0], scene.ship.hang_off_m
    if line.fixed_at_m is not None and line.fixed_at_m[2] > 0.0:
        problem = f"the lower end is fixed {line.fixed_at_m[2]:g} m above the water"
        yield phrase("ropes[0].fixed_at_m", problem, "z is positive upward: depths are negative")
    if bed is None:
        return
    height = z - bed_at(bed, x, y)
    if line.fixed_at_m is None and not at_top and line.length_m > SAGGING * height:
        problem = (
            f"{line.length_m:g} m of rope is out above a seabed {height:g} m below the hang-off"
        )
        remedy = "payload and rope start lying on it; give less rope if they should hang"
        yield phrase("ropes[0].length_m", problem, remedy)


def _depth_orders(scene: Scene) -> Iterator[str]:
    """Check for depths that the winch cannot reach, by its rope or because of the seabed."""
    bed, hang_offs = scene.listed(SeabedParams), places(scene)
    for name, winch in winches_by_name(scene).items():
        x, y, z = hang_offs[name]
        for number, row in enumerate(winch.schedule):
            if row.payload_depth_m is None:
                continue
            where = f"schedule of winch '{name}', row {number}"
            deepest_m = winch.max_line_out_m - z
            if row.payload_depth_m > deepest_m:
                problem = f"a depth of {row.payload_depth_m:g} m needs more rope than there is"
                remedy = f"give at most {deepest_m:g} m, or raise max_line_out_m"
                yield phrase(where, problem, remedy)
            elif bed is not None and -row.payload_depth_m < bed_at(bed, x, y):
                problem = f"a depth of {row.payload_depth_m:g} m is below the seabed"
                yield phrase(where, problem, f"the seabed is at {-bed_at(bed, x, y):g} m there")


def _steepness(scene: Scene) -> Iterator[str]:
    waves = scene.listed(WavesParams)
    if waves is None:
        return
    depth = waves.depth_m
    for where, system in waves.systems.items():
        if system.regular is None:
            continue
        height, period = system.regular.height_m, system.regular.period_s
        length = deep = scene.environment.gravity_m_per_s2 * period**2 / (2.0 * pi)
        if depth is not None and deep > 0.0:
            for _ in range(50):  # L = L₀·tanh(2π·d/L), underrelaxed by one half
                length = 0.5 * (length + deep * tanh(2.0 * pi * depth / length))
        steepest = BREAKING * length * (1.0 if depth is None else tanh(2.0 * pi * depth / length))
        if height > steepest:
            wave = f"a wave of {height:g} m in {period:g} s"
            problem = f"{wave} is {length:.0f} m long and would break"
            remedy = f"give at most {steepest:.1f} m, or longer"
            yield phrase(f"effects {where}.regular", problem, remedy)


def _sea_steepness(scene: Scene) -> Iterator[str]:
    waves = scene.listed(WavesParams)
    for name, system in {} if waves is None else waves.systems.items():
        spectrum = spectrum_of(system)
        where = f"effects {name}.{'measured' if system.jonswap is None else 'jonswap'}"
        gravity = scene.environment.gravity_m_per_s2
        if spectrum is not None and (warning := steepness_warning(where, spectrum, gravity)):
            yield warning


def _another_sea(scene: Scene) -> Iterator[str]:
    """Check for waves that act on the rope but not on the ship."""
    waves, sea = scene.listed(WavesParams), scene.sea_state
    if waves is None or sea.on_waves is not None:
        return
    remedy = "move it by these waves: `sea_state: {on_waves: {}}`"
    if not sea.moves:
        problem = "`waves` act on the rope, and the ship does not move"
        yield phrase("sea_state", problem, f"{remedy}, unless it is bottom-founded")
    elif sea.bag and waves.regular is None:
        problem = f"the ship moves by the record '{sea.bag}', and `waves` act on the rope"
        yield phrase("sea_state", problem, f"these are two sea states; {remedy}")


def _reach_of_responses(scene: Scene) -> Iterator[str]:
    """Check for waves beyond an RAO table, where they make a difference."""
    waves, riding = scene.listed(WavesParams), scene.sea_state.on_waves
    if riding is None or not riding.responses or waves is None:
        return
    sea = components_of(waves, scene.environment.gravity_m_per_s2)
    table = vessel_raos(scene)
    assert table is not None, "its file is named"
    lowest, highest = (float(frequency_hz) for frequency_hz in table.frequency_hz[[0, -1]])
    x, y, z = scene.ship.hang_off_m
    a, b, c = reference_point_m(scene)
    where, frequency = "sea_state.on_waves.responses", sea.omega / (2.0 * pi)
    lost = table.share_left_out(sea, radians(riding.heading_deg), (x - a, y - b, z - c))
    if lost > LEFT_OUT:
        problem = (
            f"the table ends at {highest:.3g} Hz, and RAOs fade to zero by "
            f"{FADE * highest:.3g} Hz: up to {100.0 * lost:.2g} % of the variance of the "
            f"hang-off's motion is neglected (of waves up to {frequency.max():.3g} Hz)"
        )
        yield phrase(where, problem, "give a table to higher frequencies")
    variance = sea.amplitude_m**2
    left_out = float(variance[frequency < lowest].sum() / variance.sum())
    if left_out > LEFT_OUT:
        problem = (
            f"the table begins at {lowest:.3g} Hz, and {100.0 * left_out:.2g} % of the waves' "
            f"variance is below, where its first RAOs are used (from {frequency.min():.3g} Hz)"
        )
        yield phrase(where, problem, "give a table from lower frequencies")
    yield from (f"{where}: {doubt}" for doubt in long_wave_doubts(table))


def _depth_of_waves(scene: Scene) -> Iterator[str]:
    """Check the waves' own depth against the seabed."""
    waves, bed = scene.listed(WavesParams), scene.listed(SeabedParams)
    if waves is None or bed is None:
        return
    depth = -bed_at(bed, *scene.ship.hang_off_m[:2])
    if waves.depth_m is not None:
        if abs(waves.depth_m - depth) > ANOTHER * depth:
            problem = f"waves in water {waves.depth_m:g} m deep over a seabed at {depth:g} m"
            yield phrase("effects waves.depth_m", problem, f"give {depth:g} m")
        return
    if waves.regular is not None:
        period = waves.regular.period_s
    elif waves.jonswap is not None:
        period = waves.jonswap.peak_period_s
    else:
        return
    half = 0.5 * scene.environment.gravity_m_per_s2 * period**2 / (2.0 * pi)
    if depth < half:
        problem = f"waves of deep water, {2.0 * half:.0f} m long, feel a seabed at {depth:g} m"
        yield phrase("effects waves", problem, f"add depth_m: {depth:g}")


def _arm(scene: Scene) -> Iterator[str]:
    reference = reference_point_m(scene)
    if reference == scene.ship.hang_off_m:
        return
    arm = dist(reference, scene.ship.hang_off_m)
    if arm > LONGEST_ARM_M:
        problem = f"it is {arm:.0f} m from the hang-off"
        yield phrase("ship.reference_m", problem, f"plausible are at most {LONGEST_ARM_M:g} m")


def _never_whole(scene: Scene) -> Iterator[str]:
    """Check for factors on the forces of the water that do not end at 1."""
    ramp = scene.listed(FluidRampParams)
    for name, curve in {} if ramp is None else ramp.curves.items():
        time_s, factor = curve.last
        if factor != 1.0:
            problem = f"the forces stay at {factor:g} times their own from {time_s:g} s on"
            yield phrase(f"effects fluid_ramp.{name}", problem, "end the table with a factor of 1")


def _wet_in_the_air(scene: Scene) -> Iterator[str]:
    """Check for forces on a point payload that do not follow its submergence ratio."""
    listed = listed_effects(scene)
    if "splash_zone" not in listed:
        return
    for name in ("net", "fairing", "payload_shedding"):
        if name not in listed or (name == "payload_shedding" and body_payload(scene) is not None):
            continue
        problem = "it acts on a payload above the water as on one below, also with `splash_zone`"
        remedy = "list it only where the payload stays submerged"
        yield phrase(f"effects.{name}", problem, remedy)


def strong_current(where: str, points: Iterable[Point], factor: float = 1.0) -> str:
    """Return a warning for the fastest row of an implausibly strong current profile, or "".

    points: rows of z [m] and velocity east, north (, up) [m/s]; factor: on the velocity.
    """
    speed, z = max(((factor * hypot(*velocity), z) for z, velocity in points), default=(0.0, 0.0))
    if speed <= FASTEST_CURRENT_M_PER_S:
        return ""
    problem = (
        f"{speed:.3g} m/s at z = {z:g} m exceeds the range of ocean currents, "
        f"{FASTEST_CURRENT_M_PER_S:g} m/s"
    )
    return phrase(where, problem, f"check the unit: 1 knot is 0.514 m/s, {speed:.3g} kn would be "
                  f"{0.5144 * speed:.2g} m/s")  # fmt: skip


def check_current(scene: Scene, figures: LiftFigures) -> Iterator[str]:
    """Check speed, and a profile that does not extend from the hang-off to the rope's end."""
    current = scene.listed(CurrentParams)
    if current is None:
        return
    factor = max((abs(factor) for _, factor in current.over_time), default=1.0)
    part = "profile" if current.layers is None else "layers"
    if warning := strong_current(f"effects current.{part}", current.points, factor):
        yield warning
    yield from _through(scene, current, part, factor)
    if current.layers is not None:  # two layers are complete
        return
    length = scene.winch.max_line_out_m if scene.winch else scene.ropes[0].length_m
    top = scene.ship.hang_off_m[2]
    bottom = scene.ropes[0].fixed_at_m[2] if scene.ropes[0].fixed_at_m else top - length
    if moored_up(scene, figures):
        top, bottom = min(top + length, 0.0), top
    (first, first_velocity), (last, last_velocity) = current.points[0], current.points[-1]
    if first < min(top, 0.0) and hypot(*first_velocity) > 0.0:
        yield _constant_beyond(first, first_velocity, "above", f"{min(top, 0.0):g} m")
    if last > bottom and hypot(*last_velocity) > 0.0:
        yield _constant_beyond(last, last_velocity, "below", f"{bottom:g} m")


def _constant_beyond(z: float, velocity: Velocity, side: str, reach: str) -> str:
    named = zip(velocity, ("east", "north", "up"), strict=False)
    value = ", ".join(f"{part:g} {name}" for part, name in named)
    used = f"{side} its row at z = {z:g} m the value there ({value} m/s) is used"
    problem = f"{used}, as far as the rope's end at z = {reach}"
    return phrase("effects current.profile", problem, "add a row there")


def _through(scene: Scene, current: CurrentParams, part: str, factor: float) -> Iterator[str]:
    """Check for a vertical current through the surface, or through the seabed below the ship."""
    if not current.rises:
        return
    heights, upward = current.table[::-1, 0], factor * current.table[::-1, 3]
    sides = {"surface": 0.0}
    bed = scene.listed(SeabedParams)
    if bed is not None:
        sides["seabed"] = bed_at(bed, *scene.ship.hang_off_m[:2])
    for side, z in sides.items():
        speed = float(np.interp(z, heights, upward))
        if abs(speed) > THROUGH_M_PER_S:
            problem = f"{speed:g} m/s of vertical current pass through the {side} at z = {z:g} m"
            remedy = f"let it end there: a row at z = {z:g} m with 0 up"
            yield phrase(f"effects current.{part}", problem, remedy)


def check_depth_profiles(scene: Scene, figures: LiftFigures) -> Iterator[str]:
    """Check that profiles of several rows reach the rope's end, and that density does not fall."""
    params = scene.listed(DepthProfilesParams)
    if params is None:
        return
    length = scene.winch.max_line_out_m if scene.winch else scene.ropes[0].length_m
    fixed, top = scene.ropes[0].fixed_at_m, scene.ship.hang_off_m[2]
    bottom = fixed[2] if fixed else top - length
    for name in ("density_kg_per_m3", "drag_factor"):
        rows = getattr(params, name)
        if len(rows) > 1 and rows[-1][0] > bottom:
            z, value = rows[-1]
            used = f"below its row at z = {z:g} m the value there ({value:g}) is used"
            problem = f"{used}, as far as the rope's end at z = {bottom:g} m"
            yield phrase(f"effects depth_profiles.{name}", problem, "add a row there")
    for (above, light), (below, heavy) in pairwise(params.density_kg_per_m3):
        if heavy < light:
            problem = f"{heavy:g} kg/m³ at z = {below:g} m lies below {light:g} at z = {above:g} m"
            remedy = "check the rows: water at rest is denser below"
            yield phrase("effects depth_profiles.density_kg_per_m3", problem, remedy)


def is_air(scene: Scene) -> bool:
    """Return whether the whole scene is in air, whose density then replaces the water's."""
    longest = scene.winch.max_line_out_m if scene.winch else scene.ropes[0].length_m
    density = scene.environment.water_density_kg_per_m3
    return 1.0 <= density <= 1.4 and scene.ship.hang_off_m[2] > longest


def check_environment(scene: Scene, figures: LiftFigures) -> Iterator[str]:
    """Check the water's density and gravity."""
    water = scene.environment
    density, gravity = water.water_density_kg_per_m3, water.gravity_m_per_s2
    if not 990.0 <= density <= 1060.0 and not is_air(scene):
        problem = f"{density:g} kg/m³ is neither fresh water nor seawater"
        yield phrase("environment.water_density_kg_per_m3", problem, "seawater has 1025")
    if not 9.76 <= gravity <= 9.84:
        problem = f"{gravity:g} m/s² is not the Earth's"
        yield phrase("environment.gravity_m_per_s2", problem, "standard gravity is 9.80665")


def check_slamming(scene: Scene, _figures: LiftFigures) -> Iterator[str]:
    """Check the momentum that slamming gives the water against that of each payload's added mass.

    C_s = 2/(ρ·A)·dA33/dh at the submergence h (DNV-RP-N103, 4.3.8). The effect has one C_s over the
    height H, so the water gets ½·ρ·C_s·A·H·v where its added mass at full submergence takes A33·v.
    """
    common = scene.listed(SplashZoneParams)
    if common is None:
        return
    density, figures = scene.environment.water_density_kg_per_m3, point_figures(scene)
    body = body_payload(scene)
    for number, payload in enumerate(scene.payloads):
        if body is not None and payload.name != body:
            continue
        zone = payload.splash_zone or common
        added = figures[payload.name].added_mass_kg[2]
        moved = 0.5 * density * zone.slamming * zone.bottom_area_m2 * zone.height_m
        if moved == 0.0 or added == 0.0 or 1.0 / OTHER_MASS <= moved / added <= OTHER_MASS:
            continue
        key = f"payloads[{number}].splash_zone" if payload.splash_zone else "effects.splash_zone"
        problem = (
            f"slamming over the whole height moves {moved / 1e3:.3g} t of water, "
            f"{moved / added:.2g} times the vertical added mass of '{payload.name}', "
            f"{added / 1e3:.3g} t"
        )
        side = "a larger C_s is for the peak force alone" if moved > added else "loads are too low"
        remedy = (
            f"C_s = 2·A33/(ρ·A·H) is {zone.slamming * added / moved:.2g}; {side} "
            f"(DNV-RP-N103, 4.3.8)"
        )
        yield phrase(f"{key}.slamming", problem, remedy)


ON, OFF = "compensate", "stop_compensating"
LONGEST_STEP = 0.5  # of the travel time of an axial wave (see twin/winch/commands.py)


def check_winch(scene: Scene, figures: LiftFigures) -> Iterator[str]:
    """Check the first rope's winch."""
    yield from _holding(scene, figures)
    yield from _feedback(scene, figures)
    yield from _compensates_from_the_start(scene)


def _holding(scene: Scene, figures: LiftFigures) -> Iterator[str]:
    winch, line = scene.winch, scene.ropes[0]
    if winch is None or winch.drum is None or figures.payload is None:
        return
    diameter = line.made_of[-1].rope.diameter_m
    layer = winch.drum.layer_of(winch.max_line_out_m - line.length_m, diameter)
    radius, load = winch.drum.radius_m(layer, diameter), figures.top_tension_n(line.length_m)
    torques = {
        "drive": winch.drive.torque_limit_n_m if winch.drive else None,
        "brake": winch.brake.holding_torque_n_m if winch.brake else None,
    }
    for part, torque in torques.items():
        if torque is not None and torque < load * radius:
            problem = (
                f"it holds {kilonewtons(torque / radius)} on layer {layer}, static tension is "
                f"{kilonewtons(load)}"
            )
            remedy = f"give more than {load * radius * 1e-3:.0f} kN·m, or expect it to render"
            yield phrase(f"winch.{part}", problem, remedy)


def _feedback(scene: Scene, figures: LiftFigures) -> Iterator[str]:
    winch = scene.winch
    feeling = ("drive", "passive_compensation", "constant_tension")
    part = next((name for name in feeling if getattr(winch, name, None) is not None), None)
    if winch is None or part is None:
        return
    travel = winch.min_line_out_m / figures.axial_wave_speed_m_per_s
    if scene.time.step_s > LONGEST_STEP * travel:
        problem = (
            f"a step of {scene.time.step_s:g} s delays the tension feedback too much on "
            f"{winch.min_line_out_m:g} m of rope, with a wave travel time of {travel:.3f} s"
        )
        remedy = f"give at most {LONGEST_STEP * travel:.2g} s, or a longer min_line_out_m"
        yield phrase(f"winch.{part}", problem, remedy)


def check_compensator(scene: Scene, figures: LiftFigures) -> Iterator[str]:
    """Check that the gas carries the static load between the stops of a heave compensator."""
    unit = scene.listed(CompensatorParams)
    if unit is None:
        return
    bar, line = figures.bars[0], scene.ropes[0]
    depth = max(line.length_m - scene.ship.hang_off_m[2], 0.0)
    water = scene.environment.water_density_kg_per_m3 * scene.environment.gravity_m_per_s2
    load = 0.5 * (bar.low_n + bar.high_n) - (unit.rod_area_m2 or 0.0) * water * depth
    smallest_n, largest_n = unit.tension_n(0.0), unit.tension_n(unit.stroke_m)
    if smallest_n < load < largest_n:
        return
    side, force = ("retracted", smallest_n) if load <= smallest_n else ("extended", largest_n)
    problem = (
        f"{kilonewtons(load)} of static load leave it {side}, where the gas holds "
        f"{kilonewtons(force)}"
    )
    remedy = f"give {max(load, 0.0) / unit.piston_area_m2:.3g} Pa for mid stroke"
    yield phrase("effects.compensator.gas_pressure_pa", problem, remedy)


def _compensates_from_the_start(scene: Scene) -> Iterator[str]:
    """Check for heave compensation that is switched on later but is on from the start."""
    winch = scene.winch
    if winch is None or winch.heave_compensation is None:
        return
    switches = [row for row in winch.schedule if row.switch in (ON, OFF)]
    if switches and switches[0].switch == ON and switches[0].at_s > 0.0:
        problem = f"it is on from the start, and switched on at {switches[0].at_s:g} s"
        remedy = f"begin with {{at_s: 0.0, switch: {OFF}}} if it is to wait until then"
        yield phrase("winch.heave_compensation", problem, remedy)
