"""Screenshot of a recording without a display: rerun's viewer renders off-screen with Vulkan."""

from __future__ import annotations

import contextlib
import io
import os
import time
from pathlib import Path
from typing import Any

import numpy as np

from rope_twin.errors import InputError, phrase
from rope_twin.view.sinks import free_port, has_library, load_rerun, start_viewer, wait_for_viewer

SIZE = (1600, 1000)
_SETTLE_S = 90.0
_OPEN_S = 20.0  # time within which the viewer finds the first data of a file
_DRIVERS = ("/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d", "/usr/local/share/vulkan/icd.d")
_EDGE = 4  # the window's outline [pixels]
_SOFTWARE = "lvp_icd"  # lavapipe: renders on the CPU, with the same result everywhere


def what_a_picture_lacks() -> str:
    """Return a sentence on the packages to install, or "" if none is missing."""
    missing = [] if has_library("libvulkan.so.1") else ["libvulkan1"]
    if _driver() is None:
        missing.append("mesa-vulkan-drivers")
    if not missing:
        return ""
    return phrase(
        "view",
        "a picture needs Vulkan, which is not installed",
        f"on Debian: apt-get install {' '.join(missing)}",
    )


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
        raise InputError(
            phrase("view", f"no picture received ({error})", "try again, or use --out FILE.rrd")
        ) from error
    finally:
        viewer.kill()
        viewer.wait()
    _write(data, picture)


def _driver() -> Path | None:
    """Return the description file of a Vulkan driver, preferably the software renderer's."""
    found = [file for folder in _DRIVERS for file in sorted(Path(folder).glob("*.json"))]
    return min(found, key=lambda file: not file.name.startswith(_SOFTWARE), default=None)


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
        image.save(picture, format="PNG", optimize=True)
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(
            phrase(f"picture {picture}", f"it cannot be written ({reason})", "name another file")
        ) from error


def _without_title_bar(image: Any) -> Any:
    """Return the picture without the empty title bar of a frameless window."""
    column = np.asarray(image, dtype=np.int16)[:, image.width // 2]
    away = np.abs(column[_EDGE : image.height // 10] - column[_EDGE]).max(axis=1) > 2
    top = _EDGE + int(away.argmax()) if away.any() else 0
    return image.crop((0, top, image.width, image.height))
