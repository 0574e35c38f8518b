"""The house's rules, read from the syntax tree: floors, doors, length, and what stays outside."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "rope_twin"
SOURCES = sorted(PACKAGE.rglob("*.py"))
VALIDATION = sorted((ROOT / "validation").rglob("*.py"))
LABORATORY = [*VALIDATION, *sorted((ROOT / "benchmarks").rglob("*.py"))]
TESTS = sorted((ROOT / "test").rglob("*.py"))
EVERYTHING = [*SOURCES, *LABORATORY, *TESTS, *sorted(ROOT.glob("launch/*.py"))]

# Imports run downward only; parts of one floor may use each other.
FLOORS = (
    ("core", "sea", "errors", "quantity", "files"),
    ("effects", "vortex"),
    ("scene",),
    ("twin",),
    ("topics", "messages", "recording", "view", "feeds", "alerts", "console"),
    ("estimation",),
    ("forecast",),
    ("run",),
    ("ros",),
    ("studies", "planning", "interchange"),
    ("cli", "__init__", "__main__"),  # the roof: doors that open what they are asked for
)
MOST_LINES = 600
MOST_IMPORTS = 25  # in a chain, from a command down
VAGUE = {"utils", "util", "helpers", "helper", "common", "manager", "base", "misc", "tools"}
COMPILER = PACKAGE / "core" / "jit"
PUBLIC_NUMBA = {"numba.config", "numba.types", "numba.extending.overload"}
PRINTERS = {"cli"}
# the floors of public names
PUBLIC = {"load_scene": "scene", "fed": "studies", "plan": "planning"} | dict.fromkeys(
    ("Fleet", "FleetInputs", "FleetRecord", "FleetState", "LiveState", "Snapshot", "Twin",
     "live_state"),
    "twin",
)  # fmt: skip


def part(path: Path) -> str:
    """The floor's room that a file belongs to: its first folder, or its own name."""
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def floor(room: str) -> int:
    """Its number, from the ground."""
    found = [number for number, rooms in enumerate(FLOORS) if room in rooms]
    assert found, f"'{room}' stands on no floor; add it to FLOORS in test/style/test_layers.py"
    return found[0]


@cache
def tree(path: Path) -> ast.Module:
    """Return the syntax tree of a file."""
    return ast.parse(path.read_text())


@cache
def nodes(path: Path) -> tuple[ast.AST, ...]:
    """Return every node of a file's syntax tree."""
    return tuple(ast.walk(tree(path)))


@cache
def imported(path: Path) -> tuple[tuple[int, str], ...]:
    """Line and full name of everything imported, lazily or not, `from a import b` as a.b."""
    found: list[tuple[int, str]] = []
    for node in nodes(path):
        if isinstance(node, ast.Import):
            found += ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: relative import"
            found += ((node.lineno, f"{node.module}.{alias.name}") for alias in node.names)
    return tuple(found)


def room_of(name: str) -> str | None:
    """The room that an imported name lies in; None outside the package."""
    words = name.split(".")
    if words[0] != "rope_twin":
        return None
    if len(words) == 1 or not (
        (PACKAGE / words[1]).is_dir() or (PACKAGE / f"{words[1]}.py").exists()
    ):
        return PUBLIC.get(words[-1], "errors")
    return words[1]


def relative(path: Path) -> str:
    """As it is written in a report."""
    return str(path.relative_to(ROOT))


def test_imports_run_downward() -> None:
    """No file uses what stands on a floor above its own."""
    upward = [
        f"{relative(path)}:{line}: {name}"
        for path in SOURCES
        for line, name in imported(path)
        if (room := room_of(name)) is not None and floor(room) > floor(part(path))
    ]
    assert not upward


def loaded_with(node: ast.AST) -> Iterator[ast.AST]:
    """Everything that runs when a module is loaded: no functions, nothing for the type checker."""
    for child in ast.iter_child_nodes(node):
        checks = isinstance(child, ast.If) and getattr(child.test, "id", "") == "TYPE_CHECKING"
        if not checks and not isinstance(child, ast.FunctionDef):
            yield child
            yield from loaded_with(child)


def file_of(name: str) -> Path | None:
    """The file of a module of the package, or None if the package has no such module."""
    place = ROOT / name.replace(".", "/")
    files = (place.with_suffix(".py"), place / "__init__.py")
    return next((file for file in files if file.exists()), None)


