"""Scenes from OrcaFlex text data files (YAML): lines, buoys, vessel with RAOs, environment.

Units are OrcaFlex's SI: te, kN, m. Directions are those of propagation, from x towards y, as here.
A table of OrcaFlex has the names of its columns, in any order, as key. Axial drag refers to π times
the axial drag diameter in both programs. What has no equal is listed by object and key.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from rope_twin.errors import InputError, counted
from rope_twin.interchange import STEP_S, BreakingLoads, Imported, Keys
from rope_twin.scene.schema import WINCH
from rope_twin.sea.orcaflex_raos import load_model
from rope_twin.sea.rao_files import read_responses
from rope_twin.sea.raos import RaoConventions

TE, KN = 1e3, 1e3  # kg, N
DAMPING = 0.015  # of critical, first axial mode: OrcaFlex has none unless a model adds it
COMPONENTS, SEED = 200, 1
G_M_PER_S2 = 9.80665
_FIXED, _ANCHORED, _FREE = "Fixed", "Anchored", "Free"
_READ = ("General", "Environment", "LineTypes", "Lines", "VesselTypes", "Vessels", "3DBuoys",
         "6DBuoys")  # fmt: skip
_CA = (1.0, 1.0, 0.0)  # OrcaFlex's own: along x, y and the axis
_DRAG = ("drag_normal", "drag_tangential")
_AIRY = ("airy", "single airy")
_NONLINEAR = ("dean stream", "stokes' 5th", "cnoidal")


def scene_of_model(
    path: Path, breaking_load_n: float | Mapping[str, float], folder: Path
) -> Imported:
    """Return the scene of a model.

    breaking_load_n: MBL of line types without AllowableTension, as BreakingLoads takes it.
    folder: that of the scene, relative to which it names the model for its RAOs.

    Raises:
        InputError: the file is no such model, has other units, or no line hangs from the vessel.
    """
    return _Model(path, breaking_load_n, folder).imported()


class _Object:
    """One object of the model, which remembers the keys that were read."""

    def __init__(self, keys: Mapping[str, Any], where: str) -> None:
        self._keys, self.where, self._known = keys, where, {"Name"}

    @property
    def name(self) -> str:
        """Return its name."""
        return str(self._keys.get("Name", ""))

    def get(self, key: str, default: Any = None) -> Any:
        """Return a value, default where it is missing or `~`."""
        self._known.add(key)
        value = self._keys.get(key)
        return default if value is None else value

    def number(self, key: str, default: float | None = None) -> float:
        """Return a number. Raises InputError: there is none."""
        return _number(self.get(key, default), f"{self.where}, {key}")

    def numbers(self, key: str, default: Sequence[float]) -> list[float]:
        """Return at least as many numbers as `default`; those given as ~ repeat the first."""
        value, where = self.get(key, list(default)), f"{self.where}, {key}"
        listed = value if isinstance(value, list) else [value]
        if len(listed) < len(default):
            remedy = f"give {len(default)}; ~ repeats the first"
            raise InputError(where, f"it has {counted(len(listed), 'number')}", remedy)
        return [_number(listed[0] if entry is None else entry, where) for entry in listed]

    def rows(self, *names: str) -> list[dict[str, Any]]:
        """Return the table that has these columns, a mapping for each row."""
        for key, rows in self._keys.items():
            columns = [part.strip() for part in str(key).split(",")]
            if set(names) <= set(columns) and isinstance(rows, list):
                self._known.add(str(key))
                listed = [row if isinstance(row, list) else [row] for row in rows]
                return [dict(zip(columns, row, strict=False)) for row in listed]
        return []

    def unread(self) -> Iterator[str]:
        """Yield one sentence with the keys that were not read, if there are any."""
        keys = [str(key) for key in self._keys if str(key) not in self._known]
        if keys:
            yield f"{self.where}: {', '.join(keys)}"


class _Model:
    """A model as keys of a scene."""

    def __init__(
        self, path: Path, breaking_load_n: float | Mapping[str, float], folder: Path
    ) -> None:
        self._path, self._loads, self._folder = path, BreakingLoads(breaking_load_n), folder
        self._model = load_model(path)
        self._left_out = list[str]()
        self._environment = self._object("Environment")
        self._general = self._object("General")
        self._check_units()
        self._types = {entry.name: entry for entry in self._objects("LineTypes")}
        self._loads.check(self._types)
        self._vessels = {entry.name: entry for entry in self._objects("Vessels")}
        self._buoys = {
            entry.name: entry for key in ("3DBuoys", "6DBuoys") for entry in self._objects(key)
        }
        self._lines = self._objects("Lines")
        deep = (self._environment.get(key) for key in ("WaterDepth", "SeabedOriginDepth"))
        depth = next((value for value in deep if value is not None), None)
        self._depth_m = math.nan if depth is None else _number(depth, "Environment, WaterDepth")
        self._density = TE * self._environment.number("Density", 1.025)
        self._hang_offs = dict[str, list[float]]()
        self._tip: tuple[_Object, list[float]] | None = None  # vessel and point of the first line
        self._ends = list[Keys]()  # payloads at free ends
        self._frictions = list[float]()
        self._used = list[_Object]()  # line types

    def imported(self) -> Imported:
        """Return the scene's keys and what is left out."""
        ropes = [rope for line in self._lines for rope in self._rope(line)]
        if not self._hang_offs:
            problem = "none of its Lines hangs from a vessel or a fixed point"
            raise InputError(str(self._path), problem, "give a model with such a line")
        ropes.sort(key=lambda rope: rope["from"] != WINCH)
        used = {rope.get("to") for rope in ropes} | {rope["from"] for rope in ropes}
        payloads = [self._payload(buoy) for name, buoy in self._buoys.items() if name in used]
        scene: Keys = {"about": self._path.stem, "source": f"OrcaFlex model {self._path.name}"}
        scene["ropes"] = ropes
        if payloads or self._ends:
            scene["payloads"] = [*payloads, *self._ends]
        ship, *further = self._hang_offs
        scene["ship"] = {"hang_off_m": self._hang_offs[ship]}
        if further:
            scene["hang_offs"] = [{"name": n, "at_m": self._hang_offs[n]} for n in further]
        waves = list(self._waves())
        riding = self._riding(bool(waves))
        scene |= {"sea_state": {"on_waves": riding}} if riding else {}
        scene["environment"] = {
            "water_density_kg_per_m3": self._density,
            "gravity_m_per_s2": self._general.number("g", G_M_PER_S2),
        }
        scene["effects"] = self._effects(waves, ropes, "payloads" in scene)
        scene["time"] = {"step_s": STEP_S}
        self._list_rest(used)
        self._left_out += self._loads.remarks()
        return Imported(scene, tuple(dict.fromkeys(self._left_out)))

    # the model's objects

    def _object(self, key: str) -> _Object:
        keys = self._model.get(key) or {}
        if not isinstance(keys, Mapping):
            raise self._malformed(f"{key} is not an object")
        return _Object(keys, key)

    def _objects(self, key: str) -> list[_Object]:
        listed = self._listed(key, self._model.get(key) or [])
        return [_Object(entry, f"{key} {entry.get('Name', '')}") for entry in listed]

    def _listed(self, name: str, listed: Any) -> list[Mapping[str, Any]]:
        if not isinstance(listed, list) or not all(isinstance(entry, Mapping) for entry in listed):
            raise self._malformed(f"{name} is not a list of objects")
        return listed

    def _malformed(self, problem: str) -> InputError:
        return InputError(str(self._path), problem, "give a model as OrcaFlex saves it")

    def _check_units(self) -> None:
        system = self._general.get("UnitsSystem")
        if system != "SI":
            problem = f"its UnitsSystem is {'not stated' if system is None else system}"
            remedy = "save it in SI (te, kN, m), with `General: {UnitsSystem: SI}`"
            raise InputError(str(self._path), problem, remedy)
        if self._environment.number("WaterSurfaceZ", 0.0) != 0.0:
            problem = "its water surface is not at z = 0"
            raise InputError(str(self._path), problem, "give a model with WaterSurfaceZ 0")

    # lines

    def _rope(self, line: _Object) -> Iterator[Keys]:
        """Yield the rope of a line, or nothing if it has no equal."""
        ends = line.rows("Connection", "ConnectionX", "ConnectionY", "ConnectionZ")
        if len(ends) != 2:
            ends = [
                {"Connection": line.get(f"End{e}Connection"),
                 **{f"Connection{axis}": line.get(f"End{e}{axis}", 0.0) for axis in "XYZ"}}
                for e in "AB"
            ]  # fmt: skip
        places = [self._place(line, end) for end in ends]
        heights_m = [self._height_m(*place) for place in places]
        if min(heights_m) == math.inf:
            self._left_out.append(f"{line.where}: both its ends are at vessels")
            return
        upper = int(heights_m[1] > heights_m[0])
        if heights_m[upper] == -math.inf or any(p[0] == "" for p in places):
            names = " and ".join(f"'{end.get('Connection')}'" for end in ends)
            self._left_out.append(f"{line.where}: it ends at {names}")
            return
        sections = line.rows("LineType", "Length")
        if not sections:
            self._left_out.append(f"{line.where}: it has no sections")
            return
        ordered = sections[::-1] if upper == 0 else sections  # from the lower end up
        materials = [self._material(line, row) for row in ordered]
        length = sum(row["length_m"] for row in materials)
        count = sum(self._segments(line, row) for row in ordered)
        keys: Keys = {"name": line.name}
        if len(materials) == 1:
            keys["rope"] = materials[0]["rope"]
        else:
            del materials[-1]["length_m"]
            keys["sections"] = materials
        keys |= {"length_m": length, "elements": max(3, count),
                 "damping": {"fraction_of_first_axial_mode": DAMPING},
                 "from": self._upper(line, *places[upper])}  # fmt: skip
        remark = f"structural damping: {100.0 * DAMPING:g} % of the first axial mode is assumed"
        self._left_out.append(remark)
        kind, position = places[1 - upper]
        if kind in (_FIXED, _ANCHORED):
            yield keys | {"fixed_at_m": position}
        elif kind == _FREE:
            name = f"{line.name}_end"
            self._ends.append({"name": name, "mass_kg": 0.0, "displaced_volume_m3": 0.0,
                               "added_mass_kg": [0.0] * 3, "drag_area_m2": [0.0] * 3})  # fmt: skip
            yield keys | {"to": name}
        else:
            yield keys | {"to": kind}

    def _place(self, line: _Object, end: Mapping[str, Any]) -> tuple[str, list[float]]:
        """Return what an end is at, "" if that has no equal, and its position."""
        kind = str(end.get("Connection"))
        x, y, z = (
            _number(end.get(f"Connection{axis}") or 0.0, f"{line.where}, Connection{axis}")
            for axis in "XYZ"
        )
        if kind == _ANCHORED:
            return kind, [x, y, z - self._depth(line.where)]
        if kind in self._buoys and (x or y or z):
            remark = f"{line.where}: its offset [{x:g}, {y:g}, {z:g}] m at {kind}, which is a point"
            self._left_out.append(remark)
        known = kind in (_FIXED, _FREE) or kind in self._vessels or kind in self._buoys
        return (kind if known else ""), [x, y, z]

    def _height_m(self, kind: str, position: Sequence[float]) -> float:
        """Return how high an end is [m], to find the upper one; infinite at a vessel."""
        if kind in self._vessels:
            return math.inf
        if kind in self._buoys:
            return self._buoys[kind].numbers("InitialPosition", (0.0, 0.0, 0.0))[2]
        return position[2] if kind == _FIXED else -math.inf

    def _depth(self, where: str) -> float:
        if not math.isfinite(self._depth_m):
            problem = "the water depth is not stated"
            raise InputError(where, problem, "add WaterDepth to the Environment")
        return self._depth_m

    def _upper(self, line: _Object, kind: str, position: list[float]) -> str:
        """Return the name of the point that a rope comes from."""
        if kind in self._buoys:
            return kind
        name = f"{line.name}_top" if self._hang_offs else WINCH
        if kind == _FIXED:
            self._hang_offs[name] = position
            return name
        vessel = self._vessels[kind]
        X, Y, Z = vessel.numbers("InitialPosition", (0.0, 0.0, 0.0))
        heading = math.radians(self._heading_deg(vessel))
        c, s = math.cos(heading), math.sin(heading)
        x, y, z = position
        self._hang_offs[name] = [X + c * x - s * y, Y + s * x + c * y, Z + z]
        if self._tip is None and name == WINCH:
            self._tip = vessel, position
        return name

    def _heading_deg(self, vessel: _Object) -> float:
        heel, trim, heading = vessel.numbers("Orientation", (0.0, 0.0, 0.0))
        if heel or trim:
            remark = f"{vessel.where}: heel {heel:g}° and trim {trim:g}°, it floats upright"
            self._left_out.append(remark)
        return vessel.number("InitialHeading", heading)

    def _segments(self, line: _Object, row: Mapping[str, Any]) -> int:
        length = _number(row.get("Length"), f"{line.where}, Length")
        if row.get("NumberOfSegments") is not None:
            return round(_number(row["NumberOfSegments"], line.where))
        target = row.get("TargetSegmentLength")
        if target is None:
            return 10
        return math.ceil(length / _positive(target, f"{line.where}, TargetSegmentLength") - 1e-9)

    def _material(self, line: _Object, row: Mapping[str, Any]) -> Keys:
        """Return the rope and length of a section."""
        kind = str(row.get("LineType"))
        if kind not in self._types:
            known = ", ".join(self._types) or "none"
            problem = f"there is no line type '{kind}'"
            raise InputError(f"{self._path}, {line.where}", problem, f"known: {known}")
        line_type = self._types[kind]
        OD = _positive(line_type.get("OD"), f"{line_type.where}, OD")
        ID = line_type.number("ID", 0.0)
        contents = TE * line.number("ContentsDensity", 0.0) * 0.25 * math.pi * ID**2
        Cd, Ca = line_type.numbers("Cd", (0.0, 0.0, 0.0)), line_type.numbers("Ca", _CA)
        self._used.append(line_type)
        for name, triple in (("Cd", Cd), ("Ca", Ca)):
            if triple[0] != triple[1]:
                self._left_out.append(f"{line_type.where}: {name} along y, that along x is used")
        normal = line_type.number("NormalDragLiftDiameter", OD) / OD
        axial = line_type.number("AxialDragLiftDiameter", OD) / OD
        if line_type.get("SeabedLateralFrictionCoefficient") is not None:
            self._frictions.append(line_type.number("SeabedLateralFrictionCoefficient"))
        EA_n = KN * line_type.number("EA")
        has_load = line_type.get("AllowableTension") is not None
        stated_n = KN * line_type.number("AllowableTension") if has_load else None
        rope: Keys = {
            "diameter_m": OD,
            "mass_kg_per_m": TE * line_type.number("MassPerUnitLength") + contents,
            "hydrodynamic_diameter_m": OD,
            "axial_stiffness_n": EA_n,
            "breaking_load_n": self._loads.of(kind, EA_n, stated_n),
            "drag_normal": Cd[0] * normal,
            "drag_tangential": Cd[2] * axial,
        }
        return {"rope": rope, "length_m": _number(row.get("Length"), f"{line.where}, Length")}

    def _payload(self, buoy: _Object) -> Keys:
        """Return the payload of a buoy."""
        volume = buoy.number("Volume", 0.0)
        area, Cd = (buoy.numbers(key, (0.0, 0.0, 0.0)) for key in ("DragArea", "Cd"))
        Ca = buoy.numbers("Ca", (0.0, 0.0, 0.0))
        if not any(a * c for a, c in zip(area, Cd, strict=True)):
            self._left_out.append(f"{buoy.where}: drag, give payloads its drag_area_m2")
        if not any(Ca):
            self._left_out.append(f"{buoy.where}: added mass, give payloads its added_mass_kg")
        return {
            "name": buoy.name, "mass_kg": TE * buoy.number("Mass"), "displaced_volume_m3": volume,
            "added_mass_kg": [coefficient * self._density * volume for coefficient in Ca],
            "drag_area_m2": [a * c for a, c in zip(area, Cd, strict=True)],
        }  # fmt: skip

    # environment

    def _of_ropes(self, ropes: list[Keys]) -> Iterator[Keys]:
        """Yield drag, added mass and bending of all ropes; what differs is a rope's own or listed.

        The largest drag coefficients are the scene's, since those of ropes are relative to them.
        """
        materials = [part["rope"] for rope in ropes for part in rope.get("sections", [rope])]
        normal, tangential = (max(material[key] for material in materials) for key in _DRAG)
        for material in materials:
            for key, usual in zip(_DRAG, (normal, tangential), strict=True):
                if material[key] == usual:
                    del material[key]
        if normal or tangential:
            yield {"drag": {"normal": normal, "tangential": tangential}}
        first, *further = dict.fromkeys(self._used)
        Ca, EI = first.numbers("Ca", _CA), first.numbers("EI", (0.0,))[0]
        yield {"added_mass": {"normal": Ca[0], "tangential": Ca[2]}}
        if EI:
            yield {"bending": {"stiffness_n_m2": KN * EI}}
        for line_type in further:
            if line_type.numbers("Ca", _CA) != Ca:
                self._left_out.append(f"{line_type.where}: Ca, that of {first.name} is used")
            if line_type.numbers("EI", (0.0,))[0] != EI:
                self._left_out.append(f"{line_type.where}: EI, that of {first.name} is used")

    def _effects(self, waves: list[Keys], ropes: list[Keys], has_payload: bool) -> list[Keys]:
        effects: list[Keys] = [{"current": {"profile": rows}} for rows in self._current()]
        if waves:
            first, *also = waves
            depth = {"depth_m": self._depth_m} if math.isfinite(self._depth_m) else {}
            effects.append({"waves": first | ({"also": also} if also else {}) | depth})
        effects += [{"weight": {}}, *self._of_ropes(ropes)]
        if math.isfinite(self._depth_m):
            stiffness = KN * self._environment.number("SeabedNormalStiffness", 100.0)
            friction = max(self._frictions, default=0.5)
            effects.append({"seabed": {"depth_m": self._depth_m, "stiffness_n_per_m3": stiffness,
                                       "friction": friction}})  # fmt: skip
        if self._environment.number("SeabedSlope", 0.0):
            self._left_out.append("Environment: the slope of the seabed")
        return [*effects, {"payload": {}}] if has_payload else effects

    def _current(self) -> Iterator[list[Any]]:
        """Yield the rows of the current, if there is one."""
        speed = self._environment.number("RefCurrentSpeed", 0.0)
        towards = self._environment.number("RefCurrentDirection", 0.0)
        table = self._environment.rows("CurrentDepth", "CurrentFactor")
        rows = table or [{"CurrentDepth": 0.0, "CurrentFactor": 1.0}]
        profile = []
        for row in rows:
            depth, factor, turn = (
                _number(row.get(key) or 0.0, f"Environment, {key}")
                for key in ("CurrentDepth", "CurrentFactor", "CurrentRotation")
            )
            angle = math.radians(towards + turn)
            velocity = [speed * factor * math.cos(angle), speed * factor * math.sin(angle)]
            profile.append([-depth if depth else 0.0, velocity])
        if speed:
            yield profile

    def _waves(self) -> Iterator[Keys]:
        """Yield the systems of waves."""
        trains = self._listed("WaveTrains", self._environment.get("WaveTrains", []))
        for number, keys in enumerate(trains, 1):
            train = _Object(keys, f"wave train {number}")
            kind = str(train.get("WaveType", "")).lower()
            heading = train.number("WaveDirection", 0.0)
            system: Keys = {"heading_deg": heading}
            if kind in (*_AIRY, *_NONLINEAR):
                height = train.number("WaveHeight", 0.0)
                if height == 0.0:
                    continue
                if kind in _NONLINEAR:
                    remark = f"{train.where}: it is {kind}, and an Airy wave here"
                    self._left_out.append(remark)
                system["regular"] = {"height_m": height, "period_s": train.number("WavePeriod")}
                yield system
            elif kind in ("jonswap", "pierson-moskowitz", "issc"):
                if train.number("WaveHs") == 0.0:
                    continue
                yield system | self._spectrum(train, kind)
            elif kind:
                self._left_out.append(f"{train.where}: WaveType {kind}")
            self._left_out += train.unread()

    def _spectrum(self, train: _Object, kind: str) -> Keys:
        """Return a JONSWAP spectrum. Raises InputError: it has no period."""
        wave_gamma = train.get("WaveGamma", 1.0 if kind != "jonswap" else None)
        gamma = None if wave_gamma is None else _number(wave_gamma, f"{train.where}, WaveGamma")
        if train.get("WaveTp") is not None:
            period = train.number("WaveTp")
        elif train.get("WaveTz") is not None and gamma is not None:
            # DNV-RP-C205, 3.5.5.4
            ratio = 0.6673 + 0.05037 * gamma - 0.006230 * gamma**2 + 0.0003341 * gamma**3
            period = train.number("WaveTz") / ratio
        else:
            where, remedy = f"{self._path}, {train.where}", "add WaveTp, or WaveTz and WaveGamma"
            raise InputError(where, "its peak period is not stated", remedy)
        sea = {"significant_height_m": train.number("WaveHs"), "peak_period_s": period}
        sea |= {} if gamma is None else {"gamma": gamma}
        self._left_out.append(f"{train.where}: its random phases, they are those of seed {SEED}")
        return {"jonswap": sea, "components": COMPONENTS, "seed": SEED}

    def _riding(self, has_waves: bool) -> Keys:
        """Return how the vessel moves by its RAOs; nothing if it rests."""
        if self._tip is None:
            return {}
        vessel, tip = self._tip
        kind, draught = str(vessel.get("VesselType", "")), str(vessel.get("Draught", ""))
        kinds = self._model.get("VesselTypes") or []
        if kind not in [str(entry.get("Name")) for entry in kinds if isinstance(entry, Mapping)]:
            return {}
        if not has_waves:
            self._left_out.append(f"{vessel.where}: it rests, as there are no waves")
            return {}
        try:
            read_responses(str(self._path), RaoConventions(vessel=kind, draught=draught))
        except InputError as error:
            self._left_out.append(f"{vessel.where}: its RAOs ({str(error).removesuffix('.')})")
            return {}
        relative_path = os.path.relpath(self._path.resolve(), self._folder.resolve())
        conventions = {"vessel": kind} | ({"draught": draught} if draught else {})
        return {
            "responses": f"./{relative_path}", "heading_deg": self._heading_deg(vessel),
            "crane_tip_m": tip, "conventions": conventions,
        }  # fmt: skip

    def _list_rest(self, used: set[Any]) -> None:
        """List objects and keys that were not read."""
        for key, listed in self._model.items():
            if key in _READ:
                continue
            entries = listed if isinstance(listed, list) else []
            names = [str(entry.get("Name", "")) for entry in entries if isinstance(entry, Mapping)]
            self._left_out.append(f"{key}{': ' if names else ''}{', '.join(names)}")
        for name, buoy in self._buoys.items():
            if name not in used:
                self._left_out.append(f"{buoy.where}: no imported line ends at it")
        objects = [self._general, self._environment, *self._types.values(), *self._lines,
               *self._vessels.values(), *self._buoys.values()]  # fmt: skip
        for entry in objects:
            self._left_out += entry.unread()


def _number(value: Any, where: str) -> float:
    """Return a number, also one that YAML reads as text, like 700e3. Raises InputError."""
    if isinstance(value, (int, float, str)) and not isinstance(value, bool):
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if math.isfinite(number):
            return number
    text = "not stated" if value is None else f"'{value}'"
    raise InputError(where, f"it is {text}", "give a finite number")


def _positive(value: Any, where: str) -> float:
    """Return a number above 0. Raises InputError."""
    number = _number(value, where)
    if number <= 0.0:
        raise InputError(where, f"it is {number:g}", "give a number above 0")
    return number
