"""Rules of the code base, read from the syntax tree: layers, private imports, length, silence."""

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

# Imports run downward only; parts of one layer may use each other.
LAYERS = (
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
    ("cli", "__init__", "__main__"),  # import what a command needs when it runs
)
MAX_LINES = 600
MAX_IMPORTS = 25  # in a chain, from a command down
VAGUE = {"utils", "util", "helpers", "helper", "common", "manager", "base", "misc", "tools"}
COMPILER = PACKAGE / "core" / "jit"
PUBLIC_NUMBA = {"numba.config", "numba.types", "numba.extending.overload"}
PRINTERS = {"cli"}
# the parts that public names come from
PUBLIC = {"load_scene": "scene", "fed": "studies", "plan": "planning"} | dict.fromkeys(
    ("Fleet", "FleetInputs", "FleetRecord", "FleetState", "LiveState", "Snapshot", "Twin",
     "live_state"),
    "twin",
)  # fmt: skip


def package_of(path: Path) -> str:
    """Return the part of rope_twin that a file belongs to: its first folder, or its own name."""
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def layer_of(name: str) -> int:
    """Return the layer of a part, counted from the lowest."""
    numbers = [number for number, names in enumerate(LAYERS) if name in names]
    assert numbers, f"'{name}' is in no layer; add it to LAYERS in test/style/test_layers.py"
    return numbers[0]


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
    """Return line and full name of every import, `from a import b` as a.b."""
    imports: list[tuple[int, str]] = []
    for node in nodes(path):
        if isinstance(node, ast.Import):
            imports += ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: relative import"
            imports += ((node.lineno, f"{node.module}.{alias.name}") for alias in node.names)
    return tuple(imports)


def package_of_import(name: str) -> str | None:
    """Return the part that an imported name belongs to; None outside rope_twin."""
    parts = name.split(".")
    if parts[0] != "rope_twin":
        return None
    if len(parts) == 1 or not (
        (PACKAGE / parts[1]).is_dir() or (PACKAGE / f"{parts[1]}.py").exists()
    ):
        return PUBLIC.get(parts[-1], "errors")
    return parts[1]


def relative(path: Path) -> str:
    """Return the path as reports show it."""
    return str(path.relative_to(ROOT))


def test_no_layer_imports_from_a_higher_one() -> None:
    """A file imports only from its own layer and lower ones."""
    upward = [
        f"{relative(path)}:{line}: {name}"
        for path in SOURCES
        for line, name in imported(path)
        if (other := package_of_import(name)) is not None
        and layer_of(other) > layer_of(package_of(path))
    ]
    assert not upward


def loaded_with(node: ast.AST) -> Iterator[ast.AST]:
    """Yield every node that runs on import: no functions, nothing for the type checker."""
    for child in ast.iter_child_nodes(node):
        checks = isinstance(child, ast.If) and getattr(child.test, "id", "") == "TYPE_CHECKING"
        if not checks and not isinstance(child, ast.FunctionDef):
            yield child
            yield from loaded_with(child)


def file_of(name: str) -> Path | None:
    """Return the file of a module of rope_twin, or None if it has no such module."""
    path = ROOT / name.replace(".", "/")
    files = (path.with_suffix(".py"), path / "__init__.py")
    return next((file for file in files if file.exists()), None)


