"""The command line as its own parser describes it."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator

from markdown import code, prose, table

from rope_twin import cli


def _below(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    """Return the sub-commands of a parser by name."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            return dict(action.choices)
    return {}


def _helps(parser: argparse.ArgumentParser) -> dict[str, str]:
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            return {one.dest: one.help or "" for one in action._choices_actions}
    return {}


def overview() -> str:
    """Return a table of the commands with what each does."""
    rows = (
        (f"[`rope_twin {name}`](#rope-twin-{name})", prose(about))
        for name, about in _helps(cli.build_parser()).items()
    )
    return table(("command", "purpose"), rows)


def reference() -> str:
    """Return a section for each command: usage, arguments, options."""
    return "\n\n".join(
        "\n\n".join(_section(name, parser, 2))
        for name, parser in _below(cli.build_parser()).items()
    )


def _section(name: str, parser: argparse.ArgumentParser, level: int) -> Iterator[str]:
    """Yield the Markdown of a command and of its sub-commands."""
    anchor = parser.prog.replace(" ", "-").replace("_", "-")
    yield f"({anchor})="
    yield f"{'#' * level} {parser.prog.replace('_', chr(92) + '_')}"
    yield f"```text\n{_usage(parser)}\n```"
    if parser.description:
        yield _paragraphs(parser.description)
    for group in parser._action_groups:
        shown = [one for one in group._group_actions if _is_shown(one)]
        if shown:
            head = (group.title or "options", "meaning")
            yield table(head, ((_names(one), _about(parser, one)) for one in shown))
    if parser.epilog:
        yield f"```text\n{parser.epilog.strip()}\n```"
    for below, inner in _below(parser).items():
        yield from _section(below, inner, level + 1)


def _usage(parser: argparse.ArgumentParser) -> str:
    usage = parser.format_usage().removeprefix("usage: ")
    return re.sub(r"\n +", "\n    ", usage.strip())


def _paragraphs(text: str) -> str:
    return "\n\n".join(prose(" ".join(one.split())) for one in text.split("\n\n"))


def _is_shown(action: argparse.Action) -> bool:
    hidden = isinstance(action, argparse._HelpAction | argparse._SubParsersAction)
    return not hidden and action.help != argparse.SUPPRESS


def _names(action: argparse.Action) -> str:
    if not action.option_strings:
        return code(str(action.metavar or action.dest))
    value = ""
    if action.nargs != 0:
        value = f" {action.metavar or action.dest.upper()}"
    return ", ".join(code(f"{one}{value}") for one in action.option_strings)


def _about(parser: argparse.ArgumentParser, action: argparse.Action) -> str:
    expanded = parser._get_formatter()._expand_help(action)
    if action.choices and not action.metavar:
        expanded += f" ({', '.join(str(one) for one in action.choices)})"
    return prose(expanded)
