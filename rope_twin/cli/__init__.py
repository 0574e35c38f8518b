"""The command line `rope_twin COMMAND ...`; modules of this package define commands in COMMANDS.

Commands share the exit codes and the forms of output that are here.
"""

from __future__ import annotations

import argparse
import contextlib
import gc
import importlib
import json
import os
import re
import sys
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from enum import IntEnum
from functools import partial
from typing import Any, NamedTuple, NoReturn, TextIO

from rope_twin.errors import RopeTwinError, did_you_mean, phrase
from rope_twin.quantity import json_value
from rope_twin.run.options import HelpFormatter, add_command
from rope_twin.run.progress import FigureProgress

DESCRIPTION = """Real-time simulator of winch, wire and payload for subsea lifting, on ROS 2.

Durations, lengths, speeds and rates take a unit (90s, 2min, 1.5km) or are plain SI numbers. With
--json a command prints one JSON object on stdout and nothing else there; progress, warnings and
errors go to stderr."""
EXAMPLES = """examples:
  rope_twin run deep_lift --duration 90s
  rope_twin scene list
  rope_twin COMMAND --help"""

# The commands in the order of the help, and what each is for.
COMMANDS = {
    "run": "simulate a scene in real time over ROS 2, or as fast as possible without it",
    "scene": "list, show, check and measure scenes; look up keys; print the JSON Schema; "
    "import, export",
    "view": "show a recorded bag in the rerun viewer, or save it as a recording or picture",
    "replay": "list the sessions of a bag, or run it again and compare every published number",
    "export": "write the time series of a bag as CSV, Parquet or netCDF",
    "recover": "recover the messages of a bag whose recording was cut off",
    "ensemble": "Monte Carlo or grid of many lifts at once; quantiles of top tension and slack",
    "study": "parameter study: many runs of a scene over seas, ropes and coefficients",
    "plan": "lift planning: limiting sea states, load chart and report of an operation",
    "sensitivity": "which uncertain data of a plan is worth measuring (Morris, Sobol)",
    "operability": "share of time within limiting sea states, weather windows, waiting, by month",
    "modes": "natural frequencies and mode shapes of a scene's lines",
    "viv": "lock-in, VIV response and fatigue damage of a line in its current profile",
    "accuracy": "convergence study: error, speed and memory over mesh and time step",
    "lines": "two lines around one sheave, calm and in a sea state: tension, clearance, crossings",
    "alerts": "alerts of a recording and their rates, or alert sentences of a running suite",
    "faults": "inject faults into every input: what is flagged, how soon, and the error it causes",
    "learn": "learn weight, mass, drag and stiffness of a recorded lift from its measured tension",
    "ahead": "forecast of tension, risk and quiet windows over the next minute; orders compared",
    "sea-state": "create a recorded sea state from a wave spectrum, or describe one",
    "feed": "read line monitors and motion sensors: print, publish or simulate them",
    "console": "serve the operator console of a running suite, or of a recorded run, as a web page",
    "state": "describe a saved state and check that it is intact",
    "doctor": "check this machine: ROS, DDS, graphics, clocks, CPU, compile cache, disk",
    "completion": "print a completion script for bash, zsh or fish",
}

# Commands whose module has another name.
MODULES = {
    "displays": ("view", "console"),
    "ensembles": ("ensemble", "study"),
    "installation": ("doctor", "completion"),
    "line_analysis": ("modes", "viv", "lines"),
    "plans": ("plan", "sensitivity"),
    "recorded_lifts": ("learn", "ahead"),
    "recordings": ("replay", "export", "recover", "alerts", "state"),
    "sea_state": ("sea-state",),
}

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as in the nodes; read when numpy is loaded

_CHOICE = re.compile(r"argument (.+): invalid choice: (\S+) \(choose from (.*)\)")
_NUMBER = re.compile(r"argument (\S+): invalid (int|float) value: (.*)")
_MINUS = "(write a value that begins with - after =, like --at=-1)"


class Command(NamedTuple):
    """A command; `examples` (without `rope_twin`) and `more` complete its help."""

    add_arguments: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace], int]  # returns an ExitCode
    examples: Sequence[str]
    more: str = ""


class ExitCode(IntEnum):
    """Exit code of a command, by its meaning."""

    OK = 0
    ERROR = 1
    USAGE = 2
    NEGATIVE = 3
    LIMIT = 4
    INTERRUPTED = 130


MEANINGS = {
    ExitCode.OK: "success",
    ExitCode.ERROR: "error, reported in one sentence on stderr; no or incomplete output; a scene "
    "that is invalid or exceeds a limit in static equilibrium (scene check)",
    ExitCode.USAGE: "invalid command line, reported in one sentence on stderr",
    ExitCode.NEGATIVE: "completed with a negative result: messages lost (recover), a difference "
    "(replay --verify), runs that stopped early (ensemble, study), a cell without a sea state "
    "that meets the criteria (plan), a fault of a sensor or the lift (learn), one not flagged in "
    "time (faults), more alarms than EEMUA 191 allows (alerts), an error target missed (accuracy "
    "--within), a convergence study missing or out of date (accuracy --status), a check with ERROR "
    "(doctor)",
    ExitCode.LIMIT: "a limit of the scene was exceeded (run, unless --allow-overload)",
    ExitCode.INTERRUPTED: "interrupted (Ctrl-C) before there was a result",
}


