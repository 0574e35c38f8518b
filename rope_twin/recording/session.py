"""Description of a run in its bag, sufficient to build the twin again on any machine.

A message of twin/session is one JSON object, written at each start and after each pause: scene
files with their text, parameters, program, machine, seeds, the number of messages published before
on each topic, and the state of a twin that does not start from static equilibrium.

A message of twin/inputs, the log of applied inputs, is one JSON object too. `run` and `session`
identify its twin/session, `number` counts the messages of a session from 1. Either `calls` were
made at `time_ns`, or the snapshots after `skipped_ns[0]` and before `skipped_ns[1]` were computed
and not published.
"""

from __future__ import annotations

import base64
import dataclasses
import functools
import hashlib
import importlib.metadata
import json
import math
import os
import platform
import shutil
import subprocess
import weakref
import zlib
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import mkdtemp
from typing import Any, NamedTuple

from rope_twin import __version__
from rope_twin.core.jit.decorators import source_digest
from rope_twin.errors import BagError, InputError, RopeTwinError, StateError
from rope_twin.files import share_dir
from rope_twin.messages import decode
from rope_twin.messages.cdr import encode_text
from rope_twin.recording.motion_source import open_sea
from rope_twin.scene.convergence import OTHER_SEA, study_path
from rope_twin.scene.error_bound import AccuracyLevel
from rope_twin.scene.load import at_setting, following_measured, load_scene
from rope_twin.scene.schema import Scene
from rope_twin.sea.rao_files import RESPONSES_FOLDER
from rope_twin.sea.ship_motion import MOTIONS_FOLDER
from rope_twin.sea.tables import find_table
from rope_twin.topics import INPUT_LOG_TOPIC, SESSION_TOPIC, slot_of
from rope_twin.twin.health import SENDER_LEAD_S
from rope_twin.twin.input_queue import Call, LogEntry, calls_of, plain_calls
from rope_twin.twin.monitors import Monitors
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.state import SavedState, decode_state, load_state, scene_properties
from rope_twin.twin.twin import Twin
from rope_twin.vortex.results import MonitorSettings

FORMAT = 3
_SHARED = "share/"  # before names of files that come with the package
_BINARY = "data:application/octet-stream;base64,"  # before the content of a file that is no text
_PACKAGE = Path(__file__).resolve().parents[1]
_CPUINFO = Path("/proc/cpuinfo")


def encode_json(content: Any) -> bytes:
    """Return a std_msgs/String with a JSON text; floats are restored bit by bit."""
    return encode_text(json.dumps(content))


def decode_json(topic: str, data: bytes) -> dict[str, Any]:
    """Return the JSON object in a std_msgs/String.

    Raises:
        BagError: there is none.
    """
    try:
        content = json.loads(decode(topic, data).data)
    except (InputError, ValueError, RecursionError) as error:
        raise _damaged(topic, str(error)) from error
    if not isinstance(content, dict):
        raise _damaged(topic, "no JSON object")
    return content


class SessionStart(NamedTuple):
    """A session that begins while the twin runs."""

    time_ns: int
    described: dict[str, Any]  # content of twin/session


