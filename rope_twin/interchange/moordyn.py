"""Scenes to MoorDyn 2 decks and back.

Both describe lines between points, in SI units and ENU axes, with coefficients on the diameter of
the displaced volume. A deck has no winch, ship or waves of its own: its coupled points are moved by
the program that calls MoorDyn. Whatever has no equal on the other side is listed.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rope_twin.effects.bending import BendingParams
from rope_twin.effects.current import CurrentParams
from rope_twin.effects.drag import DragParams
from rope_twin.effects.payload import PayloadParams
from rope_twin.effects.rope_mass import AddedMassParams, WeightParams
from rope_twin.effects.seabed import SeabedParams
from rope_twin.effects.waves import WavesParams
from rope_twin.errors import InputError
from rope_twin.interchange import STEP_S, BreakingLoads, Imported, Keys
from rope_twin.interchange.moordyn_deck import COUPLED, FIXED, FREE, Deck, Line, LineType, Point
from rope_twin.scene.environment import MIN_ROW_SPACING_M, SHEAR_LIMIT_PER_S
from rope_twin.scene.grid import find_payload, section_damping
from rope_twin.scene.lift import alone, listed_effects, point_figures
from rope_twin.scene.rigging import is_joined, places, winches_by_name
from rope_twin.scene.schema import WINCH, RopeLine, Scene
from rope_twin.scene.shapes import NOTHING, PayloadFigures, payload_figures
from rope_twin.twin.twin import Twin

ABOVE_M = 50.0  # the current goes on so far above the water, where a hang-off may be
BELOW = 1.2  # water depth over the deepest that a winch lowers, of a scene without seabed
STABLE = 0.3  # step over the largest of an explicit scheme, for accuracy
RELAXATION_S = 30.0  # for the initial shape of the lines
SAME = 1e-9  # relative: coefficients that count as one
_SAID = (AddedMassParams, BendingParams, CurrentParams, DragParams, PayloadParams, SeabedParams,
         WeightParams)  # fmt: skip
_READ = {"g": "g", "gravity": "g", "wtrdnsty": "rho", "rho": "rho", "wtrdpth": "depth",
         "depth": "depth", "waterdepth": "depth", "kbot": "kb", "kb": "kb",
         "frictioncoefficient": "mu", "currents": "currents"}  # fmt: skip
_NUMERICS = frozenset(
    ("dtm", "dt", "tmaxic", "tscheme", "cfl", "dtic", "icdt", "icdfac", "icthresh", "thresh_ic",
     "cdscaleic", "threshic", "writelog", "disableoutput", "disableouttime", "dtout", "writeunits")
)  # fmt: skip


def deck_of(scene: Scene) -> tuple[Deck, tuple[str, ...]]:
    """Return the deck of a scene and what it leaves out, a sentence each.

    Points are where the twin's static equilibrium has them.

    Raises:
        InputError: a part of the scene that lines end at or run over has no equal.
        SceneError: there is no static equilibrium.
    """
    where = f"scene {scene.name}"
    for name, parts in (("sheaves", scene.sheaves), ("struts", scene.struts)):
        if parts:
            problem = f"its {name} have no equal in a MoorDyn deck"
            raise InputError(where, problem, "export a scene without them")
    effects = listed_effects(scene)
    if "rigid_body" in effects:
        problem = "its rigid body has no equal among a deck's lines"
        raise InputError(where, problem, "give the payload as a point")
    left_out = [*_left_out(scene, effects)]
    writer = _Writer(scene, left_out)
    writer.write()
    depth = writer.depth_m()
    bed, current = scene.listed(SeabedParams), scene.listed(CurrentParams)
    water = scene.environment
    profile = [] if current is None else _profile(current, depth)
    options = [
        (repr(water.gravity_m_per_s2), "g"), (repr(water.water_density_kg_per_m3), "WtrDnsty"),
        (repr(depth), "WtrDpth"), (f"{writer.step_s():.4g}", "dtM"), ("RK2", "tScheme"),
        (repr(RELAXATION_S), "TmaxIC"), ("1" if profile else "0", "Currents"),
    ]  # fmt: skip
    if bed is not None:
        options += [(repr(bed.stiffness_n_per_m3), "kBot"),
                    (repr(bed.friction), "FrictionCoefficient")]  # fmt: skip
        left_out.append(f"seabed: its damping χ of {bed.damping_s_per_m:g} s/m")
    lists: list[list[Any]] = [writer.types, writer.points, writer.lines, options, profile]
    return Deck(f"{scene.name}, from rope_twin", *map(tuple, lists)), tuple(left_out)


def _left_out(scene: Scene, effects: dict[str, Any]) -> Iterator[str]:
    """Yield what a deck cannot have."""
    for name, params in effects.items():
        if not isinstance(params, _SAID):
            yield f"effect {name}: it is not exported"
    if scene.listed(WeightParams) is None:
        yield "no effect weight: MoorDyn has gravity and buoyancy in any case"
    if scene.winch is not None or any(hang_off.winch for hang_off in scene.hang_offs):
        yield "winches: lines have constant lengths"
    if scene.sea_state.moves:
        yield "motion of the ship: the program that calls MoorDyn moves the coupled points"
    drag = scene.listed(DragParams)
    if drag is not None and (drag.over_reynolds or drag.over_keulegan_carpenter):
        yield "drag: its dependence on Reynolds or Keulegan-Carpenter number"
    if drag is not None and not drag.relative:
        yield "drag: `relative: false`, MoorDyn has the velocity relative to the water"
    bending = scene.listed(BendingParams)
    if bending is not None and bending.clamped_along is not None:
        yield "bending: the fixed direction at the hang-off, ends are hinged"
    bed = scene.listed(SeabedParams)
    if bed is not None and (bed.soundings is not None or bed.slope != (0.0, 0.0)):
        yield "seabed: its slope or soundings, it is level at the depth of the origin"
    current = scene.listed(CurrentParams)
    if current is not None and current.over_time:
        yield "current: its factor over time"


def _profile(current: CurrentParams, depth_m: float) -> list[tuple[float, float, float, float]]:
    """Return rows from the bottom up that cover the water and the air above."""
    rows = [(z, x, y, vertical) for z, x, y, vertical in current.table[::-1].tolist()]
    if rows[0][0] > -depth_m:
        rows.insert(0, (-depth_m, *rows[0][1:]))
    return [*rows, (ABOVE_M, *rows[-1][1:])]


class _Writer:
    """Points, line types and lines of a scene."""

    def __init__(self, scene: Scene, left_out: list[str]) -> None:
        self._scene, self._left_out = scene, left_out
        self._at_rest = Twin(scene).snapshot()
        self.types, self.points, self.lines = list[LineType](), list[Point](), list[Line]()
        self._numbers: dict[str, int] = {}
        self._density = scene.environment.water_density_kg_per_m3
        self._figures = point_figures(scene)

    def write(self) -> None:
        """Fill the lists."""
        for name, position in places(self._scene).items():
            if any(line.from_ == name for line in self._scene.ropes):
                self._add_point(COUPLED, position, name)
        for number, line in enumerate(self._scene.ropes):
            ropes = self._at_rest.ropes
            nodes = ropes[number].node_position_m if ropes else self._at_rest.node_position_m
            if line.fixed_at_m is not None:
                below = self._add_point(FIXED, line.fixed_at_m)
            else:
                below = self._numbers.get(line.to) or self._add_free(line.to, nodes[-1])
            upper = self._numbers.get(line.from_) or self._add_free(line.from_, nodes[0])
            self._write_line(number, nodes, below, upper)

    def depth_m(self) -> float:
        """Return the water depth."""
        bed = self._scene.listed(SeabedParams)
        if bed is not None and bed.depth_m is not None:
            return bed.depth_m
        if bed is not None and bed.soundings is not None:
            return max(max(row) for row in bed.soundings.depth_m)
        waves = self._scene.listed(WavesParams)
        lowest_m = -min(point.at_m[2] for point in self.points)
        if waves is not None and waves.depth_m is not None and waves.depth_m > lowest_m:
            return waves.depth_m
        hang_offs, winches = places(self._scene), winches_by_name(self._scene)
        reach_m = [winch.max_line_out_m - hang_offs[name][2] for name, winch in winches.items()]
        return BELOW * max(1.0, lowest_m, *reach_m)

    def step_s(self) -> float:
        """Return a stable step: 2/ω of the stiffest element, less by its damping."""
        kinds = {kind.name: kind for kind in self.types}
        steps = []
        for line in self.lines:
            kind, segment = kinds[line.type_name], line.length_m / line.segments
            omega = 2.0 * math.sqrt(kind.EA_n / kind.mass_kg_per_m) / segment
            c = kind.damping
            ratio = -c if c < 0.0 else c * omega / (2.0 * kind.EA_n)
            steps.append(STABLE * 2.0 / omega * (math.sqrt(ratio**2 + 1.0) - ratio))
        return min(steps)

    def _add_point(
        self, kind: str, position: Any, name: str = "", figures: PayloadFigures = NOTHING
    ) -> int:
        number = len(self.points) + 1
        displaced = self._density * figures.volume_m3
        x, y, z = (float(coordinate) for coordinate in position)
        Ca = figures.added_mass_kg[2] / displaced if displaced else 0.0
        body = figures.mass_kg, figures.volume_m3, figures.drag_area_m2[2], Ca
        self.points.append(Point(number, kind, (x, y, z), *body))
        if name:
            self._numbers[name] = number
        return number

    def _add_free(self, name: str, position: Any) -> int:
        figures = self._figures.get(name, NOTHING)
        triples = {"drag area": figures.drag_area_m2, "added mass": figures.added_mass_kg}
        for quantity, values in triples.items():
            if len(set(values)) > 1:
                remark = f"{name}: its {quantity} along x and y, that along z is used for all"
                self._left_out.append(remark)
        if figures.differs_rising:
            self._left_out.append(f"{name}: its coefficients in ascent")
        if figures.added_mass_kg[2] and not figures.volume_m3:
            self._left_out.append(f"{name}: its added mass, as it displaces no water")
        return self._add_point(FREE, position, name, figures)

    def _write_line(self, number: int, nodes: Any, below: int, upper: int) -> None:
        """Add a line for each section, from the lower end up, joined by points without mass."""
        line = self._scene.ropes[number]
        lengths = line.lengths_m(line.length_m)
        if line.grading is not None:
            remark = f"rope {line.name}: its graded mesh, segments of a section are equal"
            self._left_out.append(remark)
        if line.bending is not None and line.bending.clamped_along is not None:
            self._left_out.append(f"rope {line.name}: the fixed direction at its upper end")
        damping = self._damping(number, line)
        end, done = below, 0.0
        for k, (section, length) in enumerate(zip(line.made_of, lengths, strict=True)):
            if length <= 0.0:
                continue
            done += length
            last = done >= line.length_m * (1.0 - SAME)
            top = upper if last else self._add_junction(line, nodes, line.length_m - done)
            name = self._type_of(line, section.rope, damping[k], k)
            count = max(1, round(line.elements * length / line.length_m))
            self.lines.append(Line(len(self.lines) + 1, name, end, top, length, count))
            end = top

    def _add_junction(self, line: RopeLine, nodes: Any, at_m: float) -> int:
        """Add a point at an unstretched length from the upper end."""
        equal = np.linspace(0.0, line.length_m, len(nodes))
        arc = equal if self._at_rest.ropes else self._at_rest.arc_length_m
        return self._add_point(FREE, [np.interp(at_m, arc, nodes[:, k]) for k in range(3)])

    def _damping(self, number: int, line: RopeLine) -> list[float]:
        """Return c of each section [N·s], or minus the fraction of an element's critical."""
        fraction = line.damping.fraction_of_one_element
        if fraction is not None:
            return [-fraction] * len(line.made_of)
        scene = alone(self._scene, number) if is_joined(self._scene) else self._scene
        payload, rho = find_payload(scene, scene.ropes[0]), self._density
        figures = None if payload is None else payload_figures(payload, rho)
        return section_damping(scene, scene.ropes[0], figures)

    def _type_of(self, line: RopeLine, rope: Any, damping: float, section: int) -> str:
        """Return the name of a line type, which is added if it is new."""
        scene, d = self._scene, rope.hydrodynamic_diameter_m
        drag, added = scene.listed(DragParams), scene.listed(AddedMassParams)
        bending = line.bending or scene.listed(BendingParams)
        Cd, CdAx = (0.0, 0.0) if drag is None else (drag.normal, drag.tangential)
        if drag is not None and rope.drag_normal is not None:
            Cd = rope.drag_normal * rope.diameter_m / d
        if drag is not None and rope.drag_tangential is not None:
            CdAx = rope.drag_tangential * rope.diameter_m / d
        if rope.axial_stiffness is not None:
            remark = f"rope {line.name}: its stiffness table, EA is that at the static top tension"
            self._left_out.append(remark)
        kind = LineType(
            f"{line.name}_{section + 1}" if len(line.made_of) > 1 else line.name, d,
            rope.mass_kg_per_m, rope.tangent_n(max(self._at_rest.tension_top_n, 1.0)), damping,
            0.0 if bending is None else bending.stiffness_n_m2, Cd,
            0.0 if added is None else added.normal, CdAx,
            0.0 if added is None else added.tangential,
        )  # fmt: skip
        self.types.append(kind)
        return kind.name


