"""Commands on the installation: `doctor` checks the machine, `completion` serves the shell."""

from __future__ import annotations

import argparse
import ctypes
import importlib
import importlib.metadata
import os
import platform
import shutil
import stat
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

from rope_twin.cli import Command, ExitCode, build_parser, print_json
from rope_twin.core import SOLVER_VERSION
from rope_twin.errors import InputError, RopeTwinError
from rope_twin.run.options import add_json

DISTRIBUTIONS = {"7": "jazzy", "9": "kilted"}  # of ROS 2, by the first number of rclpy's version
REQUIRED = ("numpy", "numba", "llvmlite", "scipy", "PyYAML", "mcap", "zstandard",
            "rosbags")  # fmt: skip
OPTIONAL = {"rerun-sdk": "viz", "matplotlib": "plot", "pyarrow": "plot", "dask": "study"}


def version_of(package: str) -> str:
    """Return the version of an installed package, or ""."""
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return ""


def ros_distribution() -> str:
    """Return the ROS distribution: that of the sourced installation, else of the wheels, or ""."""
    sourced = os.environ.get("ROS_DISTRO", "")
    return sourced or DISTRIBUTIONS.get(version_of("rclpy").partition(".")[0], "")


def load_middleware() -> Any:
    """Return the module that knows the middleware, which loads rclpy."""
    return importlib.import_module("rope_twin.ros.middleware")


def version_text() -> str:
    """Return the lines of `rope_twin --version`."""
    packages = ", ".join(
        f"{name} {version_of(name) or 'missing'}" for name in ("numba", "llvmlite")
    )
    return "\n".join(
        (
            f"rope_twin {version_of('rope_twin') or '(not installed)'}, solver {SOLVER_VERSION}",
            f"Python {platform.python_version()}, {packages}",
            _ros_line(),
        )
    )


def _ros_line() -> str:
    try:
        rmw = load_middleware().rmw_name()
    except Exception as error:  # an installation may fail in any way, and this line reports it
        return f"rclpy cannot be loaded ({type(error).__name__}: {error})"
    rclpy = version_of("rclpy") or "(of the sourced installation)"
    return f"rclpy {rclpy}, ROS 2 {ros_distribution() or '(unknown distribution)'}, {rmw}"


OK, WARN, ERROR = "OK", "WARN", "ERROR"
OLDEST_PYTHON = (3, 11)
RESOLUTION_S = 1e-6  # of the monotonic clock: a cycle is 20 ms
TIMEOUT_S = 5.0  # for the round trip
LATENCY_S = 5e-3  # of a message on this machine, of a cycle of 20 ms
CORES = 2  # the solver's thread, and the rest of the process
SPACE_WARN_B, SPACE_ERROR_B = 2e9, 1e8
GOVERNORS = "/sys/devices/system/cpu/cpu[0-9]*/cpufreq/scaling_governor"
TIME_ERROR = 5  # of adjtimex(2): the clock is not synchronised
DOCTOR_EXAMPLES = ("doctor", "doctor --json")
DOCTOR_MORE = """\
Checks Python and its packages, discovery, a DDS round trip, graphics for the viewer,
clocks, CPU, compile cache and disk space. Exit code 3 if a check is ERROR."""


@dataclass(frozen=True)
class Check:
    """Result of one check; `remedy` is empty where nothing is to be done."""

    name: str
    level: str
    found: str
    remedy: str = ""


def _check(name: str, good: bool, finding: str, remedy: str, level: str = WARN) -> Check:
    return Check(name, OK, finding) if good else Check(name, level, finding, remedy)


def _add_doctor(parser: argparse.ArgumentParser) -> None:
    add_json(parser)


def _run_doctor(args: argparse.Namespace) -> int:
    """Run all checks and print them; NEGATIVE if one is ERROR."""
    checks = list(check_all())
    failed = any(check.level == ERROR for check in checks)
    if args.json:
        print_json({"ok": not failed, "checks": [asdict(check) for check in checks]})
    else:
        for check in checks:
            print(f"{check.level:5}  {check.name:14}  {check.found}")
            if check.remedy:
                print(f"{'':23}remedy: {check.remedy}")
    return ExitCode.NEGATIVE if failed else ExitCode.OK