class InputLog:
    """Entries on their way from the thread that steps to the one that publishes."""

    def __init__(self, run: str) -> None:
        """Make an empty log; `run`: a name that is unique in the bag."""
        self.run = run
        self.session = 0  # number of the newest one, from 1
        self.logged = 0  # messages of the newest session
        self._waiting: deque[LogEntry | SessionStart] = deque()
        self._published_ns = 0

    def begin(self, time_ns: int) -> dict[str, Any]:
        """Start a session at this time, between steps, and return its part of twin/session."""
        self._published_ns = time_ns
        return self._next_session()

    def take(self, entry: LogEntry | SessionStart) -> None:
        """Queue an entry; to be called by the solver thread."""
        self._waiting.append(entry)

    def messages(self, snapshot: Snapshot | None) -> Iterator[tuple[str, dict[str, Any]]]:
        """Return topic and content of the entries before a snapshot (None: all).

        With snapshots that were thrown out before this one. A session that begins is the content of
        twin/session without the number of messages that were published before.
        """
        while self._waiting and (snapshot is None or self._waiting[0].time_ns < snapshot.stamp_ns):
            entry = self._waiting.popleft()
            if isinstance(entry, SessionStart):
                yield SESSION_TOPIC, entry.described | self._next_session()
            else:
                content = {"time_ns": entry.time_ns, "calls": plain_calls(entry.calls)}
                yield INPUT_LOG_TOPIC, self._numbered(content)
        if snapshot is None:
            return
        if snapshot.stamp_ns - slot_of(snapshot)[1] > self._published_ns:
            skipped = {"skipped_ns": [self._published_ns, snapshot.stamp_ns]}
            yield INPUT_LOG_TOPIC, self._numbered(skipped)
        self._published_ns = snapshot.stamp_ns

    def _next_session(self) -> dict[str, Any]:
        self.session += 1
        before, self.logged = self.logged, 0
        return {"run": self.run, "session": self.session, "logged_before": before}

    def _numbered(self, content: dict[str, Any]) -> dict[str, Any]:
        self.logged += 1
        return {"run": self.run, "session": self.session, "number": self.logged, **content}


@dataclass(frozen=True)
class LoggedCalls:
    """One message of the log; its calls are read when they are needed."""

    number: int
    time_ns: int
    plain: Any

    def calls(self) -> tuple[Call, ...]:
        """Return the calls with their arguments.

        Raises:
            BagError: they are not valid calls.
        """
        try:
            return calls_of(self.plain)
        except (ValueError, TypeError) as error:
            raise _damaged(INPUT_LOG_TOPIC, str(error)) from error


@dataclass(frozen=True)
class SkippedSnapshots:
    """Snapshots that were not published: those of twin times between the two."""

    number: int
    after_ns: int
    before_ns: int


def read_log(data: bytes) -> tuple[tuple[str, int], LoggedCalls | SkippedSnapshots]:
    """Return run and number of the session, and the content of a message of twin/inputs.

    Raises:
        BagError: it is not such a message.
    """
    content = decode_json(INPUT_LOG_TOPIC, data)
    try:
        session = str(content["run"]), int(content["session"])
        number = int(content["number"])
        if "calls" in content:
            return session, LoggedCalls(number, int(content["time_ns"]), content["calls"])
        after_ns, before_ns = content["skipped_ns"]
        return session, SkippedSnapshots(number, int(after_ns), int(before_ns))
    except (KeyError, TypeError, ValueError) as error:
        raise _damaged(INPUT_LOG_TOPIC, repr(error)) from error


def _damaged(topic: str, reason: str) -> BagError:
    remedy = "give a bag that rope_twin recorded"
    return BagError(f"topic {topic}", f"a message does not make sense ({reason})", remedy)


@dataclass(frozen=True, kw_only=True)
class RunSetup:
    """Parameters of a run that its numbers depend on, besides scene and inputs."""

    elements: int | None = None  # in place of the scene's
    step_s: float | None = None  # likewise
    energy: bool = False
    error_interval: bool = False
    vibration: str = ""
    fatigue: str = ""
    other_sea: bool = False
    sender_lead_s: float = SENDER_LEAD_S  # by how much senders of motion may publish ahead
    correct_sender_clocks: bool = False
    follow_measured: bool = False  # every winch follows its measured line out
    feeds_itself: bool = False  # the run has the scene's sea of its own, from no topic

    @classmethod
    def of(cls, options: Any, **others: Any) -> RunSetup:
        """Return the parameters that a run's options have under the same names, and others."""
        names = [field.name for field in dataclasses.fields(cls) if hasattr(options, field.name)]
        return cls(**{name: getattr(options, name) for name in names} | others)

    def make(self, scene: Scene, state: SavedState | Path | None) -> Twin:
        """Return the twin of a run with these parameters, in static equilibrium or at a state.

        Raises:
            RopeTwinError: scene, state or parameters are invalid.
        """
        vortex = MonitorSettings(self.vibration, self.fatigue)
        monitors = Monitors(self.energy, self.error_interval, vortex)
        if state is None:
            twin = Twin(scene, monitors)
        else:
            from rope_twin.twin.vortex_monitor import uncounted_fatigue  # with the VIV models

            state = load_state(state) if isinstance(state, Path) else state
            twin = Twin.restore(state, scene, monitors)
            notices = twin.notice, uncounted_fatigue(state, vortex)
            twin.notice = "\n".join(filter(None, notices))
        twin.inputs.judge_clocks(self.sender_lead_s, self.correct_sender_clocks)
        if self.other_sea:
            twin.invalidate_error(OTHER_SEA)
        if self.feeds_itself:
            twin.inputs.expect_motion(None)
        else:
            expect_own_sea(twin)
        return twin


