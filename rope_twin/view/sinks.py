"""Output of the view: a file or a window, never memory alone, which would grow without limit.

A screenshot needs no display: rerun's viewer renders off-screen with Vulkan.
"""

from __future__ import annotations

import contextlib
import ctypes
import importlib.util
import io
import os
import socket
import struct
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from rope_twin.errors import InputError, phrase
from rope_twin.files import write_whole

APPLICATION = "rope_twin"
_VIEWER_MEMORY = "1GB"  # beyond this the window drops its oldest data
_START_S = 30.0
_MARK = b"RRF2"  # of rerun's files
_HEAD = struct.Struct("<12sQQ")  # mark, version and options; kind and length of the first message
_KINDS = (1, 2, 3)  # store, data, blueprint; 0 ends a recording
_X11_LIBRARIES = {  # loaded by the window at run time: file and Debian package
    "libX11-xcb.so.1": "libx11-xcb1",
    "libXcursor.so.1": "libxcursor1",
    "libXi.so.6": "libxi6",
    "libXrandr.so.2": "libxrandr2",
    "libxkbcommon-x11.so.0": "libxkbcommon-x11-0",
}
SIZE = (1600, 1000)
_SETTLE_S = 90.0
_OPEN_S = 20.0  # time within which the viewer finds the first data of a file
_DRIVERS = ("/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d", "/usr/local/share/vulkan/icd.d")
_EDGE = 4  # the window's outline [pixels]
_SOFTWARE = "lvp_icd"  # lavapipe: renders on the CPU, with the same result everywhere


def load_rerun() -> Any:
    """Return the rerun package.

    Raises:
        InputError: if it is not installed.
    """
    # A file of unknown length deliberately has no footer: suppress rerun's warning.
    os.environ.setdefault("RUST_LOG", "error")
    try:
        import rerun
    except ImportError as error:
        problem, remedy = f"rerun is missing ({error})", "install it with: pip install '.[viz]'"
        raise InputError("view", problem, remedy) from error
    return rerun


def has_rerun() -> bool:
    """Return whether rerun is installed, without loading it."""
    return importlib.util.find_spec("rerun") is not None


class Sink(Protocol):
    """Destination of a rerun recording."""

    stream: Any  # rerun.RecordingStream
    live: bool  # viewed while it grows: only recent data is plotted

    def close(self) -> None:
        """Flush and close; nothing may be logged afterwards."""


class FileSink:
    """Sink that writes an .rrd file.

    `footer` makes a finished file quicker to open, at the price of memory that grows with the
    file; leave it off for recordings of unknown length.
    """

    def __init__(self, path: Path, footer: bool = False, part: Path | None = None) -> None:
        """Create the file.

        part: temporary file that is written instead, and becomes the file later.

        Raises:
            InputError: the file cannot be created.
        """
        rerun, file = load_rerun(), part or path
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            file.open("ab").close()
        except OSError as error:
            raise unwritten(path, error.strerror or str(error)) from error
        self.path = path
        self.live = False
        self.stream = rerun.RecordingStream(APPLICATION)
        try:
            self.stream.save(file, write_footer=footer)
        except RuntimeError as error:  # raised by rerun if the disk is full
            raise unwritten(path, str(error)) from error

    def close(self) -> None:
        """Flush and close the file.

        Raises:
            InputError: the data cannot be written.
        """
        try:
            self.stream.flush()
        except RuntimeError as error:
            raise unwritten(self.path, str(error)) from error
        self.stream.disconnect()


def unwritten(path: Path, reason: str) -> InputError:
    """Return the error to raise where a recording cannot be written."""
    problem = f"it cannot be written ({reason.splitlines()[0].rstrip('.')})"
    return InputError(f"file {path}", problem, "name another file")


