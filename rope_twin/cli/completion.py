"""`rope_twin completion SHELL`: print a completion script for bash, zsh or fish."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import NamedTuple

from rope_twin.cli import ExitCode, build_parser, print_json
from rope_twin.run.options import add_json
from rope_twin.scene.load import scene_names

EXAMPLES = (
    "completion bash > ~/.local/share/bash-completion/completions/rope_twin",
    "completion zsh > ~/.zsh/completions/_rope_twin",
    "completion fish > ~/.config/fish/completions/rope_twin.fish",
)
MORE = """Completes commands, options, their choices and the names of the shipped scenes. Print the
script again after an update."""


class Command(NamedTuple):
    """One command or action, such as ("scene", "check"), with the words that may follow it."""

    path: tuple[str, ...]
    about: str
    options: tuple[argparse.Action, ...]
    words: tuple[str, ...]  # actions, scenes and other choices


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("shell", metavar="SHELL", choices=tuple(SCRIPTS), help=", ".join(SCRIPTS))
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Print the script for one shell."""
    script = SCRIPTS[args.shell](list(_commands(build_parser(), (), "")))
    if args.json:
        print_json({"shell": args.shell, "script": script})
    else:
        print(script)
    return ExitCode.OK


def _commands(
    parser: argparse.ArgumentParser, path: tuple[str, ...], about: str
) -> Iterator[Command]:
    """Yield the commands of a parser, itself first."""
    options = tuple(action for action in parser._actions if action.option_strings)
    words: list[str] = []
    nested: list[Command] = []
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            abouts = {choice.dest: choice.help or "" for choice in action._choices_actions}
            for name, child in action.choices.items():
                nested += _commands(child, (*path, name), abouts[name])
        if action.option_strings:
            continue
        words += [str(value) for value in action.choices or ()]
        words += scene_names() if action.dest == "scene" else []
    yield Command(path, about, options, tuple(words))
    yield from nested


def _bash(commands: list[Command]) -> str:
    cases = []
    for command in commands:
        names = [name for option in command.options for name in option.option_strings]
        cases.append(
            f'        "{" ".join(command.path)}") words="{" ".join([*command.words, *names])}" ;;'
        )
        for option in command.options:
            if option.nargs != 0:  # it takes a value: one of its choices, or perhaps a file
                key = " ".join((*command.path, option.option_strings[-1]))
                choices = " ".join(str(choice) for choice in option.choices or ())
                cases.append(f'        "{key}") words="{choices}" ;;')
    actions = {command.path[0] for command in commands if len(command.path) == 2}
    return "\n".join(
        (
            "# completion of rope_twin for bash",
            "_rope_twin() {",
            '    local key="" words="" previous="${COMP_WORDS[COMP_CWORD-1]}"',
            '    [ "$COMP_CWORD" -gt 1 ] && key="${COMP_WORDS[1]}"',
            f'    case "$key" in {"|".join(sorted(actions))})',
            '        [ "$COMP_CWORD" -gt 2 ] && key="$key ${COMP_WORDS[2]}" ;;',
            "    esac",
            "    _rope_twin_words",
            '    case "$previous" in --*)',
            '        key="$key $previous"',
            "        _rope_twin_words ;;",
            "    esac",
            '    COMPREPLY=($(compgen -W "$words" -- "${COMP_WORDS[COMP_CWORD]}"))',
            "}",
            "_rope_twin_words() {",
            '    case "$key" in',
            *cases,
            "    esac",
            "}",
            "complete -o default -F _rope_twin rope_twin",
        )
    )


def _zsh(commands: list[Command]) -> str:
    """Return the script for bash, which zsh runs by its own emulation."""
    return f"#compdef rope_twin\nautoload -U +X bashcompinit && bashcompinit\n{_bash(commands)}"


def _fish(commands: list[Command]) -> str:
    lines = ["# completion of rope_twin for fish"]
    for command in commands:
        conditions = [f"__fish_seen_subcommand_from {word}" for word in command.path]
        condition = "; and ".join(conditions) or "__fish_use_subcommand"
        nested = [
            subcommand
            for subcommand in commands
            if subcommand.path[:-1] == command.path and subcommand.path
        ]
        names = " ".join(subcommand.path[-1] for subcommand in nested)
        first = (
            f"{condition}; and not __fish_seen_subcommand_from {names}" if conditions else condition
        )
        for subcommand in nested:
            about = _quoted(subcommand.about)
            lines.append(f"complete -c rope_twin -n '{first}' -fa {subcommand.path[-1]} -d {about}")
        if command.words and not nested:
            lines.append(
                f"complete -c rope_twin -n '{condition}' -a {_quoted(' '.join(command.words))}"
            )
        lines += [
            f"complete -c rope_twin -n '{condition}' {_fish_option(option)}"
            for option in command.options
        ]
    return "\n".join(lines)


def _fish_option(option: argparse.Action) -> str:
    names = " ".join(
        f"-l {name[2:]}" if name.startswith("--") else f"-s {name[1:]}"
        for name in option.option_strings
    )
    value = "" if option.nargs == 0 else " -r"
    if option.choices:
        value += f" -fa {_quoted(' '.join(str(choice) for choice in option.choices))}"
    about = (option.help or "").replace("%%", "%").partition(" (default: %(")[0]
    return f"{names}{value} -d {_quoted(about)}"


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace("'", "\\'")
    return f"'{escaped}'"


SCRIPTS = {"bash": _bash, "zsh": _zsh, "fish": _fish}
