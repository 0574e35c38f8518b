"""Input deck of MoorDyn 2 as data: reading and writing, in its own words and units (SI).

The format is that of MoorDyn's documentation ("Inputs", version 2): sections between lines of
dashes, each with a line of column names and one of units. Columns are found by their names, so that
their order is free. Coefficients refer to `Diam`, that of the displaced volume, the axial drag to π
times it; a negative `BA/-zeta` is a fraction of an element's critical damping.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import astuple, dataclass
from operator import itemgetter
from pathlib import Path
from typing import Any

from rope_twin.errors import InputError, unreadable

CURRENT_FILE = "current_profile.txt"  # the name that MoorDyn looks for beside its deck
LARGEST_FILE_BYTES = 10_000_000
RULE = "-" * 20
COUPLED, FREE, FIXED = "Coupled", "Free", "Fixed"
_KINDS = {
    **dict.fromkeys(("coupled", "vessel", "ves", "vess", "cpld"), COUPLED),
    **dict.fromkeys(("free", "point", "connect", "con"), FREE),
    **dict.fromkeys(("fixed", "anchor", "anch", "fix"), FIXED),
}
_SECTIONS = {
    "LINE TYPES": "types", "LINE DICTIONARY": "types", "POINTS": "points", "POINT LIST": "points",
    "POINT PROPERTIES": "points", "CONNECTION PROPERTIES": "points", "NODE PROPERTIES": "points",
    "LINES": "lines", "LINE LIST": "lines", "LINE PROPERTIES": "lines", "OPTIONS": "options",
    "SOLVER OPTIONS": "options", "OUTPUTS": "outputs", "OUTPUT": "outputs",
}  # fmt: skip
_END = "NEED THIS LINE"
# names of columns in small letters, of which the first that is there counts
_TYPE = {"name": ("typename", "name", "linetype"), "diameter_m": ("diam",),
         "mass_kg_per_m": ("mass/m", "massdenair", "massden", "massdeninair"), "EA": ("ea",),
         "damping": ("ba/-zeta", "ba", "cint"), "EI_n_m2": ("ei",), "Cd": ("cd", "cdn"),
         "Ca": ("ca", "can"), "CdAx": ("cdax", "cdt"), "CaAx": ("caax", "cat")}  # fmt: skip
_POINT = {"number": ("id", "node", "point"), "kind": ("attachment", "type"), "x": ("x",),
          "y": ("y",), "z": ("z",), "mass_kg": ("m", "mass"), "volume_m3": ("v", "vol", "volume"),
          "CdA_m2": ("cda",), "Ca": ("ca",)}  # fmt: skip
_LINE = {"number": ("id", "line"), "type_name": ("linetype",), "end_a": ("attacha", "nodea"),
         "end_b": ("attachb", "nodeb"), "length_m": ("unstrlen",),
         "segments": ("numsegs",)}  # fmt: skip


@dataclass(frozen=True)
class LineType:
    """Properties of a line per metre."""

    name: str
    diameter_m: float
    mass_kg_per_m: float
    EA_n: float
    damping: float  # N·s; negative: fraction of an element's critical damping
    EI_n_m2: float
    Cd: float
    Ca: float
    CdAx: float
    CaAx: float
    further: tuple[float, ...] = ()  # Cl, dF, cF of vortex-induced vibration


@dataclass(frozen=True)
class Point:
    """A point where lines end."""

    number: int
    kind: str  # COUPLED, FREE or FIXED
    at_m: tuple[float, float, float]
    mass_kg: float = 0.0
    volume_m3: float = 0.0
    CdA_m2: float = 0.0
    Ca: float = 0.0


@dataclass(frozen=True)
class Line:
    """A line of one type between two points."""

    number: int
    type_name: str
    end_a: int
    end_b: int
    length_m: float
    segments: int


@dataclass(frozen=True)
class Deck:
    """Content of a deck."""

    title: str
    types: tuple[LineType, ...]
    points: tuple[Point, ...]
    lines: tuple[Line, ...]
    options: tuple[tuple[str, str], ...]  # value and name, in order
    current: tuple[tuple[float, float, float, float], ...] = ()  # z, ux, uy, uz; from the bottom up
    unread: tuple[str, ...] = ()  # what the deck has beyond this, one phrase each


def deck_text(deck: Deck) -> str:
    """Return the deck's file."""
    rows = [
        deck.title,
        f"{RULE} LINE TYPES {RULE}",
        "TypeName Diam Mass/m EA BA/-zeta EI Cd Ca CdAx CaAx",
        "(name) (m) (kg/m) (N) (N-s/-) (N-m^2) (-) (-) (-) (-)",
    ]
    for line_type in deck.types:
        name, *numbers, further = astuple(line_type)
        rows.append(" ".join([name, *map(_cell, (*numbers, *further))]))
    rows += [
        f"{RULE} POINTS {RULE}",
        "Node Type X Y Z M V CdA CA",
        "(#) (word) (m) (m) (m) (kg) (m^3) (m^2) (-)",
    ]
    for point in deck.points:
        number, kind, position, *figures = astuple(point)
        rows.append(" ".join([str(number), kind, *map(_cell, (*position, *figures))]))
    rows += [
        f"{RULE} LINES {RULE}",
        "Line LineType NodeA NodeB UnstrLen NumSegs Outputs",
        "(#) (name) (#) (#) (m) (-) (-)",
    ]
    for line in deck.lines:
        ends = f"{line.number} {line.type_name} {line.end_a} {line.end_b}"
        rows.append(f"{ends} {_cell(line.length_m)} {line.segments} -")
    rows += [f"{RULE} OPTIONS {RULE}", *(f"{value} {name}" for value, name in deck.options)]
    return "\n".join([*rows, f"{RULE} OUTPUTS {RULE}", f"{RULE} need this line {RULE}", ""])