@cache
def chain(path: Path) -> tuple[str, ...]:
    """The longest chain of files of the package of which each loads the next, from this one on."""
    files: set[Path | None] = set()
    for node in loaded_with(tree(path)):
        if isinstance(node, ast.Import):
            files |= {file_of(alias.name) for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module is not None:
            own = file_of(node.module)
            files |= {file_of(f"{node.module}.{alias.name}") or own for alias in node.names}
    chains = [chain(file) for file in files if file is not None and file != path]
    return (relative(path), *max(chains, key=len, default=()))


def test_chains_of_imports_are_short() -> None:
    """A reader who follows the imports of a command arrives at the errors in so many files."""
    longest = max((chain(path) for path in SOURCES), key=len)
    assert len(longest) <= MOST_IMPORTS, "\n".join(longest)


def test_only_commands_start_ros() -> None:
    """Everything else runs without ROS; a command imports it when it is asked for."""
    inside = [path for path in SOURCES if part(path) not in ("ros", "cli")]
    assert not importers("rope_twin.ros", [*inside, *LABORATORY])
    assert importers("rope_twin.ros", SOURCES)


def test_the_package_never_imports_its_laboratory() -> None:
    """validation/ and benchmarks/ use the package and are not installed with it."""
    everywhere = [*SOURCES, *sorted(ROOT.glob("launch/*.py"))]
    for name in ("validation", "benchmarks", "test"):
        assert not importers(name, everywhere)
    assert importers("rope_twin", LABORATORY)


def test_validation_stands_below_benchmarks() -> None:
    """Benchmarks use rigs and published ropes of validation, never the reverse."""
    assert not importers("benchmarks", VALIDATION)


def importers(package: str, paths: list[Path]) -> list[str]:
    """Imports of a package, or of a part of it, in these files."""
    return [
        f"{relative(path)}:{line}: {name}"
        for path in paths
        for line, name in imported(path)
        if name == package or name.startswith(f"{package}.")
    ]


def outside(names: set[str], rooms: set[str]) -> list[str]:
    """Where one of these packages is imported outside these parts of the package."""
    return [
        f"{relative(path)}:{line}: {name}"
        for path in (*SOURCES, *LABORATORY)
        if path in LABORATORY or part(path) not in rooms
        for line, name in imported(path)
        if name.split(".")[0] in names
    ]


def test_ros_stays_in_its_folder() -> None:
    """rclpy, launch and the message packages: ros/ and launch/ only."""
    assert not outside({"rclpy", "launch", "launch_ros", "lifecycle_msgs", "sensor_msgs"}, {"ros"})
    assert any(name.startswith("rclpy") for p in SOURCES for _, name in imported(p))


def test_only_the_core_is_compiled() -> None:
    """numba: core/ only."""
    assert not outside({"numba", "llvmlite"}, {"core"})


def test_private_parts_of_the_compiler_have_one_folder() -> None:
    """Elsewhere only numba's public names are imported, and nothing of llvmlite."""
    elsewhere = [p for p in (*SOURCES, *LABORATORY) if COMPILER not in p.parents]
    private = [
        f"{relative(path)}:{line}: {name}"
        for path in elsewhere
        for line, name in imported(path)
        if name.split(".")[0] in ("numba", "llvmlite") and name not in PUBLIC_NUMBA
    ]
    assert not private
    assert not [relative(path) for path in elsewhere if "numba.core" in path.read_text()]
    assert any(name == "numba.types" for path in elsewhere for _, name in imported(path))


def test_effects_know_the_core_and_no_one_else() -> None:
    """An effect may use core, vortex and quantity; of the other effects only EFFECTS knows."""
    strangers = [
        f"{relative(path)}:{line}: {name}"
        for path in sorted((PACKAGE / "effects").glob("*.py"))
        if path.name != "__init__.py"
        for line, name in imported(path)
        if name.startswith("rope_twin.effects")
    ]
    assert not strangers


def test_only_commands_print() -> None:
    """Elsewhere a logger, a return value or an exception speaks."""
    printing = [
        f"{relative(path)}:{node.lineno}"
        for path in SOURCES
        if part(path) not in PRINTERS
        for node in nodes(path)
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "print"
    ]
    assert not printing


def test_files_are_short() -> None:
    """At most 600 lines; 150 to 450 is the aim."""
    lengths = {relative(path): len(path.read_text().splitlines()) for path in EVERYTHING}
    assert not {name: lines for name, lines in lengths.items() if lines > MOST_LINES}


def test_names_tell_something() -> None:
    """No file or folder is called after nothing."""
    vague = [p for p in EVERYTHING if VAGUE & {p.stem, *p.relative_to(ROOT).parts[:-1]}]
    assert not [relative(path) for path in vague]


def test_nothing_is_left_behind() -> None:
    """No debugger, no note to oneself."""
    marks = ("TO" + "DO", "FIX" + "ME", "XX" + "X", "break" + "point(", "set_" + "trace(")
    left = [f"{relative(p)}: {mark}" for p in EVERYTHING for mark in marks if mark in p.read_text()]
    assert not left


def is_silent(handler: ast.ExceptHandler) -> bool:
    """`except:` at all, or `except Exception: pass`."""
    broad = getattr(handler.type, "id", "") in ("Exception", "BaseException")
    return handler.type is None or (broad and all(isinstance(n, ast.Pass) for n in handler.body))


def test_no_exception_is_swallowed() -> None:
    """Every error is reported to someone."""
    assert not [
        f"{relative(path)}:{node.lineno}"
        for path in (*SOURCES, *LABORATORY)
        for node in nodes(path)
        if isinstance(node, ast.ExceptHandler) and is_silent(node)
    ]


def test_every_file_says_what_it_is_for() -> None:
    """A docstring at its head, unless it is empty."""
    files = (*SOURCES, *LABORATORY)
    trees = {relative(path): tree(path) for path in files}
    assert not [name for name, tree in trees.items() if tree.body and not ast.get_docstring(tree)]
