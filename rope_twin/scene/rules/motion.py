"""Rules between a scene's ship and the tables that prescribe its motion."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from rope_twin.errors import InputError
from rope_twin.scene.rules.fault import Fault
from rope_twin.scene.schema import Scene
from rope_twin.sea.columns import is_path
from rope_twin.sea.responses import read_responses
from rope_twin.sea.way import read_way


def beside(scene: Scene, name_or_path: str) -> str:
    """Return a table's name as is, or the absolute path of one relative to the scene's file."""
    if not is_path(name_or_path):
        return name_or_path
    return str((scene.path.parent / name_or_path).resolve())


def _way(scene: Scene) -> Iterator[Fault]:
    sea = scene.sea_state
    if not sea.path:
        return
    if sea.bag or sea.heave is not None:
        yield "sea_state", "the hang-off has a prescribed motion and a record", "keep one of them"
    if not sea.loop:
        yield "sea_state.loop", "a prescribed motion ends with its table", "remove `loop`"
    try:
        way = read_way(beside(scene, sea.path))
    except InputError as error:
        yield "sea_state.path", *_halves(error)
        return
    if sea.start_s >= way.end_s:
        what = f"the prescribed motion of {way.end_s:g} s has ended by then"
        yield "sea_state.start_s", what, "start earlier"


def _poses(scene: Scene) -> Iterator[Fault]:
    sea = scene.sea_state
    if sea.poses is None:
        return
    if not sea.poses.bag.strip():
        yield "sea_state.poses.bag", "it is empty", "name a bag, or remove `poses`"
    if sea.bag or sea.path or sea.heave is not None or sea.on_waves is not None:
        yield "sea_state", "recorded poses and another motion are given", "keep one of them"


def _responses(scene: Scene) -> Iterator[Fault]:
    riding = scene.sea_state.on_waves
    if riding is None:
        return
    if not riding.responses:
        if riding.heading_deg != 0.0:
            right = "give `responses`, or remove `heading_deg`"
            yield "sea_state.on_waves", "a box hull is in head seas at any heading", right
        return
    try:
        read_responses(beside(scene, riding.responses))
    except InputError as error:
        yield "sea_state.on_waves.responses", *_halves(error)


def _halves(error: InputError) -> tuple[str, str]:
    """Return fault and remedy of an error's sentence, without its full stop."""
    what, _, right = str(error).removesuffix(".").rpartition("; ")
    return what, right


MOTION_RULES: tuple[Callable[[Scene], Iterator[Fault]], ...] = (
    _way,
    _poses,
    _responses,
)