def current_text(deck: Deck) -> str:
    """Return the file of the deck's current, for CURRENT_FILE."""
    head = [deck.title, "current over height", "z (m) ux uy uz (m/s)"]
    return "\n".join([*head, *(" ".join(map(_cell, row)) for row in deck.current), ""])


def _cell(value: float) -> str:
    return repr(float(value)) if value else "0"


def read_deck(path: Path) -> Deck:
    """Read a deck of version 2, and its current beside it.

    Raises:
        InputError: it is no such deck, or a number in it is wrong; one sentence.
    """
    sections: dict[str, list[tuple[int, list[str]]]] = {}
    unread, title, section, heading = list[str](), "", "", ""
    for number, line in enumerate(_lines(path), 1):
        cells = line.split()
        if line.lstrip().startswith("--") and cells:
            name = " ".join(line.replace("-", " ").split()).upper()
            if _END in name:
                break
            if not name:
                continue
            section, heading = _SECTIONS.get(name, ""), name
            sections.setdefault(section, [])
        elif not sections:
            title = title or line.strip()
        elif cells and cells[0] not in ("#", "!"):
            sections[section].append((number, cells))
            if section in ("", "outputs") and f"section {heading}" not in unread:
                unread.append(f"section {heading}")
    for name in ("types", "points", "lines"):
        if name not in sections:
            problem = f"there is no section {name.upper() if name != 'types' else 'LINE TYPES'}"
            raise InputError(str(path), problem, "give a deck of MoorDyn 2")
    types = tuple(_types(path, sections["types"], unread))
    points = tuple(_points(path, sections["points"]))
    lines = tuple(_read_lines(path, sections["lines"]))
    options = tuple(
        (cells[0], cells[1]) for _, cells in sections.get("options", []) if len(cells) > 1
    )
    has_current = any(name.lower() == "currents" and value != "0" for value, name in options)
    current = tuple(_current(path.parent / CURRENT_FILE)) if has_current else ()
    _check_names(path, types, points, lines)
    return Deck(title, types, points, lines, options, current, tuple(unread))


def _lines(path: Path) -> list[str]:
    try:
        if path.stat().st_size > LARGEST_FILE_BYTES:
            raise InputError(str(path), "it is larger than 10 MB", "give a deck")
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise unreadable(path, error) from None
    before, nul, _ = text.partition("\0")
    if nul:
        problem = f"it is not text (byte 0x00 in line {before.count(chr(10)) + 1})"
        raise InputError(str(path), problem, "give a whole deck")
    return text.splitlines()


Rows = Sequence[tuple[int, list[str]]]


def _table(
    path: Path, rows: Rows, columns: dict[str, tuple[str, ...]], optional: Sequence[str] = ()
) -> Iterator[tuple[str, dict[str, str], list[str]]]:
    """Yield place, cells by name and cells beyond the known ones of each row."""
    if len(rows) < 2:
        problem = "a section has no names and units of its columns"
        raise InputError(str(path), problem, "give both lines, as in MoorDyn 2")
    number, names = rows[0]
    header = [name.lower() for name in names]
    index = dict[str, int]()
    for name, known in columns.items():
        place = next((header.index(title) for title in known if title in header), None)
        if place is not None:
            index[name] = place
        elif name not in optional:
            problem = f"there is no column {' or '.join(known)}"
            raise InputError(f"{path}, line {number}", problem, "give a deck of MoorDyn 2")
    for number, cells in rows[2:]:
        where, last = f"{path}, line {number}", max(index.values())
        if len(cells) <= last:
            raise InputError(where, f"{len(cells)} values", f"the columns are {' '.join(names)}")
        yield where, {name: cells[k] for name, k in index.items()}, cells[last + 1 :]


