"""The command line `rope_twin COMMAND ...`. Each command is a module of this package."""

from __future__ import annotations

import argparse
import contextlib
import importlib
import os
import re
import sys
import textwrap
from collections.abc import Callable, Sequence
from functools import partial
from types import ModuleType
from typing import Any, NoReturn

from rope_twin.cli.console import MEANINGS, ExitCode
from rope_twin.errors import RopeTwinError, did_you_mean, phrase
from rope_twin.run.arguments import HelpFormatter

DESCRIPTION = """Real-time simulator of winch, wire and payload for subsea lifting, on ROS 2.

Durations, lengths, speeds and rates take a unit (90s, 2min, 1.5km) or are plain SI numbers. With
--json a command prints one JSON object on stdout and nothing else there; progress, warnings and
errors go to stderr."""
EXAMPLES = """examples:
  rope_twin run deep_lift --duration 90s
  rope_twin scene list
  rope_twin COMMAND --help"""

# The commands in the order of the help: module name (with _) and name on the command line (with -).
COMMANDS = (
    "run", "scene", "view", "replay", "export", "recover", "ensemble", "study", "plan",
    "sensitivity", "operability", "modes", "viv", "accuracy", "lines", "alerts", "faults", "learn",
    "ahead", "sea_state", "feed", "console", "state", "doctor", "completion",
)  # fmt: skip
MODULES = {"console": "operator_console"}  # of commands whose module has another name

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as in the nodes; read when numpy is loaded

_CHOICE = re.compile(r"argument (.+): invalid choice: (\S+) \(choose from (.*)\)")
_NUMBER = re.compile(r"argument (\S+): invalid (int|float) value: (.*)")
_MINUS = "(write a value that begins with - after =, like --at=-1)"


class CommandLine(argparse.ArgumentParser):
    """A parser that reports an error in one sentence, without the usage."""

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> tuple[Any, list[str]]:
        """Parse as argparse does, but let each command itself reject unknown words."""
        found, left = super().parse_known_args(args, namespace)
        if left:
            known = re.findall(r"--[a-z-]+", self.format_usage())
            hint = f"; {did_you_mean(left[0], known)}" if left[0].startswith("--") else ""
            self.error(f"unknown argument {' '.join(left)}{hint}")
        return found, left

    def error(self, message: str) -> NoReturn:
        """End the program."""
        if found := _CHOICE.fullmatch(message):
            where = f"{found[1]}: " if found[1].startswith("-") else ""
            asked, *known = (word.strip("'") for word in (found[2], *found[3].split(", ")))
            message = f"{where}there is no '{asked}'; {did_you_mean(asked, known)}"
        elif found := _NUMBER.fullmatch(message):
            wanted = "whole number" if found[2] == "int" else "number"
            message = f"{found[1]}: {found[3]} is not a {wanted}"
        elif message.endswith("expected one argument"):
            message = f"{message} {_MINUS}"
        message = message.removeprefix("argument ").rstrip("?")
        self.exit(ExitCode.USAGE, f"{self.prog}: {message}; see `{self.prog} --help`.\n")


def main(argv: Sequence[str] | None = None) -> int:
    """Read the command line, run the command and return its exit code (ExitCode)."""
    return exit_code(partial(_command, list(sys.argv[1:] if argv is None else argv)))


def _command(words: list[str]) -> int:
    modules = {name.replace("_", "-"): _module(name) for name in _needed(words)}
    args = _parser(modules).parse_args(words)
    return int(modules[args.command].run(args))


def exit_code(work: Callable[[], int]) -> int:
    """Run a command and return its exit code.

    An error that a user can correct is printed as one sentence on stderr.
    """
    try:
        code = work()
        sys.stdout.flush()
        return code
    except RopeTwinError as error:
        sys.stderr.write(f"{error}\n")
        return ExitCode.ERROR
    except KeyboardInterrupt:
        return ExitCode.INTERRUPTED
    except BrokenPipeError:
        return _silenced(ExitCode.ERROR)  # the reader of our output has closed it
    except OSError as error:
        # Commands report on the files that they know; this is about the rest: a full disk or the
        # output itself.
        where, why = error.filename or "output", error.strerror or str(error)
        sys.stderr.write(f"{phrase(str(where), why, 'free space there, or name another place')}\n")
        return _silenced(ExitCode.ERROR)


def _silenced(code: int) -> int:
    """Return the exit code and discard what is still to be written: nobody can take it."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return code


def _needed(words: list[str]) -> tuple[str, ...]:
    """Return the commands to load: the one on the command line, none for --version, else all."""
    if words[:1] == ["--version"]:
        return ()
    asked = words[0].replace("-", "_") if words else ""
    return (asked,) if asked in COMMANDS else COMMANDS


def _module(name: str) -> ModuleType:
    return importlib.import_module(f"rope_twin.cli.{MODULES.get(name, name)}")


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of the whole command line, without side effects."""
    return _parser({name.replace("_", "-"): _module(name) for name in COMMANDS})


def _parser(modules: dict[str, ModuleType]) -> argparse.ArgumentParser:
    parser = CommandLine(
        prog="rope_twin", description=DESCRIPTION, epilog=_epilog(), formatter_class=HelpFormatter
    )
    parser.add_argument(
        "--version",
        action=_Version,
        nargs=0,
        default=argparse.SUPPRESS,
        help="print versions of solver, numba and ROS",
    )
    subparsers = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for module in modules.values():
        module.add_parser(subparsers)
    return parser


def _epilog() -> str:
    """Return the examples and the table of exit codes."""
    indent = " " * 6
    codes = [
        textwrap.fill(about, 76, initial_indent=f"  {code:<4}", subsequent_indent=indent)
        for code, about in MEANINGS.items()
    ]
    return "\n".join([EXAMPLES, "", "exit codes:", *codes])


class _Version(argparse.Action):
    """Prints the versions and ends the program."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any, **__: Any) -> None:
        from rope_twin.cli.doctor import version_text

        print(version_text())
        parser.exit()