def expect_own_sea(twin: Twin) -> None:
    """Compare the motion input of a twin with its scene's own sea.

    For a run with input from topics or a recording. If the scene's convergence study gives no
    error, there is nothing to invalidate, and the sea is not opened.
    """
    if math.isnan(twin.study_error.rms_pct):
        return
    try:
        twin.inputs.expect_motion(open_sea(twin.scene))
    except RopeTwinError as error:
        twin.invalidate_error(f"the scene's own sea cannot be opened: {error}")


def describe_run(scene: Scene, setup: RunSetup, speed: float) -> dict[str, Any]:
    """Return what all sessions of a run have in common. Some 20 ms."""
    root, files = _root_and_files(scene)
    return {
        "format": FORMAT,
        "scene": {
            "name": scene.name,
            "file": _name_of(scene.path, root),
            "folder": str(root),
            "files": {_name_of(path, root): _text(path) for path in files},
            "figures": _figures(scene, root),
        },
        "seeds": dict(_seeds(scene, "")),
        "setup": dataclasses.asdict(setup),
        "speed": speed,
        "program": program(),
        "machine": machine(),
    }


def describe_session(run: Mapping[str, Any], twin: Twin, epoch_ns: int) -> dict[str, Any]:
    """Return what a session begins with, for the thread that steps.

    `encode_session` makes a message of it; its number is the log's.
    """
    state: SavedState | str | None = None
    if twin.time_ns > 0 or twin.restored:
        try:
            state = twin.capture()
        except StateError as error:
            state = str(error)
    return {
        **run,
        "epoch_ns": epoch_ns,
        "time_ns": twin.time_ns,
        "level": [twin.level.step_ns, twin.level.halvings],
        "state": state,
    }


def encode_session(described: Mapping[str, Any], published: Mapping[str, int]) -> bytes:
    """Return a message of twin/session.

    published: number of messages of each topic up to now, by publishers that continue.
    """
    state = described["state"]
    text, fault = None, ""
    try:
        if isinstance(state, SavedState):
            text = base64.b64encode(zlib.compress(state.encode(), 1)).decode()
        elif state is not None:
            fault = state
    except StateError as error:
        fault = str(error)
    return encode_json({**described, "state": text, "fault": fault, "published": dict(published)})