def check_all() -> Iterator[Check]:
    """Yield the result of each check."""
    yield check_python()
    yield check_packages()
    yield check_discovery()
    yield check_middleware(load_middleware)
    yield from check_viewer()
    yield check_monotonic_clock()
    yield check_synchronisation()
    yield check_cores()
    yield check_governor()
    yield check_cache()
    yield check_space(Path.cwd())


def check_python() -> Check:
    """Check the version of Python."""
    finding = f"{platform.python_version()} ({sys.executable})"
    new = sys.version_info[:2] >= OLDEST_PYTHON
    return _check("Python", new, finding, "install Python 3.11 or newer", ERROR)


def check_packages() -> Check:
    """Check that the required packages are installed, and report the optional ones."""
    versions = {name: version_of(name) for name in (*REQUIRED, *OPTIONAL)}
    finding = ", ".join(f"{name} {version or 'missing'}" for name, version in versions.items())
    if missing := [name for name in REQUIRED if not versions[name]]:
        return Check("packages", ERROR, finding, f"pip install {' '.join(missing)}")
    extras = sorted({extra for name, extra in OPTIONAL.items() if not versions[name]})
    remedy = f"for the optional ones: pip install 'rope_twin[{','.join(extras)}]'"
    return Check("packages", WARN, finding, remedy) if extras else Check("packages", OK, finding)


def check_middleware(load: Callable[[], Any]) -> Check:
    """Check that rclpy and an RMW implementation load, and send a message through DDS."""
    try:
        ros = load()
        name = f"ROS 2 {ros_distribution() or '(unknown distribution)'}, {ros.rmw_name()}"
    except Exception as error:  # an installation may fail in any way, and this check reports it
        remedy = "source a ROS 2 installation, or install the wheels: pip install rope_twin"
        return Check("ROS", ERROR, f"rclpy: {type(error).__name__}: {error}", remedy)
    try:
        trip = ros.round_trip(TIMEOUT_S)
    except RopeTwinError as error:
        finding, _, remedy = str(error).rpartition("; ")
        return Check("ROS", ERROR, f"{name}: {finding}", remedy.rstrip("."))
    finding = f"{name}: discovery {trip.discovery_s:.2g} s, message {1e3 * trip.latency_s:.2g} ms"
    remedy = "close programs that use the CPU, and check the governor"
    return _check("ROS", trip.latency_s <= LATENCY_S, finding, remedy)


def check_discovery() -> Check:
    """Report which machines nodes of a run reach."""
    discovery_range = os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "")
    domain = f"ROS_DOMAIN_ID {os.environ.get('ROS_DOMAIN_ID', '0')}"
    if discovery_range in ("", "SYSTEM_DEFAULT"):
        return Check("discovery", OK, f"this machine only, unless run --network; {domain}")
    finding = f"ROS_AUTOMATIC_DISCOVERY_RANGE={discovery_range}; {domain}"
    if discovery_range == "OFF":
        return Check("discovery", ERROR, finding, "unset it, or set LOCALHOST or SUBNET")
    if discovery_range == "SUBNET":
        remedy = "unset it unless other machines take part: they can command the winch"
        return Check("discovery", WARN, finding, remedy)
    return Check("discovery", OK, finding)


def check_viewer() -> Iterator[Check]:
    """Check for what the viewer needs; nothing else needs it."""
    from rope_twin.view import sinks

    try:
        sinks.load_rerun()
    except InputError as error:
        finding, _, remedy = str(error).partition("; ")
        yield Check("viewer", WARN, finding, remedy.rstrip("."))
        return
    for name, missing in (
        ("viewer window", sinks.what_a_window_lacks()),
        ("viewer picture", sinks.what_a_picture_lacks()),
    ):
        finding, _, remedy = missing.removeprefix("view: ").partition("; ")
        level = WARN if missing else OK
        yield Check(name, level, finding or "can be drawn", remedy.rstrip("."))


def check_monotonic_clock() -> Check:
    """Check the resolution of the clock that paces a run."""
    clock = time.get_clock_info("monotonic")
    finding = f"{clock.implementation}, resolution {clock.resolution:g} s"
    fine, remedy = clock.resolution <= RESOLUTION_S, "use a kernel with high-resolution timers"
    return _check("steady clock", fine, finding, remedy, ERROR)