def _types(path: Path, rows: Rows, unread: list[str]) -> Iterator[LineType]:
    for where, cells, more in _table(path, rows, _TYPE):
        name = cells.pop("name")
        for key in ("EA", "damping"):
            if "|" in cells[key]:
                unread.append(f"line type {name}: {key} {cells[key]}, its dynamic part")
                cells[key] = cells[key].split("|")[0]
        numbers: dict[str, Any] = {key: _number(where, cell, key) for key, cell in cells.items()}
        for key, value in numbers.items():
            if value < 0.0 and key != "damping":
                raise InputError(where, f"{key} is {value:g}", "give 0 or more")
        if more:
            unread.append(f"line type {name}: further columns {' '.join(more)}")
        yield LineType(name, EA_n=numbers.pop("EA"), **numbers)


def _points(path: Path, rows: Rows) -> Iterator[Point]:
    for where, cells, _ in _table(path, rows, _POINT, ("mass_kg", "volume_m3", "CdA_m2", "Ca")):
        number, kind = _integer(where, cells.pop("number")), cells.pop("kind").lower()
        if kind not in _KINDS:
            remedy = "give Coupled, Free or Fixed points; bodies and rods have no equal"
            raise InputError(where, f"a point of type {kind}", remedy)
        x, y, z = (_number(where, cells.pop(axis), axis) for axis in "xyz")
        numbers = {key: _number(where, cell, key) for key, cell in cells.items()}
        yield Point(number, _KINDS[kind], (x, y, z), **numbers)


def _read_lines(path: Path, rows: Rows) -> Iterator[Line]:
    for where, cells, _ in _table(path, rows, _LINE):
        length = _number(where, cells["length_m"], "UnstrLen")
        segments = int(_number(where, cells["segments"], "NumSegs"))
        if length <= 0.0 or segments < 1:
            problem = f"a line of {length:g} m in {segments} segments"
            raise InputError(where, problem, "give a length above 0 and a segment or more")
        number, end_a, end_b = (_integer(where, cells[key]) for key in ("number", "end_a", "end_b"))
        yield Line(number, cells["type_name"], end_a, end_b, length, segments)


def _check_names(
    path: Path, types: Sequence[LineType], points: Sequence[Point], lines: Sequence[Line]
) -> None:
    if not lines:
        raise InputError(str(path), "it has no lines", "give one or more")
    for kind, names in (("line type", [entry.name for entry in types]),
                         ("point", [point.number for point in points]),
                         ("line", [entry.number for entry in lines])):  # fmt: skip
        double = next((name for name in names if list(names).count(name) > 1), None)
        if double is not None:
            raise InputError(str(path), f"{kind} {double} is double", "rename one")
    known, numbers = {entry.name for entry in types}, {point.number for point in points}
    for line in lines:
        where = f"{path}, line {line.number} of LINES"
        if line.type_name not in known:
            problem = f"there is no line type {line.type_name}"
            raise InputError(where, problem, f"known: {', '.join(sorted(known))}")
        for end in (line.end_a, line.end_b):
            if end not in numbers:
                known_points = ", ".join(map(str, sorted(numbers)))
                raise InputError(where, f"there is no point {end}", f"known: {known_points}")


def _current(path: Path) -> list[tuple[float, float, float, float]]:
    """Return the rows of the current's file, from the bottom up. Raises InputError."""
    rows = list[tuple[float, float, float, float]]()
    for number, line in enumerate(_lines(path)[3:], 4):
        cells = line.split()
        if not cells:
            continue
        where = f"{path}, line {number}"
        if len(cells) != 4:
            raise InputError(where, f"{len(cells)} values", "a row is z ux uy uz")
        z, x, y, vertical = (_number(where, cell, "a velocity") for cell in cells)
        rows.append((z, x, y, vertical))
    if not rows:
        raise InputError(str(path), "it has no rows", "give rows z ux uy uz after 3 lines")
    if rows[0][0] > rows[-1][0]:
        rows.reverse()
    return sorted(rows, key=itemgetter(0))  # rows of one height, a step, stay in their order


def _number(where: str, cell: str, name: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(where, f"{name} is '{cell}'", "give a finite number")
    return value


def _integer(where: str, cell: str) -> int:
    if not cell.isdecimal():
        problem = f"'{cell}' is not the number of a point or line"
        raise InputError(where, problem, "give numbers, as bodies, rods and turbines have no equal")
    return int(cell)
