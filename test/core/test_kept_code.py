"""Compiled code on disk: it is taken from there when it is whole, and made again when it is not.

The entry is the smallest that there is; the last test starts whole scenes at once, with nothing
compiled:

    pytest -n 0 -m long test/core/test_kept_code.py
"""

from __future__ import annotations

import hashlib
import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

CHAIN = """
from rope_twin.core.jit.functions import chain
print(chain(1.0, 0.5, 1.0, 3), sum(chain.stats.cache_hits.values()))
"""
LIFT = """
import sys
from rope_twin import Twin, load_scene
twin = Twin(load_scene(sys.argv[1]))
twin.advance(500)
now = twin.snapshot()
print(now.node_position_m.tobytes().hex(), now.element_tension_n.tobytes().hex())
"""
CHAINED = "1.875"  # 1, 1.5, 1.75, 1.875


def _start(cache: Path, program: str, *arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", program, *arguments],
        env={**os.environ, "ROPE_TWIN_CACHE": str(cache)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def _said(process: subprocess.Popen[str]) -> tuple[list[str], str]:
    """The words that a process wrote, and what it complained of."""
    out, complaint = process.communicate(timeout=300.0)
    assert process.returncode == 0, complaint
    return out.split(), complaint


def _flip_a_bit(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def test_damaged_code_is_reported_and_compiled_again(tmp_path: Path) -> None:
    """Cut short, or one bit of it another: one after the other, each time from whole code."""
    damages: list[Callable[[Path], object]] = [
        lambda path: path.write_bytes(path.read_bytes()[:-1]),
        _flip_a_bit,
    ]
    assert _said(_start(tmp_path, CHAIN)) == ([CHAINED, "0"], "")
    for damage in damages:
        assert _said(_start(tmp_path, CHAIN)) == ([CHAINED, "1"], "")
        (kept,) = tmp_path.rglob("*.nbc")
        damage(kept)
        words, complaint = _said(_start(tmp_path, CHAIN))
        assert words == [CHAINED, "0"]
        assert complaint.strip() == f"compiled code is damaged, it is compiled again: {kept}"
    assert _said(_start(tmp_path, CHAIN)) == ([CHAINED, "1"], "")


def test_code_that_cannot_be_cached_is_reported_and_runs(tmp_path: Path) -> None:
    """A folder in the place of the file: nothing can be read from it or written to it."""
    _said(_start(tmp_path, CHAIN))
    (kept,) = tmp_path.rglob("*.nbc")
    kept.unlink()
    kept.mkdir()
    words, complaint = _said(_start(tmp_path, CHAIN))
    assert words == [CHAINED, "0"]
    assert "cannot be read" in complaint
    assert "is not kept" in complaint
    assert list(kept.parent.iterdir()) == [kept]


class _Planted:
    """Unpickling it runs a command, as whoever could write to the folder would have it."""

    def __init__(self, mark: Path) -> None:
        self._mark = mark

    def __reduce__(self) -> tuple[object, tuple[str]]:
        return os.system, (f"touch {self._mark}",)


def test_foreign_cache_files_are_never_unpickled(tmp_path: Path) -> None:
    """A pickle in place of the code, with the check sum that anybody can compute, and an index."""
    cache, mark = tmp_path / "cache", tmp_path / "mark"
    _said(_start(cache, CHAIN))
    (kept,) = cache.rglob("*.nbc")
    planted = pickle.dumps(_Planted(mark))
    kept.write_bytes(hashlib.sha256(planted).digest() + planted)
    for index in (".nbi", ".1.nbc"):  # of numba itself
        kept.with_name(kept.name.rpartition(".")[0].rpartition(".")[0] + index).write_bytes(planted)
    words, complaint = _said(_start(cache, CHAIN))
    assert words == [CHAINED, "0"]
    assert "compiled code is damaged" in complaint
    assert not mark.exists()
    os.system(f"touch {mark}")  # it would have been seen
    assert mark.exists()


def test_a_cache_folder_writable_by_others_is_not_used(tmp_path: Path) -> None:
    _said(_start(tmp_path, CHAIN))
    (kept,) = tmp_path.rglob("*.nbc")
    before = kept.stat().st_mtime_ns
    (tmp_path / "rope_twin").chmod(0o777)
    words, complaint = _said(_start(tmp_path, CHAIN))
    assert words == [CHAINED, "0"]
    assert len(complaint.strip().splitlines()) == 1
    assert "others may write to the folder (mode 0777)" in complaint
    assert kept.stat().st_mtime_ns == before
    (tmp_path / "rope_twin").chmod(0o700)
    assert _said(_start(tmp_path, CHAIN)) == ([CHAINED, "1"], "")


def test_every_cache_folder_is_private(tmp_path: Path) -> None:
    before = os.umask(0)
    try:
        _said(_start(tmp_path, CHAIN))
    finally:
        os.umask(before)
    folders = [path for path in tmp_path.rglob("*") if path.is_dir()]
    assert len(folders) >= 3
    assert {path.stat().st_mode & 0o777 for path in folders} == {0o700}


@pytest.mark.long
def test_concurrent_cold_starts_find_their_code_later(tmp_path: Path) -> None:
    """Two of one set and one of another, with nothing compiled, and again: the same to the bit."""
    scenes = ("still_water", "still_water", "deep_lift")
    first = [_start(tmp_path, LIFT, scene) for scene in scenes]
    cold = [_said(process) for process in first]
    warm = [_said(_start(tmp_path, LIFT, scene)) for scene in scenes]
    assert cold == warm
    assert cold[0] == cold[1] != cold[2]
    assert len(list(tmp_path.rglob("step.advance_steps-*.nbc"))) == 2