@dataclass(frozen=True)
class Session:
    """One message of twin/session, read."""

    run: str
    number: int
    epoch_ns: int
    time_ns: int
    level: AccuracyLevel  # elements and step that it begins with
    setup: RunSetup
    published: Mapping[str, int]
    logged_before: int  # messages of twin/inputs of the session before, in the same run
    content: Mapping[str, Any]  # all of it

    @classmethod
    def read(cls, content: Mapping[str, Any]) -> Session:
        """Read the JSON object of a message.

        Raises:
            BagError: it is none that this version of the program knows.
        """
        try:
            if content["format"] != FORMAT:
                problem = f"a description of format {content['format']}"
                raise _refusal(problem, f"this program reads format {FORMAT}")
            return cls(
                run=str(content["run"]),
                number=int(content["session"]),
                epoch_ns=int(content["epoch_ns"]),
                time_ns=int(content["time_ns"]),
                level=AccuracyLevel(*(int(value) for value in content["level"])),
                setup=RunSetup(**content["setup"]),
                published={str(k): int(v) for k, v in content["published"].items()},
                logged_before=int(content["logged_before"]),
                content=content,
            )
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            remedy = "give a bag that this version of rope_twin recorded"
            raise _refusal(f"a description that lacks something ({error!r})", remedy) from error

    def differences(self) -> list[str]:
        """Return what made the bag and is another here, a sentence each."""
        rows = (("program", program()), ("machine", machine()))
        return [
            f"{name} {key} was {recorded[key]} and is {present[key]}"
            for name, present in rows
            for recorded in [self.content.get(name, {})]
            for key in present
            if key in recorded and key != "commit" and recorded[key] != present[key]
        ]

    def make_twin(self) -> Twin:
        """Return the twin as it was when the session began.

        Raises:
            BagError: a file of the scene is another here and cannot be taken from the bag.
            RopeTwinError: the twin cannot be built.
        """
        if fault := self.content.get("fault"):
            problem = f"session {self.number} has no state ({fault})"
            raise _refusal(problem, "replay another session")
        scene = self.scene()
        state = None
        if (text := self.content.get("state")) is not None:
            try:
                data = zlib.decompress(base64.b64decode(text))
            except (ValueError, zlib.error) as error:
                raise _refusal(f"a damaged state ({error})", "give the bag as recorded") from error
            state = decode_state(data, f"{SESSION_TOPIC} {self.number}")
            # scene and state are of one message: paths may differ, and nothing else does
            state = dataclasses.replace(state, figures=scene_properties(scene))
        twin = self.setup.make(scene, state)
        if twin.level != self.level:
            twin.set_level(self.level)
        if state is None:
            twin.snapshot()  # as every run does before its first step
        return twin

    def scene(self) -> Scene:
        """Return the scene of the bag: from its original path if unchanged, else from its text.

        Raises:
            BagError: a file of the scene is another here and cannot be taken from the bag.
            SceneError: the scene is not valid here.
        """
        described = self.content["scene"]
        folder, files = Path(described["folder"]), described["files"]
        for name in files:
            if name.startswith(_SHARED) and _text(_path_of(name, folder)) != files[name]:
                remedy = "replay with the program that recorded the bag"
                raise _refusal(f"{name.removeprefix(_SHARED)} is another file here", remedy)
        if all(_text(_path_of(name, folder)) == text for name, text in files.items()):
            return self._load(folder)
        place = Path(mkdtemp(prefix="rope_twin_replay_"))
        # tables are read when the twin is built, so they are kept as long as the session
        weakref.finalize(self, shutil.rmtree, place, ignore_errors=True)
        for name, text in files.items():
            if not name.startswith(_SHARED):
                path = _inside(place, name)
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(_bytes(text))
        return self._load(place)

    def _load(self, folder: Path) -> Scene:
        described = self.content["scene"]
        scene = load_scene(_path_of(described["file"], folder))
        scene = at_setting(scene, self.setup.elements, self.setup.step_s)
        scene = following_measured(scene) if self.setup.follow_measured else scene
        if _figures(scene, folder) != described["figures"]:
            problem = f"scene {described['name']}: its text gives other figures here"
            raise _refusal(problem, "replay with the program that recorded the bag")
        return scene


@functools.cache
def program() -> dict[str, str]:
    """Return version, commit (if known) and digests of the sources that run."""
    digest = hashlib.sha256()
    for path in sorted(_PACKAGE.rglob("*.py")):
        digest.update(path.relative_to(_PACKAGE).as_posix().encode())
        digest.update(path.read_bytes())
    return {
        "version": __version__,
        "commit": _commit(),
        "sources": digest.hexdigest()[:16],
        "solver": source_digest(),
    }


@functools.cache
def machine() -> dict[str, str]:
    """Return what the last bits of a result can depend on besides the program."""
    lines = _CPUINFO.read_text().splitlines() if _CPUINFO.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    versions = {name: importlib.metadata.version(name) for name in ("numba", "llvmlite", "numpy")}
    processor = names[0] if names else platform.machine()
    return {"processor": processor, "python": platform.python_version(), **versions}


