"""The folder of compiled kernels: private to the user, or not used; the seal of its files."""

from __future__ import annotations

import logging
import os
import stat
from collections.abc import Callable
from pathlib import Path

import pytest

from rope_twin.core.jit import decorators as code_folder
from rope_twin.core.jit.decorators import CodeFolder, open_folder

DIGEST = "0123456789abcdef"


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The user's cache, and a temporary directory of the test's own; the folder in the cache."""
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("ROPE_TWIN_CACHE", raising=False)
    return tmp_path / "cache" / "rope_twin"


def opened() -> CodeFolder:
    folder = open_folder(DIGEST)
    assert folder is not None
    return folder


def mode(path: Path) -> int:
    return stat.S_IMODE(path.lstat().st_mode)


@pytest.mark.parametrize("mask", [0o000, 0o002, 0o022, 0o077])
def test_folders_and_key_are_private_to_the_user(cache: Path, mask: int) -> None:
    before = os.umask(mask)
    try:
        folder = opened()
    finally:
        os.umask(before)
    assert folder.path == cache / DIGEST
    assert (mode(cache), mode(cache / DIGEST), mode(cache / "key")) == (0o700, 0o700, 0o600)
    assert (cache / "key").read_bytes() == folder.key
    assert len(folder.key) == 32
    assert sorted(path.name for path in cache.iterdir()) == [DIGEST, "key"]
    assert opened() == folder


def test_a_chosen_folder_comes_first(
    cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROPE_TWIN_CACHE", str(tmp_path / "mine"))
    assert opened().path == tmp_path / "mine" / "rope_twin" / DIGEST


def _behind_a_link(cache: Path, part: str) -> None:
    (cache.parent / "elsewhere" / DIGEST).mkdir(parents=True)
    cache.parent.mkdir(exist_ok=True)
    if part == "root":
        cache.symlink_to(cache.parent / "elsewhere")
    else:
        cache.mkdir()
        (cache / DIGEST).symlink_to(cache.parent / "elsewhere" / DIGEST)


def _open_to(cache: Path, part: str, bits: int) -> None:
    opened()
    (cache if part == "root" else cache / DIGEST).chmod(bits)


def _file_in_its_place(cache: Path, part: str) -> None:
    cache.parent.mkdir(exist_ok=True)
    if part == "folder":
        cache.mkdir()
    (cache if part == "root" else cache / DIGEST).write_bytes(b"")


def _key_of_others(cache: Path, what: str) -> None:
    key = opened().key
    if what == "readable":
        (cache / "key").chmod(0o640)
    elif what == "short":
        (cache / "key").write_bytes(key[:-1])
    else:
        (cache / "key").rename(cache / "other")
        (cache / "key").symlink_to(cache / "other")


REFUSED: dict[str, tuple[Callable[[Path], None], str]] = {
    "root is a link": (lambda c: _behind_a_link(c, "root"), "not a link or a file"),
    "folder is a link": (lambda c: _behind_a_link(c, "folder"), "not a link or a file"),
    "root is a file": (lambda c: _file_in_its_place(c, "root"), "not a link or a file"),
    "folder is a file": (lambda c: _file_in_its_place(c, "folder"), "not a link or a file"),
    "group writes": (lambda c: _open_to(c, "folder", 0o770), "others may write"),
    "all write": (lambda c: _open_to(c, "folder", 0o1777), "others may write"),
    "group writes above": (lambda c: _open_to(c, "root", 0o775), "others may write"),
    "key readable": (lambda c: _key_of_others(c, "readable"), "not a secret"),
    "key short": (lambda c: _key_of_others(c, "short"), "not a secret"),
    "key a link": (lambda c: _key_of_others(c, "link"), "'key'|symbolic links"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_shared_folder_is_rejected_with_one_warning(
    cache: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture, case: str
) -> None:
    """In its place comes a folder of unpredictable name that only this user can enter."""
    prepare, words = REFUSED[case]
    prepare(cache)
    with caplog.at_level(logging.WARNING):
        first, second = opened(), opened()
    assert len(caplog.records) == 2
    assert f"compiled code in {cache}" in caplog.text
    assert any(word in caplog.text for word in words.split("|"))
    assert "ROPE_TWIN_CACHE" in caplog.text
    for folder in (first, second):
        assert folder.path.parent.parent == tmp_path / "temporary"
        assert folder.path.parent.name.startswith("rope_twin_")
        assert mode(folder.path.parent) == 0o700
    assert first.path != second.path
    assert first.key != second.key


def test_a_folder_of_another_user_is_rejected(
    cache: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    owner = os.geteuid()
    opened()
    monkeypatch.setattr(os, "geteuid", lambda: owner + 1)
    assert open_folder(DIGEST) is None  # the temporary one belongs to the other user as well
    assert f"belongs to another user (uid {owner})" in caplog.text


def test_an_impossible_folder_is_reported(
    cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv("ROPE_TWIN_CACHE", "/proc/none")
    assert opened().path.parent.parent == tmp_path / "temporary"
    assert "compiled code in /proc/none/rope_twin: " in caplog.text
    monkeypatch.setattr("tempfile.tempdir", "/proc/none")
    assert open_folder(DIGEST) is None


def test_the_first_of_two_concurrent_keys_is_used(
    cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    key = opened().key
    code_folder._make_key(cache / "key")  # as another process that saw none yet
    assert opened().key == key
    assert sorted(path.name for path in cache.iterdir()) == [DIGEST, "key"]


def test_the_seal_depends_on_content_and_key(cache: Path) -> None:
    folder = opened()
    sealed = folder.seal(b"compiled code")
    assert folder.unseal(sealed) == b"compiled code"
    for at in range(len(sealed)):
        damaged = bytearray(sealed)
        damaged[at] ^= 1
        assert folder.unseal(bytes(damaged)) is None
    assert folder.unseal(sealed[:-1]) is None
    assert folder.unseal(b"") is None
    other = CodeFolder(folder.path, b"k" * 32)
    assert other.unseal(sealed) is None
    assert str(folder.key) not in repr(folder)