def scene_of(deck: Deck, where: Path, breaking_load_n: float | Mapping[str, float]) -> Imported:
    """Return the scene of a deck.

    breaking_load_n: MBL of its lines, as BreakingLoads takes it. Coupled points become hang-offs,
    the first the ship's own; free points with mass or volume payloads, others joints; a free point
    without mass between two lines joins sections of one rope.

    Raises:
        InputError: no line can be taken over, or the breaking load of a type is not known.
    """
    return _Reader(deck, where, breaking_load_n).imported()


class _Reader:
    """A deck as keys of a scene."""

    def __init__(
        self, deck: Deck, where: Path, breaking_load_n: float | Mapping[str, float]
    ) -> None:
        self._deck, self._where, self._loads = deck, where, BreakingLoads(breaking_load_n)
        self._loads.check(line_type.name for line_type in deck.types)
        self._left_out = list(deck.unread)
        self._types = {line_type.name: line_type for line_type in deck.types}
        self._points = {point.number: point for point in deck.points}
        self._options: dict[str, float] = {}
        self._read_options()
        self._hang_offs = self._find_hang_offs()
        self._usual = self._types[deck.lines[0].type_name]

    def imported(self) -> Imported:
        """Return the scene's keys and what is left out."""
        first = next(iter(self._hang_offs), None)
        chains = sorted(self._chains(), key=lambda chain: chain[0] != first)
        if not chains or not self._hang_offs:
            problem = "no line of it leads down from a coupled or fixed point"
            raise InputError(str(self._where), problem, "give a deck with one")
        scene: Keys = {
            "about": self._deck.title or self._where.stem,
            "source": f"MoorDyn deck {self._where.name}",
            "ropes": [self._rope(*chain) for chain in chains],
        }
        scene |= self._connections(scene["ropes"])
        scene["environment"] = {
            "water_density_kg_per_m3": self._options.get("rho", 1025.0),
            "gravity_m_per_s2": self._options.get("g", 9.8),
        }
        scene["effects"] = self._effects(bool({"payloads", "joints"} & set(scene)))
        scene["time"] = {"step_s": STEP_S}
        self._left_out += self._loads.remarks()
        self._left_out.append(f"time step: the scene has an implicit one of {STEP_S:g} s")
        return Imported(scene, tuple(dict.fromkeys(self._left_out)))

    def _read_options(self) -> None:
        for value, name in self._deck.options:
            key = _READ.get(name.lower())
            try:
                number = float(value)
            except ValueError:
                number = math.nan
            if key is not None and math.isfinite(number):
                self._options[key] = number
            elif name.lower() in _NUMERICS:
                self._left_out.append(f"option {name} {value}: numerics and output of MoorDyn")
            elif value not in ("0", "0.0"):
                self._left_out.append(f"option {name} {value}")

    def _find_hang_offs(self) -> dict[int, str]:
        """Return names of the points where ropes leave the ship."""
        coupled = [point.number for point in self._deck.points if point.kind == COUPLED]
        if not coupled:
            fixed = [point for point in self._deck.points if point.kind == FIXED]
            if not fixed:
                return {}
            top = max(fixed, key=lambda point: point.at_m[2]).number
            self._left_out.append(f"point {top}: fixed, it is the hang-off of a ship at rest")
            coupled = [top]
        return {n: WINCH if k == 0 else f"point_{n}" for k, n in enumerate(coupled)}

    def _upper_and_lower(self, line: Line) -> tuple[int, int] | None:
        """Return the ends of a line from its upper one; None if it has no equal."""
        ends = [self._points[line.end_a], self._points[line.end_b]]
        on_ship = [end for end in ends if end.number in self._hang_offs]
        fixed = [end for end in ends if end.kind == FIXED and end not in on_ship]
        if len(on_ship) == 2 or len(fixed) == 2:
            remark = f"line {line.number}: both its ends are held, and none is a free point"
            self._left_out.append(remark)
            return None
        if on_ship:
            upper = on_ship[0]
        elif fixed:
            upper = next(end for end in ends if end not in fixed)
        else:
            upper = max(ends, key=lambda end: end.at_m[2])
        lower = ends[0] if upper is ends[1] else ends[1]
        return upper.number, lower.number

    def _chains(self) -> Iterator[tuple[int, int, list[Line]]]:
        """Yield upper point, lower point and lines from the top down of each rope."""
        spans = [(*span, line) for line in self._deck.lines
                 if (span := self._upper_and_lower(line)) is not None]  # fmt: skip
        begins = Counter(upper for upper, _, _ in spans)
        ends = Counter(lower for _, lower, _ in spans)
        inner = {  # points that only join a line that ends there with one that begins there
            n for n, point in self._points.items()
            if point.kind == FREE and begins[n] == ends[n] == 1 and not self._has_body(point)
        }  # fmt: skip
        below = {upper: (lower, line) for upper, lower, line in spans if upper in inner}
        for upper, lower, line in spans:
            if upper in inner:
                continue
            lines = [line]
            while lower in inner:
                lower, further = below[lower]
                lines.append(further)
            yield upper, lower, lines

    @staticmethod
    def _has_body(point: Point) -> bool:
        return point.mass_kg > 0.0 or point.volume_m3 > 0.0 or point.CdA_m2 > 0.0

    def _name(self, number: int) -> str:
        return self._hang_offs.get(number, f"point_{number}")

    def _rope(self, upper: int, lower: int, lines: list[Line]) -> Keys:
        """Return the keys of a rope."""
        types = [self._types[line.type_name] for line in lines]
        for line_type in types:
            self._check_type(line_type)
        keys: Keys = {"name": f"line_{lines[0].number}"}
        if len(lines) == 1:
            keys["rope"] = self._material(types[0])
        else:
            parts = zip(reversed(lines), reversed(types), strict=True)
            keys["sections"] = [
                {"rope": self._material(line_type), "length_m": line.length_m}
                for line, line_type in parts
            ]
            del keys["sections"][-1]["length_m"]
        damping = types[0].damping
        for line, line_type in zip(lines[1:], types[1:], strict=True):
            if line_type.damping != damping:
                remark = f"line {line.number}: its damping {line_type.damping:g}, that of line "
                self._left_out.append(f"{remark}{lines[0].number} ({damping:g}) is the rope's")
        name = "newton_seconds" if damping >= 0.0 else "fraction_of_one_element"
        keys |= {
            "length_m": sum(line.length_m for line in lines),
            "elements": max(3, sum(line.segments for line in lines)),
            "damping": {name: abs(damping)},
            "from": self._name(upper),
        }
        point = self._points[lower]
        if point.kind == FIXED:
            return keys | {"fixed_at_m": list(point.at_m)}
        return keys | {"to": self._name(lower)}

    def _check_type(self, line_type: LineType) -> None:
        """List what a rope cannot have for itself."""
        usual, where = self._usual, f"line type {line_type.name}"
        for name in ("Ca", "CaAx"):
            value, used = getattr(line_type, name), getattr(usual, name)
            if not math.isclose(value, used, rel_tol=SAME):
                remark = f"{where}: {name} {value:g}, that of {usual.name} ({used:g}) is used"
                self._left_out.append(remark)
        if not math.isclose(line_type.EI_n_m2, usual.EI_n_m2, rel_tol=SAME):
            remark = f"{where}: EI {line_type.EI_n_m2:g} N·m², that of {usual.name} is used"
            self._left_out.append(remark)

    def _material(self, line_type: LineType) -> Keys:
        keys: Keys = {
            "diameter_m": line_type.diameter_m, "mass_kg_per_m": line_type.mass_kg_per_m,
            "hydrodynamic_diameter_m": line_type.diameter_m, "axial_stiffness_n": line_type.EA_n,
            "breaking_load_n": self._loads.of(line_type.name, line_type.EA_n),
        }  # fmt: skip
        if not math.isclose(line_type.Cd, self._usual.Cd, rel_tol=SAME):
            keys["drag_normal"] = line_type.Cd
        if not math.isclose(line_type.CdAx, self._usual.CdAx, rel_tol=SAME):
            keys["drag_tangential"] = line_type.CdAx
        return keys

    def _connections(self, ropes: list[Keys]) -> Keys:
        """Return payloads, joints, ship and hang-offs."""
        used = {end for rope in ropes for end in (rope["from"], rope.get("to")) if end}
        payloads, joints, rho = list[Keys](), list[Keys](), self._options.get("rho", 1025.0)
        for number, point in self._points.items():
            name = self._name(number)
            if name not in used or number in self._hang_offs:
                if self._has_body(point) and number not in self._hang_offs:
                    self._left_out.append(f"point {number}: no line ends at it")
                continue
            if not self._has_body(point):
                joints.append({"name": name})
                continue
            payloads.append({
                "name": name, "mass_kg": point.mass_kg, "displaced_volume_m3": point.volume_m3,
                "added_mass_kg": [point.Ca * rho * point.volume_m3] * 3,
                "drag_area_m2": [point.CdA_m2] * 3,
            })  # fmt: skip
        ship, *further_points = self._hang_offs
        keys: Keys = {"payloads": payloads} if payloads else {}
        keys |= {"joints": joints} if joints else {}
        keys["ship"] = {"hang_off_m": list(self._points[ship].at_m)}
        further = [
            {"name": self._name(n), "at_m": list(self._points[n].at_m)}
            for n in further_points
            if self._name(n) in used
        ]
        return keys | ({"hang_offs": further} if further else {})

    def _effects(self, has_payload: bool) -> list[Keys]:
        usual, effects = self._usual, list[Keys]()
        if self._deck.current:
            effects.append({"current": {"profile": list(self._current_rows())}})
        effects.append({"weight": {}})
        if usual.Cd or usual.CdAx:
            effects.append({"drag": {"normal": usual.Cd, "tangential": usual.CdAx}})
        if usual.Ca or usual.CaAx:
            effects.append({"added_mass": {"normal": usual.Ca, "tangential": usual.CaAx}})
        if usual.EI_n_m2:
            effects.append({"bending": {"stiffness_n_m2": usual.EI_n_m2}})
        if "depth" in self._options:
            bed: Keys = {"depth_m": self._options["depth"]}
            bed |= {"stiffness_n_per_m3": self._options["kb"]} if "kb" in self._options else {}
            bed |= {"friction": self._options.get("mu", 0.0)}
            effects.append({"seabed": bed})
        return [*effects, {"payload": {}}] if has_payload else effects

    def _current_rows(self) -> Iterator[list[Any]]:
        """Yield rows from the surface down; the rows above it give the one at it.

        A step from one layer to the next becomes as thin a shear as a scene may have: its lower
        row is moved down.
        """
        rows = np.array(self._deck.current)
        below = list(rows[rows[:, 0] <= 0.0][::-1])
        if not below or (below[0][0] < 0.0 and rows[-1, 0] > 0.0):
            at_surface = [np.interp(0.0, rows[:, 0], rows[:, k]) for k in (1, 2, 3)]
            below.insert(0, np.array([0.0, *at_surface]))
        rises = bool(rows[:, 3].any())
        before, moved = None, False
        for z, *velocity in below:
            if before is not None:
                change = float(np.linalg.norm(np.subtract(velocity, before[1])))
                thinnest_m = max(MIN_ROW_SPACING_M, change / SHEAR_LIMIT_PER_S) * (1.0 + 1e-6)
                moved |= before[0] - z < thinnest_m
                z = min(z, before[0] - thinnest_m)
            before = (z, velocity)
            yield [float(z), [float(component) for component in velocity[: 3 if rises else 2]]]
        if moved:
            self._left_out.append("current: its steps, which are shear over some centimetres")