def _commit() -> str:
    """Return the commit of a source tree; "" for an installed package or without git."""
    if not (_PACKAGE.parent / ".git").exists():
        return ""
    command = ["git", "-C", str(_PACKAGE.parent), "rev-parse", "HEAD"]
    with suppress(OSError, subprocess.SubprocessError):
        described = subprocess.run(command, capture_output=True, timeout=5.0, check=True)
        return described.stdout.decode("ascii", "replace").strip()
    return ""


def _root_and_files(scene: Scene) -> tuple[Path, list[Path]]:
    """Return the folder of the scene's own files, and all files with those of the package."""
    files = [scene.path.resolve(), *_tables(scene), share_dir() / "config" / "ropes.yaml"]
    if (study := study_path(scene)).is_file():
        files.append(study.resolve())
    shared = share_dir() / "config"
    own_folders = [path.parent for path in files if not path.is_relative_to(shared)]
    # the root is above the scene's accuracy study and its tables, too
    root = Path(os.path.commonpath([scene.path.resolve().parent, *own_folders]))
    return root, list(dict.fromkeys(files))


def _tables(scene: Scene) -> Iterator[Path]:
    """Return the data files that the scene names."""
    sea = scene.sea_state
    if sea.path:
        yield find_table(sea.path, MOTIONS_FOLDER).resolve()
    if sea.on_waves is not None and sea.on_waves.responses:
        yield find_table(sea.on_waves.responses, RESPONSES_FOLDER).resolve()
    for effect in scene.effects:
        for name, folder in getattr(effect, "tables", ()):
            with suppress(InputError):
                yield find_table(name, folder).resolve()


def _name_of(path: Path, root: Path) -> str:
    """Return the name of a file in a bag: relative to the root, or to the package's files."""
    path = path.resolve()
    if path.is_relative_to(root):
        return path.relative_to(root).as_posix()
    return _SHARED + path.relative_to(share_dir().resolve()).as_posix()


def _path_of(name: str, root: Path) -> Path:
    if name.startswith(_SHARED):
        return _inside(share_dir(), name.removeprefix(_SHARED))
    return _inside(root, name)


def _inside(folder: Path, name: str) -> Path:
    """Return a path below a folder; a bag of unknown origin may not name any other place."""
    path = (folder / name).resolve()
    if not path.is_relative_to(folder.resolve()):
        raise _refusal(f"a file name that leads out of its folder ({name})", "give another bag")
    return path


def _text(path: Path) -> str | None:
    """Return a file's text, its bytes if it is not text, or None if it cannot be read."""
    try:
        data = path.read_bytes()
    except OSError:
        return None
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return _BINARY + base64.b64encode(data).decode("ascii")


def _bytes(text: str) -> bytes:
    """Return the bytes of a file from what `_text` makes of it."""
    if text.startswith(_BINARY):
        return base64.b64decode(text.removeprefix(_BINARY))
    return text.encode()


def _figures(scene: Scene, root: Path) -> str:
    """Return a digest of the scene's content, whatever folder its files are in."""
    described = repr(dataclasses.replace(scene, path=Path(), digest=""))
    return hashlib.sha256(described.replace(str(root.resolve()), "").encode()).hexdigest()[:16]


def _seeds(value: Any, path_here: str) -> Iterator[tuple[str, int]]:
    """Return path and value of every seed in the scene."""
    if dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            part, path = getattr(value, field.name), f"{path_here}.{field.name}".lstrip(".")
            if field.name == "seed" and isinstance(part, int):
                yield path, part
            else:
                yield from _seeds(part, path)
    elif isinstance(value, tuple):
        for number, part in enumerate(value):
            yield from _seeds(part, f"{path_here}[{number}]")


def _refusal(problem: str, remedy: str) -> BagError:
    return BagError(f"topic {SESSION_TOPIC}", problem, remedy)