def recording_fault(path: Path) -> str:
    """Return the fault in the header of an .rrd file, or "" if a viewer can read it.

    A recording truncated by a crash has no footer and is valid. The header consists of the mark,
    four bytes of version, four of options, then kind and length of the first message.

    Raises:
        InputError: the file cannot be read.
    """
    try:
        with path.open("rb") as stream:
            head = stream.read(_HEAD.size)
            size = stream.seek(0, os.SEEK_END)
    except OSError as error:
        problem = f"it cannot be read ({error.strerror or error})"
        raise InputError(f"file {path}", problem, "check its permissions") from error
    if not head.startswith(_MARK):
        return "not a rerun recording" if head else "empty file"
    if len(head) < _HEAD.size:
        return "no message in the file"
    _, kind, length = _HEAD.unpack(head)
    if kind not in _KINDS or not 0 < length <= size - _HEAD.size:
        return "first message damaged"
    return ""


class WindowSink:
    """Sink that shows a window in a separate process, connected by the loopback network only.

    The window stays open when this side closes. If the user closes it first, `alive` becomes False
    and logged data is discarded.
    """

    def __init__(self) -> None:
        """Open the window.

        Raises:
            InputError: there is no display, or the window does not open.
        """
        rerun = load_rerun()
        self.live = True
        if missing := what_a_window_lacks():
            raise InputError(missing)
        port = free_port()
        self._process = start_viewer("--port", str(port), "--expect-data-soon",
                                     "--hide-welcome-screen", "--memory-limit", _VIEWER_MEMORY,
                                     "--server-memory-limit", "256MB")  # fmt: skip
        wait_for_viewer(self._process, port)
        self.stream = rerun.RecordingStream(APPLICATION)
        self.stream.connect_grpc(f"rerun+http://127.0.0.1:{port}/proxy")

    @property
    def alive(self) -> bool:
        """Return whether the window is still open."""
        return self._process.poll() is None

    def close(self) -> None:
        """Flush; the window stays open for the user."""
        if self.alive:
            self.stream.flush(timeout_sec=5.0)
        self.stream.disconnect()


def has_screen() -> bool:
    """Return whether there is a display to open a window on."""
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def what_a_window_lacks() -> str:
    """Return why no window can be opened here, in one sentence, or ""."""
    if not has_screen():
        return phrase("view", "no display", "use --out FILE.rrd or --out FILE.png")
    libraries = _X11_LIBRARIES if os.environ.get("DISPLAY") else {}
    missing = [package for library, package in libraries.items() if not has_library(library)]
    return _to_install("libraries for a window are not installed", missing)


def _to_install(problem: str, missing: list[str]) -> str:
    """Return a sentence on the Debian packages to install, or "" if none is missing."""
    remedy = f"on Debian: apt-get install {' '.join(missing)}"
    return phrase("view", problem, remedy) if missing else ""


def has_library(name: str) -> bool:
    """Return whether the dynamic linker finds a library."""
    try:
        ctypes.CDLL(name)
    except OSError:
        return False
    return True


