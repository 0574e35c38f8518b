"""The help of every command: examples that parse, options that are one word for one thing."""

from __future__ import annotations

import argparse
import json
import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest

from rope_twin.cli import MEANINGS, ExitCode, build_parser, main
from rope_twin.planning.plan_reader import read_plan
from rope_twin.planning.run import cell_named
from rope_twin.run.options import leaf_parsers

PARSER = build_parser()
COMMANDS = list(leaf_parsers(PARSER))
CHEAP = ("scene list", "scene keys", "scene show deep_lift", "sea-state info sea_2p5m",
         "completion bash", "scene schema --json")  # fmt: skip
WITHOUT = {"--for", "--into", "--seconds", "--look", "--save", "--from", "--own", "--of", "--csv"}


def examples(parser: argparse.ArgumentParser) -> list[str]:
    """The command lines of its help, without `rope_twin` and where the output goes."""
    found = re.findall(r"^  rope_twin (.+)$", parser.epilog or "", re.MULTILINE)
    return [line.partition(" > ")[0] for line in found]


def options(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    return (action for action in parser._actions if action.option_strings)


@pytest.mark.parametrize("parser", COMMANDS, ids=lambda one: one.prog)
def test_every_command_has_two_or_three_examples_that_parse(
    parser: argparse.ArgumentParser,
) -> None:
    found = examples(parser)
    assert 2 <= len(found) <= 4
    for line in found:
        assert f"rope_twin {line}".startswith(parser.prog.split(" ", 1)[0])
        PARSER.parse_args(shlex.split(line))


def test_cells_of_the_examples_are_those_of_a_shipped_plan() -> None:
    lines = [line for parser in COMMANDS for line in examples(parser) if "--cell" in line]
    found = [PARSER.parse_args(shlex.split(line)) for line in lines]
    shipped = [words for words in found if not words.plan.endswith(".yaml")]
    assert shipped
    for words in shipped:
        cell_named(read_plan(words.plan)[0], words.cell)


@pytest.mark.parametrize("parser", COMMANDS, ids=lambda one: one.prog)
def test_every_option_has_help_and_every_command_can_print_json(
    parser: argparse.ArgumentParser,
) -> None:
    names = {name for action in options(parser) for name in action.option_strings}
    assert "--json" in names
    assert not names & WITHOUT
    assert all(action.help for action in parser._actions)
    assert parser.description
    assert parser.description[0].isupper()
    assert parser.format_help()


def test_one_option_means_one_kind_of_value_everywhere() -> None:
    """A path for --out, a time for --duration, a number of workers for --jobs."""
    types: dict[str, set[object]] = {}
    for parser in COMMANDS:
        for action in options(parser):
            for name in action.option_strings:
                kind = action.nargs if action.type is None else action.type
                types.setdefault(name, set()).add(getattr(kind, "__qualname__", kind))
    assert {name for name, kinds in types.items() if len(kinds) > 1} == {
        "--sea-offset"  # a time, or a range of times for an ensemble
    }


@pytest.mark.parametrize("line", CHEAP)
def test_cheap_examples_run(line: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert any(line in examples(parser) for parser in COMMANDS)
    assert main(line.split()) == 0
    assert capsys.readouterr().out


@pytest.mark.parametrize(
    "line",
    ["scene list", "scene keys winch.drum", "scene show deep_lift", "scene show bridle_lift",
     "scene check still_water", "sea-state info sea_2p5m", "completion fish", "scene schema",
     "accuracy --status"],
)  # fmt: skip
def test_json_is_one_object_and_nothing_else(line: str, capsys: pytest.CaptureFixture[str]) -> None:
    main([*line.split(), "--json"])
    assert isinstance(json.loads(capsys.readouterr().out), dict)


def test_the_main_help_has_every_exit_code_and_every_command() -> None:
    words = PARSER.format_help()
    assert set(MEANINGS) == set(ExitCode)
    for code, meaning in MEANINGS.items():
        assert f"  {code:<4}{meaning.split()[0]}" in words
    page = Path("docs/reference/exit_codes.md").read_text(encoding="utf-8")
    (row,) = re.findall(r"^\| 3 \|(.+)\|$", page, re.MULTILINE)
    in_page = {words.split()[0] for words in re.findall(r"`(\w[^`]*)`", row)}
    in_help = re.findall(r"\(([a-z][^)]+)\)", MEANINGS[ExitCode.NEGATIVE])
    assert in_page == {one.split()[0] for words in in_help for one in words.split(", ")}
    for parser in COMMANDS:
        assert "NEGATIVE" not in parser.format_help()
        assert re.search(rf"^    {parser.prog.split()[1]}\b", words, re.MULTILINE)