def check_synchronisation() -> Check:
    """Check whether the kernel's clock is synchronised, which stamps of other machines need."""
    try:
        state = ctypes.CDLL(None, use_errno=True).adjtimex(ctypes.create_string_buffer(1024))
    except (OSError, AttributeError):
        state = -1
    if state < 0:
        return Check("system clock", WARN, "its synchronisation cannot be read", "check chronyc")
    if state == TIME_ERROR:
        remedy = "start chrony or systemd-timesyncd if sensors or nodes run on other machines"
        return Check("system clock", WARN, "not synchronised (NTP)", remedy)
    return Check("system clock", OK, "synchronised (NTP)")


def check_cores() -> Check:
    """Check how many cores this process may use."""
    count = len(os.sched_getaffinity(0))
    finding = f"{count} of {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}"
    remedy = f"allow at least {CORES}: other threads delay the solver"
    return _check("CPU cores", count >= CORES, finding, remedy)


def check_governor() -> Check:
    """Check the CPU frequency governor."""
    files = Path("/").glob(GOVERNORS.removeprefix("/"))
    names = sorted({file.read_text(encoding="ascii").strip() for file in files})
    if not names:
        return Check("CPU governor", OK, "none (frequency is set by firmware or host)")
    remedy = "cpupower frequency-set --governor performance"
    return _check("CPU governor", names == ["performance"], ", ".join(names), remedy)


def check_cache() -> Check:
    """Check the folder of compiled kernels: path, owner, mode and size."""
    home = os.environ.get("ROPE_TWIN_CACHE") or os.environ.get("XDG_CACHE_HOME")
    folder = Path(home or Path.home() / ".cache") / "rope_twin"
    if not folder.exists():
        above = next(parent for parent in folder.parents if parent.exists())
        free = os.access(above, os.W_OK)
        finding = f"{folder}, created by the first run" if free else f"{above} is not writable"
        return _check("compile cache", free, finding, _CACHE_REMEDY)
    about = folder.stat()
    files = [file.stat().st_size for file in folder.rglob("*") if file.is_file()]
    finding = (
        f"{folder}, owner {about.st_uid}, mode {stat.S_IMODE(about.st_mode):04o}, "
        f"{1e-6 * sum(files):.0f} MB in {len(files)} files"
    )
    private = about.st_uid == os.geteuid() and not about.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    if private and os.access(folder, os.W_OK):
        return Check("compile cache", OK, finding)
    return Check("compile cache", WARN, f"{finding}: not this user's alone", _CACHE_REMEDY)


_CACHE_REMEDY = "name a private folder in ROPE_TWIN_CACHE; else every start compiles again"


def check_space(folder: Path) -> Check:
    """Check the free disk space for recordings."""
    free = shutil.disk_usage(folder).free
    finding = f"{1e-9 * free:.1f} GB free in {folder}"
    level = WARN if free >= SPACE_ERROR_B else ERROR
    remedy = "free space, or record elsewhere with --out"
    return _check("disk", free >= SPACE_WARN_B, finding, remedy, level)


COMPLETION_EXAMPLES = (
    "completion bash > ~/.local/share/bash-completion/completions/rope_twin",
    "completion zsh > ~/.zsh/completions/_rope_twin",
    "completion fish > ~/.config/fish/completions/rope_twin.fish",
)
COMPLETION_MORE = """\
Completes commands, options, their choices and the names of the shipped scenes. Print the
script again after an update."""


class Completion(NamedTuple):
    """One command or action, such as ("scene", "check"), with the words that may follow it."""

    path: tuple[str, ...]
    about: str
    options: tuple[argparse.Action, ...]
    words: tuple[str, ...]  # actions, scenes and other choices