def free_port() -> int:
    """Return a TCP port of the loopback network that is currently unused."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def start_viewer(*arguments: str, **environment: str) -> subprocess.Popen[bytes]:
    """Start rerun's viewer as a process: loopback only, no usage statistics, errors only.

    Raises:
        InputError: the viewer is not installed.
    """
    package = importlib.util.find_spec("rerun_cli")
    if package is None or package.origin is None:
        raise InputError("view", "rerun's viewer is missing", "install rope_twin[viz]")
    program = Path(package.origin).with_name("rerun")
    quiet = {
        "CI": "1",  # rerun sends no usage statistics where this is set
        "RUST_LOG": "error",  # also keeps notes about the graphics driver out of the picture
        "RERUN_APP_ONLY": "true",
    }
    return subprocess.Popen(
        [str(program), "--bind", "127.0.0.1", *arguments],
        env={**os.environ, **quiet, **environment},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,  # Ctrl-C in the terminal is for rope_twin alone
    )


def wait_for_viewer(process: subprocess.Popen[bytes], port: int) -> None:
    """Wait until the viewer accepts connections.

    Raises:
        InputError: if it ends, or does not accept connections in time.
    """
    deadline = time.monotonic() + _START_S
    while time.monotonic() < deadline:
        if process.poll() is not None:
            break
        with socket.socket() as probe:
            probe.settimeout(0.2)
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.05)
    process.kill()
    remedy = f"test it with: {sys.executable} -m rerun"
    raise InputError("view", "rerun's viewer did not start", remedy)


def what_a_picture_lacks() -> str:
    """Return a sentence on the packages to install, or "" if none is missing."""
    missing = [] if has_library("libvulkan.so.1") else ["libvulkan1"]
    if _driver() is None:
        missing.append("mesa-vulkan-drivers")
    return _to_install("a picture needs Vulkan, which is not installed", missing)


def take_picture(recording: Path, picture: Path) -> None:
    """Draw the last moment of an .rrd file into a PNG.

    Raises:
        InputError: if a package is missing on this machine, the viewer fails or the file cannot
            be written.
    """
    load_rerun()
    if missing := what_a_picture_lacks():
        raise InputError(missing)
    port = free_port()
    width, height = SIZE
    viewer = start_viewer(
        "--headless", "--port", str(port), "--window-size", f"{width}x{height}",
        "--renderer", "vulkan", "--hide-welcome-screen",
        VK_ICD_FILENAMES=os.environ.get("VK_ICD_FILENAMES") or str(_driver()),
    )  # fmt: skip
    try:
        wait_for_viewer(viewer, port)
        data = _settled(port, recording)
    except RuntimeError as error:  # how the viewer's client reports all failures
        problem, remedy = f"no picture received ({error})", "try again, or use --out FILE.rrd"
        raise InputError("view", problem, remedy) from error
    finally:
        viewer.kill()
        viewer.wait()
    _write(data, picture)


def _driver() -> Path | None:
    """Return the description file of a Vulkan driver, preferably the software renderer's."""
    drivers = [file for folder in _DRIVERS for file in sorted(Path(folder).glob("*.json"))]
    return min(drivers, key=lambda file: not file.name.startswith(_SOFTWARE), default=None)


def _settled(port: int, recording: Path) -> bytes:
    """Return the picture once two in a row are equal: the viewer loads and draws in pieces."""
    from rerun.experimental import ViewerClient

    client = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
    client.open(str(recording.resolve()))
    start = time.monotonic()
    before = b""
    while (waited_s := time.monotonic() - start) < _SETTLE_S:
        state = client.get_state()
        if waited_s > _OPEN_S and not state.recordings:
            raise RuntimeError(f"the viewer finds no data in {recording}")
        now = bytes(client.take_screenshot())
        if now == before and state.recordings and not state.loading:
            return now
        before = now
    raise RuntimeError(f"the picture still changes after {_SETTLE_S:g} s")


def _write(data: bytes, picture: Path) -> None:
    from PIL import Image

    image = _without_title_bar(Image.open(io.BytesIO(data)).convert("RGB"))
    try:
        with contextlib.suppress(FileExistsError):
            picture.parent.mkdir(parents=True)
        buffer = io.BytesIO()
        image.save(buffer, format="PNG", optimize=True)
        write_whole(picture, buffer.getvalue())
    except OSError as error:
        problem = f"it cannot be written ({error.strerror or error})"
        raise InputError(f"picture {picture}", problem, "name another file") from error


def _without_title_bar(image: Any) -> Any:
    """Return the picture without the empty title bar of a frameless window."""
    column = np.asarray(image, dtype=np.int16)[:, image.width // 2]
    differs = np.abs(column[_EDGE : image.height // 10] - column[_EDGE]).max(axis=1) > 2
    top = _EDGE + int(differs.argmax()) if differs.any() else 0
    return image.crop((0, top, image.width, image.height))
