"""Options that several commands share, the types of their values, and the layout of a help page."""

from __future__ import annotations

import argparse
import textwrap
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from rope_twin.quantity import read_quantity

Parsers = Any  # argparse._SubParsersAction: generic only in the type checker's eyes
SCENE = "name of a scene (see `rope_twin scene list`) or path of a scene file"


class HelpFormatter(argparse.HelpFormatter):
    """Paragraphs are wrapped; an indented line, such as an example, stays as it is."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        blocks = []
        for paragraph in text.split("\n\n"):
            lines = paragraph.splitlines()
            if not any(line.startswith("  ") for line in lines):
                lines = textwrap.wrap(" ".join(lines), width)
            blocks.append("\n".join(indent + line for line in lines))
        return "\n\n".join(blocks)


def add_command(
    parsers: Parsers, name: str, about: str, examples: Sequence[str], more: str = ""
) -> argparse.ArgumentParser:
    """Add a command; `about` is its line in the list of commands and begins its own help.

    examples: command lines without `rope_twin`; more: the rest of the description.
    """
    title = about[0].upper() + about[1:]
    parser: argparse.ArgumentParser = parsers.add_parser(
        name,
        help=about,
        description=f"{title}.\n\n{more}" if more else f"{title}.",
        epilog="examples:\n" + "\n".join(f"  rope_twin {line}" for line in examples),
        formatter_class=HelpFormatter,
    )
    return parser


def measure(unit: str) -> Callable[[str], float]:
    """Return the type of an option whose value is a quantity, such as 90s, 2min or 120."""

    def read(words: str) -> float:
        try:
            return read_quantity(words, unit)
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from error

    return read


def add_scene(parser: argparse._ActionsContainer, **more: Any) -> None:
    """Declare the scene."""
    parser.add_argument("scene", metavar="SCENE", **{"help": SCENE, **more})


def add_duration(
    parser: argparse._ActionsContainer, about: str, default: float | None = None
) -> None:
    """Declare how much time is simulated."""
    add_time(parser, "--duration", about, default)


def add_time(
    parser: argparse._ActionsContainer, option: str, about: str, default: float | None = None
) -> None:
    """Declare an option whose value is a time; it is stored in seconds."""
    words = about if default is None else f"{about} (default: {default:g}s)"
    parser.add_argument(option, type=measure("s"), default=default, metavar="TIME", help=words)


def add_out(parser: argparse._ActionsContainer, metavar: str, about: str, **more: Any) -> None:
    """Declare the file or folder that the command writes."""
    parser.add_argument("--out", type=Path, metavar=metavar, help=about, **more)


def add_json(parser: argparse._ActionsContainer) -> None:
    """Declare the output for programs."""
    words = "print one JSON object on stdout in place of text"
    parser.add_argument("--json", action="store_true", help=words)


def leaf_parsers(parser: argparse.ArgumentParser) -> Iterable[argparse.ArgumentParser]:
    """Yield the parsers of all commands that can be run, depth first."""
    nested = [
        action_group
        for action_group in parser._actions
        if isinstance(action_group, argparse._SubParsersAction)
    ]
    if not nested:
        yield parser
    for action in nested:
        for child in action.choices.values():
            yield from leaf_parsers(child)