@cache
def chain(path: Path) -> tuple[str, ...]:
    """Return the longest chain of files of which each imports the next, from this one on."""
    files: set[Path | None] = set()
    for node in loaded_with(tree(path)):
        if isinstance(node, ast.Import):
            files |= {file_of(alias.name) for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module is not None:
            package = file_of(node.module)
            files |= {file_of(f"{node.module}.{alias.name}") or package for alias in node.names}
    chains = [chain(file) for file in files if file is not None and file != path]
    return (relative(path), *max(chains, key=len, default=()))


def test_import_chains_are_short() -> None:
    """At most MAX_IMPORTS files from a command down to the errors."""
    longest = max((chain(path) for path in SOURCES), key=len)
    assert len(longest) <= MAX_IMPORTS, "\n".join(longest)


def test_only_commands_start_ros() -> None:
    """Only commands import rope_twin.ros; everything else runs without ROS."""
    inside = [path for path in SOURCES if package_of(path) not in ("ros", "cli")]
    assert not importers("rope_twin.ros", [*inside, *LABORATORY])
    assert importers("rope_twin.ros", SOURCES)


def test_the_package_does_not_import_validation_or_benchmarks() -> None:
    """validation/ and benchmarks/ use the package and are not installed with it."""
    everywhere = [*SOURCES, *sorted(ROOT.glob("launch/*.py"))]
    for name in ("validation", "benchmarks", "test"):
        assert not importers(name, everywhere)
    assert importers("rope_twin", LABORATORY)


def test_validation_does_not_import_benchmarks() -> None:
    """Benchmarks use rigs and published ropes of validation, never the reverse."""
    assert not importers("benchmarks", VALIDATION)


def importers(package: str, paths: list[Path]) -> list[str]:
    """Return the imports of a package, or of a part of it, in these files."""
    return [
        f"{relative(path)}:{line}: {name}"
        for path in paths
        for line, name in imported(path)
        if name == package or name.startswith(f"{package}.")
    ]


def outside(names: set[str], allowed: set[str]) -> list[str]:
    """Return where one of these packages is imported outside these parts of rope_twin."""
    return [
        f"{relative(path)}:{line}: {name}"
        for path in (*SOURCES, *LABORATORY)
        if path in LABORATORY or package_of(path) not in allowed
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


def test_effects_do_not_import_each_other() -> None:
    """An effect may use core, vortex and quantity; only EFFECTS lists the effects."""
    imports = [
        f"{relative(path)}:{line}: {name}"
        for path in sorted((PACKAGE / "effects").glob("*.py"))
        if path.name != "__init__.py"
        for line, name in imported(path)
        if name.startswith("rope_twin.effects")
    ]
    assert not imports


def test_only_commands_print() -> None:
    """Other parts use a logger, a return value or an exception."""
    printing = [
        f"{relative(path)}:{node.lineno}"
        for path in SOURCES
        if package_of(path) not in PRINTERS
        for node in nodes(path)
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "print"
    ]
    assert not printing


def test_files_are_short() -> None:
    """At most 600 lines; 150 to 450 is the aim."""
    lengths = {relative(path): len(path.read_text().splitlines()) for path in EVERYTHING}
    assert not {name: lines for name, lines in lengths.items() if lines > MAX_LINES}


def test_file_names_are_not_vague() -> None:
    """No file or folder has a name such as utils, common or base."""
    vague = [p for p in EVERYTHING if VAGUE & {p.stem, *p.relative_to(ROOT).parts[:-1]}]
    assert not [relative(path) for path in vague]


def test_no_debugger_or_note_is_left() -> None:
    """No debugger call and no note to oneself."""
    marks = ("TO" + "DO", "FIX" + "ME", "XX" + "X", "break" + "point(", "set_" + "trace(")
    left = [f"{relative(p)}: {mark}" for p in EVERYTHING for mark in marks if mark in p.read_text()]
    assert not left


def is_silent(handler: ast.ExceptHandler) -> bool:
    """Return whether a handler is a bare `except:` or `except Exception: pass`."""
    broad = getattr(handler.type, "id", "") in ("Exception", "BaseException")
    return handler.type is None or (broad and all(isinstance(n, ast.Pass) for n in handler.body))


def test_no_exception_is_swallowed() -> None:
    """No broad handler passes silently."""
    assert not [
        f"{relative(path)}:{node.lineno}"
        for path in (*SOURCES, *LABORATORY)
        for node in nodes(path)
        if isinstance(node, ast.ExceptHandler) and is_silent(node)
    ]


def test_every_file_has_a_docstring() -> None:
    """A docstring at its head, unless it is empty."""
    files = (*SOURCES, *LABORATORY)
    trees = {relative(path): tree(path) for path in files}
    assert not [name for name, tree in trees.items() if tree.body and not ast.get_docstring(tree)]
