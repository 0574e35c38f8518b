"""`rope_twin doctor` and `--version`: each check, well and ill, without and with ROS."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from rope_twin.cli import installation, main
from rope_twin.cli.installation import ERROR, OK, WARN
from rope_twin.core import SOLVER_VERSION
from rope_twin.errors import InputError


def ros(latency_s: float = 1e-3, failure: Exception | None = None) -> Any:
    """A middleware that answers in this time, or fails."""

    def round_trip(timeout_s: float) -> Any:
        if failure is not None:
            raise failure
        return SimpleNamespace(discovery_s=0.1, latency_s=latency_s)

    return SimpleNamespace(rmw_name=lambda: "rmw_fastrtps_cpp", round_trip=round_trip)


def missing() -> Any:
    raise ImportError("no module named 'rclpy'")


@pytest.mark.parametrize(
    ("middleware", "level", "words"),
    [
        (ros, OK, "rmw_fastrtps_cpp: discovery 0.1 s, message 1 ms"),
        (lambda: ros(0.1), WARN, "message 1e+02 ms"),
        (lambda: ros(failure=InputError("DDS: no message; allow UDP.")), ERROR, "no message"),
        (missing, ERROR, "no module named 'rclpy'"),
    ],
)
def test_the_middleware(middleware: Any, level: str, words: str) -> None:
    check = installation.check_middleware(middleware)
    assert (check.level, bool(check.remedy)) == (level, level != OK)
    assert words in check.found


@pytest.mark.parametrize(
    ("given", "level"), [(None, OK), ("LOCALHOST", OK), ("SUBNET", WARN), ("OFF", ERROR)]
)
def test_discovery(given: str | None, level: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("ROS_AUTOMATIC_DISCOVERY_RANGE", raising=False)
    if given is not None:
        monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", given)
    assert installation.check_discovery().level == level


def test_the_compile_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROPE_TWIN_CACHE", str(tmp_path))
    assert "created by the first run" in installation.check_cache().found
    folder = tmp_path / "rope_twin"
    folder.mkdir(mode=0o700)
    (folder / "kernel").write_bytes(b"0" * 2_000_000)
    check = installation.check_cache()
    assert check.level == OK
    assert f"owner {os.geteuid()}, mode 0700, 2 MB in 1 files" in check.found
    folder.chmod(0o777)
    check = installation.check_cache()
    assert check.level == WARN
    assert "ROPE_TWIN_CACHE" in check.remedy


@pytest.mark.parametrize(("free", "level"), [(5e9, OK), (1e9, WARN), (1e7, ERROR)])
def test_the_disk(free: float, level: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(installation.shutil, "disk_usage", lambda _: SimpleNamespace(free=free))
    assert installation.check_space(Path("/")).level == level


@pytest.mark.parametrize(
    ("names", "level"),
    [([], OK), (["performance"] * 2, OK), (["performance", "powersave"], WARN)],
)
def test_the_governor(
    names: list[str], level: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for number, name in enumerate(names):
        (tmp_path / f"cpu{number}").write_text(f"{name}\n")
    monkeypatch.setattr(installation, "GOVERNORS", f"{tmp_path}/cpu[0-9]*")
    assert installation.check_governor().level == level


def test_missing_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(installation, "version_of", lambda name: "" if name == "mcap" else "1.0")
    check = installation.check_packages()
    assert (check.level, check.remedy) == (ERROR, "pip install mcap")
    monkeypatch.setattr(installation, "version_of", lambda name: "" if name == "pyarrow" else "1.0")
    assert installation.check_packages().level == WARN


@pytest.mark.parametrize(("level", "code"), [(OK, 0), (WARN, 0), (ERROR, 3)])
def test_only_an_error_changes_the_exit_code(
    level: str, code: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    checks = [installation.Check("disk", level, "as found", "as advised")]
    monkeypatch.setattr(installation, "check_all", lambda: iter(checks))
    assert main(["doctor", "--json"]) == code
    assert json.loads(capsys.readouterr().out)["ok"] is (code == 0)
    assert main(["doctor"]) == code
    assert re.search(rf"{level} +disk +as found\n +remedy: as advised", capsys.readouterr().out)


@pytest.mark.ros
def test_a_message_goes_through_dds() -> None:
    from rope_twin.ros import middleware

    for _ in range(12):  # of 5 s each: other tests may keep the processors busy for longer
        check = installation.check_middleware(lambda: middleware)
        if check.level != ERROR:
            break
    assert check.level in (OK, WARN), check
    assert re.search(r"rmw_\w+: discovery [\d.e-]+ s, message [\d.e+-]+ ms", check.found)


@pytest.mark.ros
def test_versions(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--version"])
    assert ended.value.code == 0
    own, python, ros_line = capsys.readouterr().out.splitlines()
    assert re.fullmatch(rf"rope_twin .+, solver {SOLVER_VERSION}", own)
    assert re.fullmatch(r"Python 3\.\d+\.\d+, numba [\d.]+, llvmlite [\d.]+", python)
    assert re.fullmatch(r"rclpy .+, ROS 2 .+, rmw_\w+", ros_line)
