"""Options of `rope_twin run`, checked, and those that several commands share."""

from __future__ import annotations

import argparse
import errno
import hashlib
import math
import os
import socket
import time
from dataclasses import dataclass, fields
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rope_twin.errors import InputError, phrase
from rope_twin.quantity import read_quantity
from rope_twin.twin.state_file import check_place
from rope_twin.view.sinks import has_rerun, has_screen
from rope_twin.vortex.fatigue import CURVES, OWN
from rope_twin.vortex.results import MonitorSettings

if TYPE_CHECKING:
    from rope_twin.scene.schema import Scene
    from rope_twin.twin.monitors import Monitors
    from rope_twin.twin.state import StateDescription
import textwrap
from collections.abc import Callable, Iterable, Sequence

STEP_TOL = 1e-6  # of a step: what an end may be off a whole number of them
CONSOLE = "127.0.0.1:8420"  # address of the operator console
SPEED_LOW, SPEED_HIGH = 0.01, 5.0  # beyond, messages come faster than Python takes them


@dataclass(frozen=True, kw_only=True)
class RunOptions:
    """Scene, inputs, outputs and analysis options of a run."""

    scene: str = "deep_lift"
    end_s: float | None = None  # simulated time at the end; None: until stopped
    speed: float = 1.0  # simulated time over real time; 0: as fast as possible, without ROS
    headless: bool = False
    bag: str = ""  # heave to replay; empty: the scene's own
    topic: str = ""
    sea_offset_s: float = 0.0  # into that bag
    poses: str = ""  # bag of the vessel's poses to replay in their place
    measured: str = ""  # bag of measurements to compare with, in an unpaced run
    follow_measured: bool = False  # every winch follows its line out in that bag
    record: Path | None = None  # bag directory to create; None: do not record
    json: bool = False
    processes: bool = False
    save: Path | None = None  # file that the state is saved to
    start_from: Path | None = None  # saved state to resume from; None: static equilibrium
    begins_s: float = 0.0  # its simulated time
    energy: bool = False  # keep the energy balance
    elements: int | None = None  # in place of the scene's; None: the scene's
    step_s: float | None = None  # likewise
    chosen: str = ""  # why these, in one sentence
    budget_pct: float | None = None  # of one core, if --budget asked
    calibrated_pct: float | None = None  # share of it measured before the run
    cut: str = ""  # PLACE@SECONDS, checked; empty: no cut
    error_interval: bool = False  # discretisation-error interval on top tension
    ahead: bool = False  # forecast the next minute, every second
    allow_cut: bool = False  # any publisher on ropes/cut can cut the rope
    network: bool = False  # reachable from other machines
    watch: MonitorSettings | None = None  # vibration and fatigue to report
    learn: bool = False  # learn the lift from its measured tension
    apply_learned: bool = False  # and apply the learned figures automatically
    allow_overload: bool = False  # exit code 0 even if a limit was exceeded
    console: str = ""  # HOST:PORT of the operator console; empty: none
    control: bool = False  # whether its pages may command winches, with the token

    @property
    def failure_folder(self) -> Path:
        """Return the folder for the state at which the solver failed: that of the outputs."""
        output = self.record or self.save
        return Path.cwd() if output is None else output.parent

    @property
    def monitors(self) -> Monitors:
        """Return the monitors of the run."""
        from rope_twin.twin.monitors import Monitors

        return Monitors(self.energy, self.error_interval, self.watch)

    @property
    def other_sea(self) -> bool:
        """Return whether the vessel motion differs from the scene's, and so from its study's."""
        return bool(self.bag or self.poses or self.topic or self.sea_offset_s)

    @property
    def screen(self) -> bool:
        """Return whether a viewer window is to be opened."""
        return has_screen() and not self.headless

    @property
    def view_file(self) -> Path | None:
        """Return the .rrd file beside the bag that replaces the window."""
        if self.screen or self.record is None:
            return None
        return self.record.with_name(self.record.name + ".rrd")

    @property
    def view(self) -> str | None:
        """Return where the run is shown: 'window', a file, or None."""
        return "window" if self.screen else str(self.view_file) if self.view_file else None

    @property
    def shown(self) -> str | None:
        """Return where the run was shown; None if the file of its view was not written."""
        written = self.screen or self.view_file is None or self.view_file.exists()
        return self.view if written else None

    @property
    def announcement(self) -> str:
        """Return the text on where the run is recorded and shown, printed before it starts."""
        sentences = [f"recording to {self.record}" if self.record else "not recording"]
        if self.view and not has_rerun():
            sentences.append("no view: rerun is missing, install it with pip install '.[viz]'")
        elif self.screen:
            sentences.append("showing in a rerun window")
        elif self.view_file:
            sentences.append(f"no window, view written to {self.view_file}")
        words = "; ".join(sentences) + "; stop with Ctrl-C"
        return f"{words}\nbuilding the twin (the first run compiles it, which takes a while)"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options, in groups as the help shows them."""
    _add_run(parser)
    _add_motion(parser.add_argument_group("vessel motion"))
    _add_measured(parser.add_argument_group("measured inputs"))
    _add_kept(parser.add_argument_group("recording and state"))
    _add_accuracy(parser.add_argument_group("accuracy"))
    _add_monitors(parser.add_argument_group("analysis options"))
    _add_network(parser.add_argument_group("processes and network"))


def _add_run(parser: argparse.ArgumentParser) -> None:
    words = f"{SCENE} (default: the scene of --from-state, or deep_lift)"
    add_scene(parser, nargs="?", help=words)
    words = "simulated time to run, counted from that of --from-state (default: until Ctrl-C)"
    add_duration(parser, words)
    add = parser.add_argument
    words = "simulated time over real time; 0: as fast as possible, without ROS (default: 1)"
    add("--speed", type=float, default=1.0, metavar="X", help=words)
    add("--headless", action="store_true", help="open no viewer window")
    words = "exit with code 0 even if a limit of the scene was exceeded (default: 4)"
    add("--allow-overload", action="store_true", help=words)
    add_json(parser)


def _add_motion(group: argparse._ArgumentGroup) -> None:
    add = group.add_argument
    words = "replay recorded heave: a name in bags/ or a path (default: the scene's motion)"
    add("--bag", default="", metavar="BAG", help=words)
    words = "replay recorded poses of the vessel: a name in bags/ or a path"
    add("--poses", default="", metavar="BAG", help=words)
    add("--topic", default="", metavar="NAME", help="topic of heave or poses in that bag")
    add_time(group, "--sea-offset", "start this far into the recording", 0.0)


def _add_measured(group: argparse._ArgumentGroup) -> None:
    add = group.add_argument
    add("--measured", default="", metavar="BAG", help="compare with the measurements of a "
        "recording, and report residuals; with --speed 0. t = 0 is that of --bag or --poses, else "
        "that of the run or first reading in BAG")  # fmt: skip
    add("--follow-measured", action="store_true",
        help="every winch follows its line out in there instead of its schedule")  # fmt: skip


def _add_kept(group: argparse._ArgumentGroup) -> None:
    record = group.add_mutually_exclusive_group()
    add_out(record, "DIR", "bag directory to create (default: recordings/SCENE_DATE_TIME)")
    record.add_argument("--no-record", action="store_true", help="do not record a bag")
    add = group.add_argument
    add("--save-state", type=Path, metavar="FILE",
        help="save the state at the end, and every 10 s in a real-time run")  # fmt: skip
    add("--from-state", type=Path, metavar="FILE",
        help="resume from a saved state (default: start from static equilibrium)")  # fmt: skip


def _add_accuracy(group: argparse._ArgumentGroup) -> None:
    target = group.add_mutually_exclusive_group()
    words = "use the cheapest mesh and time step that meet this error target, such as 1%%, by the "
    target.add_argument("--within", metavar="ERROR", help=f"{words}scene's convergence study")
    words = "use the most accurate mesh and time step within this share of one CPU core, such as "
    target.add_argument("--budget", metavar="SHARE", help=f"{words}30%%")
    add = group.add_argument
    add("--quantity", metavar="NAME", help="quantity whose error counts (default: tension_rms)")
    words = "publish a 95 %% discretisation-error interval on top tension (+50 %% CPU)"
    add("--error-interval", action="store_true", help=words)


def _add_monitors(group: argparse._ArgumentGroup) -> None:
    add = group.add_argument
    add("--ahead", action="store_true",
        help="forecast tension, risk and quiet windows of the next minute every second, on half a "
        "core or less")  # fmt: skip
    add(
        "--energy",
        action="store_true",
        help="keep the energy balance and report its residual (half a millisecond more a step)",
    )
    add("--vibration", default="", metavar="MODEL",
        help="publish the VIV response along the line: time-domain (the scene's own VIV model) or "
        "frequency-domain (natural modes that follow the line)")  # fmt: skip
    add("--fatigue", default="", metavar="CURVE", help="publish accumulated fatigue damage per "
        "metre of rope, and its bends over sheaves and drum, by an S-N curve: "
        f"{', '.join(CURVES)}, or {OWN} (the rope's, in the scene)")  # fmt: skip
    add("--learn", action="store_true",
        help="learn weight, mass, drag, stiffness from the tension on winch/measured")  # fmt: skip
    add("--apply-learned", action="store_true",
        help="with --learn: take the figures over after each minute")  # fmt: skip
    add("--cut", default="", metavar="[ROPE:]PLACE@TIME",
        help="cut the rope at this length below the hang-off, or at its lower end (end), at this "
        "simulated time; ROPE selects one of several")  # fmt: skip


def _add_network(group: argparse._ArgumentGroup) -> None:
    add = group.add_argument
    add("--processes", action="store_true", help="run each node as a process of its own")
    add("--network", action="store_true",
        help="allow discovery by other machines (default: this machine only, unless "
        "ROS_AUTOMATIC_DISCOVERY_RANGE is set)")  # fmt: skip
    add_console(group)
    add("--allow-cut", action="store_true",
        help="subscribe to ropes/cut: any publisher there can cut the rope")  # fmt: skip


def add_console(group: argparse._ArgumentGroup) -> None:
    """Declare the options of the operator console in a run."""
    add = group.add_argument
    add("--console", nargs="?", const=CONSOLE, default="", metavar="HOST:PORT",
        help=f"serve the operator console, a web page (default: {CONSOLE})")  # fmt: skip
    add("--control", action="store_true",
        help="let pages command the winch, with the token that is printed")  # fmt: skip


def read_options(args: argparse.Namespace) -> RunOptions:
    """Return the options of a command line.

    Raises:
        InputError: one sentence for an impossible value.
        StateError: the same for the file of --save-state or --from-state.
    """
    _check("--duration", args.duration, args.duration is None or 0.0 < args.duration <= 1e7,
           "it must be a time above 0 s, at most 1e7 s")  # fmt: skip
    _check("--speed", args.speed, args.speed == 0.0 or SPEED_LOW <= args.speed <= SPEED_HIGH,
           f"it must be 0 (as fast as possible) or {SPEED_LOW:g} to {SPEED_HIGH:g}")  # fmt: skip
    _check("--sea-offset", args.sea_offset, args.sea_offset >= 0.0,
           "it must be a time of at least 0 s")  # fmt: skip
    unpaced, no_ros = args.speed == 0.0, "--speed 0 runs without ROS"
    for is_wrong, option, problem, remedy in (
        (unpaced and args.duration is None, "--speed 0", "the run would never end",
         "give a --duration too"),
        (unpaced and args.processes, "--processes", no_ros, "leave one out"),
        (args.measured and not unpaced, "--measured", "a paced run takes it from topics",
         "give --speed 0 too, or play the bag with `ros2 bag play`"),
        (args.follow_measured and not args.measured, "--follow-measured", "nothing is measured",
         "name a recording with --measured, or set the node's parameter follow_measured"),
        (unpaced and args.console, "--console", no_ros, "leave one out"),
        (args.control and not args.console, "--control", "there is no console",
         "give --console too"),
        (unpaced and args.learn, "--learn", f"{no_ros}, so no measured tension comes in",
         "learn from a bag with `rope_twin learn`"),
        (args.apply_learned and not args.learn, "--apply-learned", "nothing is learned",
         "give --learn too"),
        (unpaced and args.ahead, "--ahead", no_ros, "forecast its bag: `rope_twin ahead BAG`"),
    ):  # fmt: skip
        if is_wrong:
            raise InputError(option, problem, remedy)
    if args.console:
        from rope_twin.console.server import read_address

        read_address(args.console)
    if args.save_state is not None:
        check_place(args.save_state, f"--save-state {args.save_state}")
    start = None
    if args.from_state is not None:
        from rope_twin.twin.state import load_state  # brings the compiler

        start = load_state(args.from_state).about
    begins_s = start.time_s if start else 0.0
    end_s = None if args.duration is None else begins_s + args.duration
    cut = _read_cut(args.cut, begins_s, end_s)
    scene = args.scene or (_scene_of(start) if start else "deep_lift")
    # a path as absolute, since other processes may run elsewhere
    args.scene = str(Path(scene).resolve()) if Path(scene).suffix or os.sep in scene else scene
    names = [field.name for field in fields(RunOptions) if field.name in args]
    parsed = {name: getattr(args, name) for name in names}
    derived: dict[str, Any] = {
        "end_s": end_s,
        "sea_offset_s": args.sea_offset,
        "record": _record_directory(args),
        "save": args.save_state and Path(args.save_state).resolve(),
        "start_from": args.from_state and Path(args.from_state).resolve(),
        "begins_s": begins_s,
        "cut": cut,
        "watch": MonitorSettings(args.vibration, args.fatigue) or None,
    }
    return RunOptions(**parsed | derived)


def check_against_scene(options: RunOptions, scene: Scene) -> str:
    """Return a sentence on the end of the run if it differs from the requested one, or "".

    A run ends with the slot that reaches its last step, paced or not.

    Raises:
        InputError: the run would end before its first step, or there is no bag to start in.
    """
    from rope_twin.twin.pacing import steps_in_slot  # brings the compiler

    sea = scene.sea_state
    if options.sea_offset_s > 0.0 and not (options.bag or options.poses or sea.bag or sea.poses):
        where = f"--sea-offset {options.sea_offset_s:g}"
        problem = f"there is no bag to start in: scene {scene.name} has none, and none is named"
        raise InputError(where, problem, "name one with --bag or --poses, or leave it out")
    if options.end_s is None:
        return ""
    step_s, left_s = scene.time.step_s, options.end_s - options.begins_s
    where = f"--duration {left_s:.9g}"
    if left_s < step_s * (1.0 - STEP_TOL):
        problem = f"the run would be shorter than one time step of {step_s:g} s"
        raise InputError(where, problem, f"give at least {step_s:.9g} s")
    steps, steps_per_slot = round(left_s / step_s), steps_in_slot(step_s)
    end_s = options.begins_s + math.ceil(steps / steps_per_slot) * steps_per_slot * step_s
    if abs(end_s - options.end_s) <= STEP_TOL * step_s:
        return ""
    problem = f"it is not a whole number of time steps of {step_s:g} s"
    if abs(steps * step_s - left_s) <= STEP_TOL * step_s:
        problem = f"time steps of {step_s:g} s are taken {steps_per_slot} at a time"
    return phrase(where, problem, f"the run ends at {end_s:.9g} s")


def _read_cut(words: str, begins_s: float, end_s: float | None) -> str:
    """Return a cut with place and time in SI units, as ROS parameters take it.

    Raises:
        InputError: the cut is impossible, or the run does not reach it.
    """
    from rope_twin.twin.cut_input import read_plan  # --help does not load the compiler

    words = _without_units(words)
    plan = read_plan(words)
    if plan is None:
        return ""
    at_s = plan.at_ns * 1e-9
    if at_s < begins_s or (end_s is not None and at_s >= end_s):
        end = "" if end_s is None else f" to {end_s:g} s"
        problem = f"the run goes from {begins_s:g} s{end or ' on'}"
        raise InputError(f"--cut {words}", problem, "cut within it")
    return words


def _without_units(cut: str) -> str:
    """Return `1500@120` for `1.5km@2min`; what has no `@` is left to `read_plan`.

    Raises:
        InputError: place or time is not a quantity.
    """
    start, colon, cut_point = cut.rpartition(":")
    if "@" not in cut_point:
        return cut
    values = cut_point.split("@", 1)
    for number, (word, unit) in enumerate(zip(values, ("m", "s"), strict=True)):
        if word.strip() == "end" and unit == "m":
            continue
        try:
            values[number] = f"{read_quantity(word, unit):.15g}"
        except ValueError as error:
            raise InputError(f"--cut {cut}: {error}.") from error
    return start + colon + "@".join(values)


def _check(option: str, value: object, is_valid: bool, remedy: str) -> None:
    if not is_valid:
        raise InputError(option, f"{value} is not possible", remedy)


def _scene_of(about: StateDescription) -> str:
    """Return the scene of a saved state: its path if that exists, else its name.

    Raises:
        InputError: neither is there.
    """
    from rope_twin.scene.load import scene_names

    if Path(about.scene_path).is_file():
        return about.scene_path
    if about.scene not in scene_names():
        problem = f"its scene {about.scene_path} does not exist"
        raise InputError("--from-state", problem, "give the path of the scene too")
    return about.scene


def _record_directory(args: argparse.Namespace) -> Path | None:
    if args.no_record:
        return None
    if args.out is not None:
        return Path(args.out).resolve()
    stem = f"{Path(args.scene).stem}_{time.strftime('%Y%m%d_%H%M%S')}"
    folder = Path("recordings").resolve()
    names = (folder / (stem if number == 1 else f"{stem}_{number}") for number in count(1))
    return next(path for path in names if _is_free(path))


def _is_free(path: Path) -> bool:
    """Return whether no bag or view has this path, and claim it for this process.

    Two runs may begin in the same second, long before either makes its bag: an abstract socket of
    this name is the claim, and it is gone with its process.
    """
    if path.exists() or path.with_name(path.name + ".rrd").exists():
        return False
    digest = hashlib.sha256(os.fsencode(path)).hexdigest()[:32]  # such a name has 107 bytes at most
    claim = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    try:
        claim.bind(f"\0rope_twin/recording/{digest}")
    except OSError as error:  # a system without abstract sockets has no claims either
        claim.close()
        return error.errno != errno.EADDRINUSE
    _claims.append(claim)
    return True


_claims: list[socket.socket] = []  # held until the process ends


Parsers = Any  # argparse._SubParsersAction: generic only in the type checker's eyes
SCENE = "name of a scene (see `rope_twin scene list`) or path of a scene file"


class HelpFormatter(argparse.HelpFormatter):
    """Paragraphs are wrapped; an indented line, such as an example, stays as it is."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        blocks = []
        for paragraph in text.split("\n\n"):
            lines = paragraph.splitlines()
            if not any(line.startswith("  ") for line in lines):
                lines = textwrap.wrap(" ".join(lines), width)
            blocks.append("\n".join(indent + line for line in lines))
        return "\n\n".join(blocks)