def print_json(content: Mapping[str, Any]) -> None:
    """Print the one object of `--json`; numbers that JSON does not have are null."""
    print(json.dumps(json_value(content), ensure_ascii=False, allow_nan=False))


def print_table(rows: Sequence[Sequence[str]], words_last: bool = False) -> None:
    """Print columns as wide as their widest cell, the first left-, the others right-aligned.

    A last column of words is left-aligned too.
    """
    widths = [max(len(cell) for cell in column) for column in zip(*rows, strict=True)]
    for line in _aligned(rows, widths, words_last):
        print(line)


def _aligned(rows: Sequence[Sequence[str]], widths: list[int], words_last: bool) -> Iterator[str]:
    for row in rows:
        cells = [row[0].ljust(widths[0])]
        cells += [cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True)]
        if words_last:
            cells[-1] = row[-1]
        yield "  ".join(cells).rstrip()


class CaseProgress:
    """One changing line on a terminal, a line per case elsewhere; on standard error."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._line = FigureProgress(stream)

    def show(self, done: int, total: int, label: str) -> None:
        """Show that `done` of `total` cases are done and `label` is next."""
        bar = "#" * round(20 * done / total)
        self._line.show(f"[{bar:<20}] {done}/{total} {label}")
        if done == total:
            self._line.finish()


class CommandLine(argparse.ArgumentParser):
    """A parser that reports an error in one sentence, without the usage."""

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> tuple[Any, list[str]]:
        """Parse as argparse does, but let each command itself reject unknown words."""
        parsed, unknown = super().parse_known_args(args, namespace)
        if unknown:
            known = re.findall(r"--[a-z-]+", self.format_usage())
            hint = f"; {did_you_mean(unknown[0], known)}" if unknown[0].startswith("--") else ""
            self.error(f"unknown argument {' '.join(unknown)}{hint}")
        return parsed, unknown

    def error(self, message: str) -> NoReturn:
        """End the program."""
        if match := _CHOICE.fullmatch(message):
            where = f"{match[1]}: " if match[1].startswith("-") else ""
            choice, *known = (word.strip("'") for word in (match[2], *match[3].split(", ")))
            message = f"{where}there is no '{choice}'; {did_you_mean(choice, known)}"
        elif match := _NUMBER.fullmatch(message):
            expected = "whole number" if match[2] == "int" else "number"
            message = f"{match[1]}: {match[3]} is not a {expected}"
        elif message.endswith("expected one argument"):
            message = f"{message} {_MINUS}"
        message = message.removeprefix("argument ").rstrip("?")
        self.exit(ExitCode.USAGE, f"{self.prog}: {message}; see `{self.prog} --help`.\n")


# Imports make objects that stay: at Python's own 700 a tenth of a start is the search among them.
_NEW_OBJECTS = 50_000


def main(argv: Sequence[str] | None = None) -> int:
    """Read the command line, run the command and return its exit code (ExitCode)."""
    gc.set_threshold(_NEW_OBJECTS)
    return exit_code(partial(_run, list(sys.argv[1:] if argv is None else argv)))


def _run(words: list[str]) -> int:
    name = next((word for word in words if not word.startswith("-")), "")
    commands = {name: _command(name)} if name in COMMANDS else {}
    args = _parser(commands).parse_args(words)
    return int(commands[args.command].run(args))


def exit_code(work: Callable[[], int]) -> int:
    """Run a command and return its exit code.

    An error that a user can correct is printed as one sentence on stderr.
    """
    was_ignored = list[KeyboardInterrupt]()  # by a callback of C, such as the compiler's
    hook = sys.unraisablehook

    def note(report: Any) -> None:
        if isinstance(report.exc_value, KeyboardInterrupt):
            was_ignored.append(report.exc_value)
        else:
            hook(report)

    sys.unraisablehook = note
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
        where, reason = error.filename or "output", error.strerror or str(error)
        sys.stderr.write(
            f"{phrase(str(where), reason, 'free space there, or name another place')}\n"
        )
        return _silenced(ExitCode.ERROR)
    except Exception:
        if not was_ignored:
            raise
        return ExitCode.INTERRUPTED  # the compiler fails without its callback
    finally:
        sys.unraisablehook = hook


def _silenced(code: int) -> int:
    """Return the exit code and discard what is still to be written: nobody can take it."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return code


def _command(name: str) -> Command:
    module_name = next((module for module, names in MODULES.items() if name in names), name)
    module = importlib.import_module(f"rope_twin.cli.{module_name}")
    command: Command = module.COMMANDS[name]
    return command


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of the whole command line, without side effects."""
    return _parser({name: _command(name) for name in COMMANDS})


def _parser(commands: dict[str, Command]) -> argparse.ArgumentParser:
    """Return the parser with these commands; of none, with the names of all, which is quick."""
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
    for name, command in commands.items():
        command.add_arguments(
            add_command(subparsers, name, COMMANDS[name], command.examples, command.more)
        )
    for name, about in () if commands else COMMANDS.items():
        subparsers.add_parser(name, help=about)
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
        from rope_twin.cli.installation import version_text

        print(version_text())
        parser.exit()
