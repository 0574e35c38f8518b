"""Every key of a scene file, by part, from the dataclasses that a file is read into."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import groupby

from markdown import code, prose, table, words

from rope_twin.scene.reference import Key, scene_keys


def scene_keys_by_part() -> str:
    """Return a table for each part of a scene file."""
    keys = scene_keys()
    single = [key for key in keys if key.wants.split(" ")[0] not in ("mapping", "list")]
    plain = [key for key in keys if "." not in key.path]
    parts = groupby([key for key in keys if "." in key.path], key=_part_of)
    sections = ["## Top level\n\n" + _table(plain)]
    sections += [f"## {code(part)}\n\n{_table(own)}" for part, own in _merged(parts)]
    return f"{len(keys)} keys, {len(single)} of them values.\n\n" + "\n\n".join(sections)


def _part_of(key: Key) -> str:
    """Return what a section is about: the first word of the path, of effects the first two."""
    head, *rest = key.path.split(".")
    return f"{head}.{rest[0]}" if head == "effects[]" else head


def _merged(parts: Iterable[tuple[str, Iterable[Key]]]) -> list[tuple[str, list[Key]]]:
    together: dict[str, list[Key]] = {}
    for part, own in parts:
        together.setdefault(part, []).extend(own)
    return list(together.items())


def _table(keys: list[Key]) -> str:
    return table(
        ("key", "value", "range", "default", "meaning"),
        (
            (
                code(key.path.removeprefix("effects[].")),
                words(key.wants),
                words(key.range),
                "**required**" if key.default is None else words(key.default),
                prose(key.meaning),
            )
            for key in keys
        ),
    )