def _add_completion(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("shell", metavar="SHELL", choices=tuple(SCRIPTS), help=", ".join(SCRIPTS))
    add_json(parser)


def _run_completion(args: argparse.Namespace) -> int:
    """Print the script for one shell."""
    script = SCRIPTS[args.shell](list(_commands(build_parser(), (), "")))
    if args.json:
        print_json({"shell": args.shell, "script": script})
    else:
        print(script)
    return ExitCode.OK


def _commands(
    parser: argparse.ArgumentParser, path: tuple[str, ...], about: str
) -> Iterator[Completion]:
    """Yield the commands of a parser, itself first."""
    from rope_twin.scene.load import scene_names

    options = tuple(action for action in parser._actions if action.option_strings)
    words: list[str] = []
    nested: list[Completion] = []
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            abouts = {choice.dest: choice.help or "" for choice in action._choices_actions}
            for name, child in action.choices.items():
                nested += _commands(child, (*path, name), abouts[name])
        if action.option_strings:
            continue
        words += [str(value) for value in action.choices or ()]
        words += scene_names() if action.dest == "scene" else []
    yield Completion(path, about, options, tuple(words))
    yield from nested


def _bash(commands: list[Completion]) -> str:
    cases = []
    for command in commands:
        names = [name for option in command.options for name in option.option_strings]
        cases.append(
            f'        "{" ".join(command.path)}") words="{" ".join([*command.words, *names])}" ;;'
        )
        for option in command.options:
            if option.nargs != 0:  # it takes a value: one of its choices, or perhaps a file
                key = " ".join((*command.path, option.option_strings[-1]))
                choices = " ".join(str(choice) for choice in option.choices or ())
                cases.append(f'        "{key}") words="{choices}" ;;')
    actions = {command.path[0] for command in commands if len(command.path) == 2}
    return "\n".join(
        (
            "# completion of rope_twin for bash",
            "_rope_twin() {",
            '    local key="" words="" previous="${COMP_WORDS[COMP_CWORD-1]}"',
            '    [ "$COMP_CWORD" -gt 1 ] && key="${COMP_WORDS[1]}"',
            f'    case "$key" in {"|".join(sorted(actions))})',
            '        [ "$COMP_CWORD" -gt 2 ] && key="$key ${COMP_WORDS[2]}" ;;',
            "    esac",
            "    _rope_twin_words",
            '    case "$previous" in --*)',
            '        key="$key $previous"',
            "        _rope_twin_words ;;",
            "    esac",
            '    COMPREPLY=($(compgen -W "$words" -- "${COMP_WORDS[COMP_CWORD]}"))',
            "}",
            "_rope_twin_words() {",
            '    case "$key" in',
            *cases,
            "    esac",
            "}",
            "complete -o default -F _rope_twin rope_twin",
        )
    )


def _zsh(commands: list[Completion]) -> str:
    """Return the script for bash, which zsh runs by its own emulation."""
    return f"#compdef rope_twin\nautoload -U +X bashcompinit && bashcompinit\n{_bash(commands)}"


def _fish(commands: list[Completion]) -> str:
    lines = ["# completion of rope_twin for fish"]
    for command in commands:
        conditions = [f"__fish_seen_subcommand_from {word}" for word in command.path]
        condition = "; and ".join(conditions) or "__fish_use_subcommand"
        nested = [
            subcommand
            for subcommand in commands
            if subcommand.path[:-1] == command.path and subcommand.path
        ]
        names = " ".join(subcommand.path[-1] for subcommand in nested)
        first = (
            f"{condition}; and not __fish_seen_subcommand_from {names}" if conditions else condition
        )
        for subcommand in nested:
            about = _quoted(subcommand.about)
            lines.append(f"complete -c rope_twin -n '{first}' -fa {subcommand.path[-1]} -d {about}")
        if command.words and not nested:
            lines.append(
                f"complete -c rope_twin -n '{condition}' -a {_quoted(' '.join(command.words))}"
            )
        lines += [
            f"complete -c rope_twin -n '{condition}' {_fish_option(option)}"
            for option in command.options
        ]
    return "\n".join(lines)


def _fish_option(option: argparse.Action) -> str:
    names = " ".join(
        f"-l {name[2:]}" if name.startswith("--") else f"-s {name[1:]}"
        for name in option.option_strings
    )
    value = "" if option.nargs == 0 else " -r"
    if option.choices:
        value += f" -fa {_quoted(' '.join(str(choice) for choice in option.choices))}"
    about = (option.help or "").replace("%%", "%").partition(" (default: %(")[0]
    return f"{names}{value} -d {_quoted(about)}"


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace("'", "\\'")
    return f"'{escaped}'"


SCRIPTS = {"bash": _bash, "zsh": _zsh, "fish": _fish}


COMMANDS = {
    "doctor": Command(_add_doctor, _run_doctor, DOCTOR_EXAMPLES, DOCTOR_MORE),
    "completion": Command(_add_completion, _run_completion, COMPLETION_EXAMPLES, COMPLETION_MORE),
}
