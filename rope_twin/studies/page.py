"""Tables of generated pages, and the machine that their numbers were measured on."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from rope_twin.core.jit.decorators import source_digest
from rope_twin.core.jit.functions import chain


def page_table(rows: Iterable[Sequence[str]]) -> str:
    """Return the lines of a Markdown table; the first row is the head."""
    head, *others = rows
    lines = [f"| {' | '.join(row)} |" for row in (head, *others)]
    return "\n".join([lines[0], f"|{' --- |' * len(head)}", *lines[1:]])


LINKS, REPETITIONS = 1_000_000, 15
_CPUINFO = Path("/proc/cpuinfo")


@dataclass(frozen=True)
class Machine:
    """Properties of the machine that computing times depend on."""

    processor: str
    cores: int  # that this process may use
    load: float  # processes that wanted to run in the last minute, this one included
    multiply_add_ns: float  # one dependent multiply-add; best of REPETITIONS
    python: str
    numba: str
    run: str = ""  # which day, and which solver; empty: not known

    def as_text(self) -> str:
        """Return the properties as one line of text."""
        return (
            f"{self.processor}, {self.cores} cores, load {self.load:.1f}; a dependent multiply-add "
            f"takes {self.multiply_add_ns:.2f} ns; Python {self.python}, numba {self.numba}"
            f"{self.run and '; '}{self.run}"
        )


def this_machine() -> Machine:
    """Query the machine and measure its speed (about 50 ms)."""
    return Machine(
        processor=_processor(),
        cores=len(os.sched_getaffinity(0)),
        load=os.getloadavg()[0],
        multiply_add_ns=_time_chain(),
        python=platform.python_version(),
        numba=importlib.metadata.version("numba"),
        run=f"{datetime.now(UTC).date()}, solver {source_digest()[:8]}",
    )


def _processor() -> str:
    lines = _CPUINFO.read_text().splitlines() if _CPUINFO.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def _time_chain() -> float:
    """Return the shortest time of a link of the benchmark [ns]."""
    chain(1.0, 0.5, 0.5, 1)  # compiled here
    took = []
    for _ in range(REPETITIONS):
        began = time.perf_counter()
        chain(1.0, 0.5, 0.5, LINKS)
        took.append(time.perf_counter() - began)
    return min(took) / LINKS * 1e9
