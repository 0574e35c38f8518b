"""Run the snippets of a documentation page in reading order.

- a `code-block` with a `:caption:` that is a file name is written to that file;
- lines of a `console` block that begin with `$ rope_twin` are run in that folder, each to exit
  code 0 (or that of a line `# exit code N` below it), and the lines below are the output;
- `python` blocks share one namespace; a `text` block with the caption Output right below is what
  they print.

In an output `...` stands for anything.
"""

from __future__ import annotations

import contextlib
import doctest
import io
import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from rope_twin.cli import main

BLOCK = re.compile(
    r"^```(?:\{code-block\} )?(?P<language>\w+)\n"
    r"(?::caption: (?P<caption>[^\n]*)\n\n?)?(?P<text>.*?)^```$",
    re.MULTILINE | re.DOTALL,
)
EXIT = re.compile(r"^# exit code (\d+)\n", re.MULTILINE)
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


class Ran(NamedTuple):
    """A command or program of a page: what it should print, and what it did."""

    source: str
    want: str | None
    got: str
    expected_code: int = 0
    code: int = 0

    def complaint(self) -> str:
        """Return what is wrong, or nothing."""
        if self.code != self.expected_code:
            return f"{self.source}: exit code {self.code}\n{self.got}"
        if self.want is None or doctest.OutputChecker().check_output(self.want, self.got, FLAGS):
            return ""
        return f"{self.source}: printed\n{self.got}\nin place of\n{self.want}"


def run_page(page: Path, folder: Path) -> Iterator[Ran]:
    """Run what a page shows, with `folder` as the working directory."""
    names: dict[str, object] = {"__name__": "__main__"}
    blocks = [found.groupdict() for found in BLOCK.finditer(page.read_text("utf-8"))]
    for block, after in zip(blocks, [*blocks[1:], {}], strict=True):
        with contextlib.chdir(folder):
            if block["language"] == "console":
                yield from _commands(block["text"])
            elif block["language"] == "python":
                want = after.get("text") if after.get("caption") == "Output" else None
                yield _program(block["text"], names, want)
            elif block["caption"] not in (None, "Output"):
                Path(block["caption"]).write_text(block["text"], "utf-8")


def _commands(text: str) -> Iterator[Ran]:
    for part in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]:
        command, _, want = part.partition("\n")
        words = shlex.split(command.partition(" #")[0])
        if words[0] != "rope_twin":
            continue
        exit_code = EXIT.search(want)
        with _captured() as out:
            code = main(words[1:])
        expected = int(exit_code[1]) if exit_code else 0
        yield Ran(command, EXIT.sub("", want) or None, out.getvalue(), expected, code)


def _program(text: str, names: dict[str, object], want: str | None) -> Ran:
    with _captured() as out:
        exec(compile(text, "snippet", "exec"), names)
    return Ran(text, want, out.getvalue())


@contextlib.contextmanager
def _captured() -> Iterator[io.StringIO]:
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(io.StringIO()):
        yield out
