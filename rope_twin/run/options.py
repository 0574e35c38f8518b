"""The options of `rope_twin run`, checked."""

from __future__ import annotations

import argparse
import math
import os
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from rope_twin.errors import InputError, phrase
from rope_twin.twin.cutting.cut_plan import read_plan
from rope_twin.twin.fatigue.curves import CURVES
from rope_twin.twin.saving.state_file import check_place
from rope_twin.twin.vibration.settings import MODELS, MonitorSettings
from rope_twin.view.sinks import has_screen

if TYPE_CHECKING:
    from rope_twin.scene.schema import Scene
    from rope_twin.twin.saving.saved_state import StateDescription

STEP_TOL = 1e-6  # of a step: what an end may be off a whole number of them
SPEED_LOW, SPEED_HIGH = 0.01, 5.0  # beyond, messages come faster than Python takes them


@dataclass(frozen=True, kw_only=True)
class RunOptions:
    """What to run, for how long, and what to keep of it."""

    scene: str = "deep_lift"
    for_s: float | None = None  # twin time; None: until told to stop
    speed: float = 1.0  # twin time over real time; 0: as fast as possible, without ROS
    headless: bool = False
    bag: str = ""  # heave to replay; empty: the scene's own
    topic: str = ""
    bag_start_s: float = 0.0
    poses: str = ""  # bag of the ship's poses to replay in their place
    record: Path | None = None  # bag directory to make; None: do not record
    json: bool = False
    processes: bool = False
    save: Path | None = None  # file that the state is saved to
    start_from: Path | None = None  # saved state to go on from; None: from rest
    begins_s: float = 0.0  # its twin time
    energy: bool = False  # keep the energy balance
    elements: int | None = None  # in place of the scene's; None: the scene's
    step_s: float | None = None  # likewise
    chosen: str = ""  # why these, in one sentence
    budget_pct: float | None = None  # of one core, if --budget asked
    calibrated_pct: float | None = None  # what of it was measured for them, before the run
    cut: str = ""  # cut the rope: PLACE@SECONDS, judged; empty: never
    error_band: bool = False  # keep a band around the top tension
    allow_cut: bool = False  # whoever publishes on rope/cut cuts the rope
    network: bool = False  # reachable from other machines
    watch: MonitorSettings | None = None  # vibration and fatigue to be kept
    allow_overload: bool = False  # a limit that is broken leaves the exit code at 0

    @property
    def failure_folder(self) -> Path:
        """Takes the state that the solver cannot leave: beside what the run leaves anyway."""
        made = self.record or self.save
        return Path.cwd() if made is None else made.parent

    @property
    def other_sea(self) -> bool:
        """Whether the ship moves otherwise than in the scene: the run is not its card's."""
        return bool(self.bag or self.poses or self.topic or self.bag_start_s)

    @property
    def screen(self) -> bool:
        """Whether a window can be opened (and is wanted)."""
        return has_screen() and not self.headless

    @property
    def view_file(self) -> Path | None:
        """The .rrd file that takes the place of the window: beside the bag."""
        if self.screen or self.record is None:
            return None
        return self.record.with_name(self.record.name + ".rrd")

    @property
    def view(self) -> str | None:
        """Where the run is shown: 'window', a file, or None."""
        return "window" if self.screen else str(self.view_file) if self.view_file else None


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options, in groups as the help shows them."""
    _add_run(parser)
    _add_motion(parser.add_argument_group("what moves the ship"))
    _add_kept(parser.add_argument_group("what is kept"))
    _add_accuracy(parser.add_argument_group("accuracy"))
    _add_watched(parser.add_argument_group("on the way"))


def _add_run(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add(
        "scene",
        nargs="?",
        metavar="SCENE",
        help="name of a scene (see `rope_twin scene list`) or path of one "
        "(default: that of --from, or deep_lift)",
    )
    add("--for", dest="for_s", type=float, metavar="SECONDS",
        help="end at this twin time (default: run until Ctrl-C)")  # fmt: skip
    add(
        "--speed",
        type=float,
        default=1.0,
        metavar="X",
        help="twin time over real time; 0: as fast as possible, without ROS (default: 1)",
    )
    add("--headless", action="store_true", help="open no window, even where there is a screen")
    add("--processes", action="store_true", help="each node as a process of its own")
    add("--network", action="store_true",
        help="let other machines take part: without it the nodes keep to the loopback interface "
        "(unless ROS_AUTOMATIC_DISCOVERY_RANGE is set)")  # fmt: skip
    add(
        "--allow-overload",
        action="store_true",
        help="end with exit code 0 although a limit of the scene was broken (default: 4)",
    )
    add("--json", action="store_true", help="last line of the output: one JSON object")


def _add_motion(group: argparse._ArgumentGroup) -> None:
    add = group.add_argument
    add(
        "--bag",
        default="",
        metavar="DIR",
        help="recorded heave to replay: a name in bags/ or a path (default: the scene's)",
    )
    add(
        "--poses",
        default="",
        metavar="DIR",
        help="recorded poses of the ship to replay in its place: a name in bags/ or a path",
    )
    add("--topic", default="", metavar="NAME", help="topic of heave or poses in that bag")
    add("--bag-start", dest="bag_start_s", type=float, default=0.0, metavar="SECONDS",
        help="start this far into that bag")  # fmt: skip


def _add_kept(group: argparse._ArgumentGroup) -> None:
    record = group.add_mutually_exclusive_group()
    record.add_argument(
        "--record",
        type=Path,
        metavar="DIR",
        help="bag directory to make (default: recordings/SCENE_DATE_TIME)",
    )
    record.add_argument("--no-record", action="store_true", help="record nothing")
    add = group.add_argument
    add("--save", type=Path, metavar="FILE",
        help="save the state there at the end, and every 10 s if the run is paced")  # fmt: skip
    add("--from", dest="start_from", type=Path, metavar="FILE",
        help="go on from a saved state (default: begin at rest)")  # fmt: skip


def _add_accuracy(group: argparse._ArgumentGroup) -> None:
    bought = group.add_mutually_exclusive_group()
    bought.add_argument(
        "--within",
        metavar="ERROR",
        help="take the cheapest elements and step that keep the error within this, like 1%%, by "
        "the scene's accuracy card",
    )
    bought.add_argument(
        "--budget",
        metavar="SHARE",
        help="take the most accurate ones that this share of one core is enough for, like 30%%",
    )
    add = group.add_argument
    add("--of", metavar="QUANTITY", help="the quantity whose error that is (default: tension_rms)")
    add(
        "--error-band",
        action="store_true",
        help="keep a band around the top tension in which the converged one lies (half as much "
        "work again)",
    )


def _add_watched(group: argparse._ArgumentGroup) -> None:
    add = group.add_argument
    add(
        "--energy",
        action="store_true",
        help="keep the energy balance and tell its residual (steps one by one, slower)",
    )
    add("--vibration", default="", metavar="MODEL",
        help=f"keep how the rope shakes over depth, by one of {', '.join(MODELS)}")  # fmt: skip
    add(
        "--fatigue",
        default="",
        metavar="CURVE",
        help="keep the fatigue used of each metre of the rope's material, by an S-N curve: "
        + ", ".join(CURVES),
    )
    add(
        "--cut",
        default="",
        metavar="PLACE@SECONDS",
        help="cut the rope so many metres below the hang-off, or at its lower end (end), at this "
        "twin time; both parts go on; where ropes meet NAME:PLACE@SECONDS cuts one of them",
    )
    add("--allow-cut", action="store_true",
        help="listen to rope/cut: who publishes there cuts it (--cut implies this)")  # fmt: skip


def read_options(args: argparse.Namespace) -> RunOptions:
    """The options of a command line.

    Raises:
        InputError: one sentence for a value that cannot be.
        StateError: the same for the file of --save or --from.
    """
    _check("--for", args.for_s, args.for_s is None or 0.0 < args.for_s <= 1e7,
           "it must be a time above 0 s, at most 1e7 s")  # fmt: skip
    _check("--speed", args.speed, args.speed == 0.0 or SPEED_LOW <= args.speed <= SPEED_HIGH,
           f"it must be 0 (as fast as possible) or {SPEED_LOW:g} to {SPEED_HIGH:g}")  # fmt: skip
    _check("--bag-start", args.bag_start_s, 0.0 <= args.bag_start_s < math.inf,
           "it must be a time of at least 0 s")  # fmt: skip
    if args.speed == 0.0 and args.for_s is None:
        raise InputError(phrase("--speed 0", "it would never end", "say --for SECONDS too"))
    if args.speed == 0.0 and args.processes:
        raise InputError(phrase("--processes", "--speed 0 runs without ROS", "leave one out"))
    if args.save is not None:
        check_place(args.save, f"--save {args.save}")
    begin = None if args.start_from is None else _begin(args)
    _judge_cut(args, begin.time_s if begin else 0.0)
    args.scene = _scene_argument(args.scene or (_scene_of(begin) if begin else "deep_lift"))
    return RunOptions(
        scene=args.scene,
        for_s=args.for_s,
        speed=args.speed,
        headless=args.headless,
        bag=args.bag,
        topic=args.topic,
        poses=args.poses,
        bag_start_s=args.bag_start_s,
        record=_record_directory(args),
        json=args.json,
        processes=args.processes,
        save=args.save and Path(args.save).resolve(),
        start_from=args.start_from and Path(args.start_from).resolve(),
        begins_s=begin.time_s if begin else 0.0,
        energy=args.energy,
        error_band=args.error_band,
        cut=args.cut,
        allow_cut=args.allow_cut,
        network=args.network,
        watch=MonitorSettings(args.vibration, args.fatigue) or None,
        allow_overload=args.allow_overload,
    )


def check_against_scene(options: RunOptions, scene: Scene) -> str:
    """Return a sentence on when the run really ends, if not when it was asked to, or "".

    A run ends with the slot that reaches its last step, paced or not.

    Raises:
        InputError: the run would end before its first step, or there is no bag to start in.
    """
    from rope_twin.twin.pacing import steps_in_slot  # brings the compiler

    sea = scene.sea_state
    if options.bag_start_s > 0.0 and not (options.bag or options.poses or sea.bag or sea.poses):
        where = f"--bag-start {options.bag_start_s:g}"
        what = f"there is no bag to start in: scene {scene.name} has none, and none is named"
        raise InputError(phrase(where, what, "name one with --bag or --poses, or leave it out"))
    if options.for_s is None:
        return ""
    step_s, left_s = scene.time.step_s, options.for_s - options.begins_s
    where = f"--for {options.for_s:.15g}"
    if left_s < step_s * (1.0 - STEP_TOL):
        what = f"the run would be shorter than one step of {step_s:g} s"
        raise InputError(phrase(where, what, f"give at least {options.begins_s + step_s:.9g} s"))
    steps, together = round(left_s / step_s), steps_in_slot(step_s)
    end_s = options.begins_s + math.ceil(steps / together) * together * step_s
    if abs(end_s - options.for_s) <= STEP_TOL * step_s:
        return ""
    what = f"it is no whole number of steps of {step_s:g} s"
    if abs(steps * step_s - left_s) <= STEP_TOL * step_s:
        what = f"steps of {step_s:g} s are taken {together} at a time"
    return phrase(where, what, f"the run ends at {end_s:.9g} s")


def _judge_cut(args: argparse.Namespace, begins_s: float) -> None:
    """Refuse a cut that cannot be, or that the run does not come to. Raises InputError."""
    plan = read_plan(args.cut)
    if plan is None:
        return
    at_s = plan.at_ns * 1e-9
    if at_s < begins_s or (args.for_s is not None and at_s >= args.for_s):
        end = "" if args.for_s is None else f" to {args.for_s:g} s"
        what = f"the run goes from {begins_s:g} s{end or ' on'}"
        raise InputError(phrase(f"--cut {args.cut}", what, "cut within it"))


def _check(option: str, value: object, holds: bool, right: str) -> None:
    if not holds:
        raise InputError(phrase(option, f"{value} is not possible", right))


def _begin(args: argparse.Namespace) -> StateDescription:
    """What --from holds.

    Raises:
        StateError: it is no sound state.
        InputError: the run would end before it begins.
    """
    from rope_twin.twin.saving.saved_state import load_state

    about = load_state(args.start_from).about
    if args.for_s is not None and args.for_s <= about.time_s:
        what = f"the saved state is at {about.time_s:g} s already"
        raise InputError(phrase(f"--for {args.for_s:g}", what, "give a later end, or none"))
    return about


def _scene_of(about: StateDescription) -> str:
    """The scene of a saved state: its path if that is still there, else its name.

    Raises:
        InputError: neither is there.
    """
    from rope_twin.scene.load import scene_names

    if Path(about.scene_path).is_file():
        return about.scene_path
    if about.scene not in scene_names():
        what = f"its scene {about.scene_path} is no longer there"
        raise InputError(phrase("--from", what, "name the scene's file, too"))
    return about.scene


def _scene_argument(scene: str) -> str:
    """Paths are made absolute, since other processes may run elsewhere; names stay."""
    return str(Path(scene).resolve()) if Path(scene).suffix or os.sep in scene else scene


def _record_directory(args: argparse.Namespace) -> Path | None:
    if args.no_record:
        return None
    if args.record is not None:
        return Path(args.record).resolve()
    stem = Path(args.scene).stem
    return Path("recordings").resolve() / f"{stem}_{time.strftime('%Y%m%d_%H%M%S')}"
