"""The completion scripts, the one for bash as bash runs it."""

from __future__ import annotations

import shutil
import subprocess

import pytest

from rope_twin.cli import build_parser, main
from rope_twin.run.options import leaf_parsers

COMPLETE = """
source /dev/stdin <<< "$SCRIPT"
COMP_WORDS=("$@") COMP_CWORD=$(($# - 1)) COMPREPLY=()
_rope_twin
printf '%s\\n' "${COMPREPLY[@]}"
"""


def script(shell: str, capsys: pytest.CaptureFixture[str]) -> str:
    assert main(["completion", shell]) == 0
    return capsys.readouterr().out


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash here")
@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["rec"], ["recover"]),
        (["run", "deep_l"], ["deep_lift"]),
        (["run", "--save"], ["--save-state"]),
        (["run", "deep_lift", "--dur"], ["--duration"]),
        (["run", "--out", "deep_l"], [""]),
        (["scene", "sch"], ["schema"]),
        (["scene", "check", "ahc"], ["ahc_lift"]),
        (["sea-state", "info", "sea_2p5m", "--motion", "po"], ["poses"]),
        (["no_such_command", "d"], [""]),
    ],
)
def test_bash_completes(
    words: list[str], expected: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    done = subprocess.run(
        ["bash", "-c", COMPLETE, "bash", "rope_twin", *words], capture_output=True, text=True,
        env={"SCRIPT": script("bash", capsys), "PATH": "/usr/bin:/bin"}, check=True,
    )  # fmt: skip
    assert done.stdout.removesuffix("\n").split("\n") == expected
    assert not done.stderr


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_every_option_of_every_command_is_in_the_script(
    shell: str, capsys: pytest.CaptureFixture[str]
) -> None:
    found = script(shell, capsys)
    dashes = "-l " if shell == "fish" else "--"
    for parser in leaf_parsers(build_parser()):
        for action in parser._actions:
            for name in action.option_strings:
                if name.startswith("--"):
                    assert f"{dashes}{name[2:]}" in found


def test_the_script_for_zsh_is_that_for_bash_in_its_emulation(
    capsys: pytest.CaptureFixture[str],
) -> None:
    first, second, rest = script("zsh", capsys).split("\n", 2)
    assert first == "#compdef rope_twin"
    assert "bashcompinit" in second
    assert rest == script("bash", capsys)