def add_command(
    parsers: Parsers, name: str, about: str, examples: Sequence[str], more: str = ""
) -> argparse.ArgumentParser:
    """Add a command; `about` is its line in the list of commands and begins its own help.

    examples: command lines without `rope_twin`; more: the rest of the description.
    """
    title = about[0].upper() + about[1:]
    parser: argparse.ArgumentParser = parsers.add_parser(
        name,
        help=about,
        description=f"{title}.\n\n{more}" if more else f"{title}.",
        epilog="examples:\n" + "\n".join(f"  rope_twin {line}" for line in examples),
        formatter_class=HelpFormatter,
    )
    return parser


def measure(unit: str) -> Callable[[str], float]:
    """Return the type of an option whose value is a quantity, such as 90s, 2min or 120."""

    def read(words: str) -> float:
        try:
            return read_quantity(words, unit)
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from error

    return read


def add_scene(parser: argparse._ActionsContainer, **more: Any) -> None:
    """Declare the scene."""
    parser.add_argument("scene", metavar="SCENE", **{"help": SCENE, **more})


def add_duration(
    parser: argparse._ActionsContainer, about: str, default: float | None = None
) -> None:
    """Declare how much time is simulated."""
    add_time(parser, "--duration", about, default)


def add_time(
    parser: argparse._ActionsContainer, option: str, about: str, default: float | None = None
) -> None:
    """Declare an option whose value is a time; it is stored in seconds."""
    words = about if default is None else f"{about} (default: {default:g}s)"
    parser.add_argument(option, type=measure("s"), default=default, metavar="TIME", help=words)


def add_out(parser: argparse._ActionsContainer, metavar: str, about: str, **more: Any) -> None:
    """Declare the file or folder that the command writes."""
    parser.add_argument("--out", type=Path, metavar=metavar, help=about, **more)


def add_json(parser: argparse._ActionsContainer) -> None:
    """Declare the output for programs."""
    words = "print one JSON object on stdout in place of text"
    parser.add_argument("--json", action="store_true", help=words)


def leaf_parsers(parser: argparse.ArgumentParser) -> Iterable[argparse.ArgumentParser]:
    """Yield the parsers of all commands that can be run, depth first."""
    nested = [one for one in parser._actions if isinstance(one, argparse._SubParsersAction)]
    if not nested:
        yield parser
    for action in nested:
        for child in action.choices.values():
            yield from leaf_parsers(child)
