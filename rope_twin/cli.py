"""The door: `rope_twin COMMAND ...`. Each command is a module of rope_twin.commands."""

from __future__ import annotations

import argparse
import contextlib
import importlib
import importlib.metadata
import os
import re
import sys
from collections.abc import Callable, Sequence
from functools import partial
from types import ModuleType
from typing import TYPE_CHECKING, Any, NoReturn

from rope_twin.errors import RopeTwinError, did_you_mean, phrase

if TYPE_CHECKING:
    from rope_twin.run.options import RunOptions
    from rope_twin.run.progress import FigureProgress
    from rope_twin.run.summary import RunSummary

# The commands in the order of the help: module name (with _) and name on the command line (with -).
COMMANDS = (
    "run", "ensemble", "scene", "view", "recover", "replay", "sea_state", "state", "modes",
    "accuracy", "viv", "study", "lines", "faults",
)  # fmt: skip


_CHOICE = re.compile(r"argument (.+): invalid choice: (\S+) \(choose from (.*)\)")
_NUMBER = re.compile(r"argument (\S+): invalid (int|float) value: (.*)")
_MINUS = "(a value that begins with - stands behind =, like --at=-1)"


class CommandLine(argparse.ArgumentParser):
    """A parser that says in one sentence what is wrong, without the usage. Exit code 2."""

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> tuple[Any, list[str]]:
        """As ever, but each command itself refuses what it does not know."""
        found, left = super().parse_known_args(args, namespace)
        if left:
            known = re.findall(r"--[a-z-]+", self.format_usage())
            hint = f"; {did_you_mean(left[0], known)}" if left[0].startswith("--") else ""
            self.error(f"it takes no {' '.join(left)}{hint}")
        return found, left

    def error(self, message: str) -> NoReturn:
        """End the program."""
        if found := _CHOICE.fullmatch(message):
            where = f"{found[1]}: " if found[1].startswith("-") else ""
            asked, *known = (word.strip("'") for word in (found[2], *found[3].split(", ")))
            message = f"{where}there is no '{asked}'; {did_you_mean(asked, known)}"
        elif found := _NUMBER.fullmatch(message):
            wanted = "whole number" if found[2] == "int" else "number"
            message = f"{found[1]}: {found[3]} is no {wanted}"
        elif message.endswith("expected one argument"):
            message = f"{message} {_MINUS}"
        message = message.removeprefix("argument ").rstrip("?")
        self.exit(2, f"{self.prog}: {message}; see `{self.prog} --help`.\n")


def main(argv: Sequence[str] | None = None) -> int:
    """Read the command line, run the command, return its exit code.

    What a user can mend is one sentence on stderr and exit code 1; 2 if the command line makes no
    sense by itself.
    """
    return exit_code(partial(_command, list(sys.argv[1:] if argv is None else argv)))


def _command(words: list[str]) -> int:
    modules = {name.replace("_", "-"): _module(name) for name in _needed(words)}
    args = _parser(modules).parse_args(words)
    if args.command == "run":
        return int(modules["run"].run(args, _paced))
    return int(modules[args.command].run(args))


def exit_code(work: Callable[[], int]) -> int:
    """Run a command and return its exit code; an error that a user can correct is 1.

    The error is printed as one sentence on stderr. An interrupt is 130.
    """
    try:
        code = work()
        sys.stdout.flush()
        return code
    except RopeTwinError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:
        return _silenced(1)  # whoever read our output has gone
    except OSError as error:
        # Commands tell of the files that they know; this is of what is left: a full disk or the
        # output itself.
        where, why = error.filename or "output", error.strerror or str(error)
        sys.stderr.write(f"{phrase(str(where), why, 'make room there, or name another place')}\n")
        return _silenced(1)


def _silenced(code: int) -> int:
    """The exit code, with what still waits to be written thrown away: nobody can take it."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return code


def _needed(words: list[str]) -> tuple[str, ...]:
    """The commands to load: the one that is asked for, none for --version, all for the help."""
    if words[:1] == ["--version"]:
        return ()
    asked = words[0].replace("-", "_") if words else ""
    return (asked,) if asked in COMMANDS else COMMANDS


def _module(name: str) -> ModuleType:
    return importlib.import_module(f"rope_twin.commands.{name}")


def _parser(modules: dict[str, ModuleType]) -> argparse.ArgumentParser:
    parser = CommandLine(
        prog="rope_twin", description="A real-time digital twin of the lifting rope, on ROS 2."
    )
    parser.add_argument("--version", action="version", version=f"rope_twin {_version()}")
    subparsers = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for module in modules.values():
        module.add_parser(subparsers)
    return parser


def _version() -> str:
    try:
        return importlib.metadata.version("rope_twin")
    except importlib.metadata.PackageNotFoundError:
        return "(not installed)"


def _paced(options: RunOptions, progress: FigureProgress) -> RunSummary:
    """The ROS suite, imported only when a paced run asks for it."""
    if options.processes:
        from rope_twin.ros.processes import run_processes

        return run_processes(options, progress)
    from rope_twin.ros.suite import run_suite

    return run_suite(options, progress)


if __name__ == "__main__":
    sys.exit(main())
