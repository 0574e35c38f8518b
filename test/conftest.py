"""Test session: parallel on all cores, and property tests with the same examples in each run.

Nothing is inherited of the terminal that they are started from: not its width, not its colours. Nor
is a wish for no bytecode: each worker and each of some hundred processes would make its own.

`--hypothesis-profile=search` tries new examples; `-n 0` runs one test after the other.
"""

from __future__ import annotations

import gc
import os
import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, settings

ROS = Path(__file__).parent / "ros"
# validation/ and benchmarks/ are not installed. Last, so that an installed rope_twin is tested.
sys.path.append(str(Path(__file__).resolve().parents[1]))
sys.path.append(str(Path(__file__).resolve().parent / "support"))  # fixtures of several folders
# Files whose entries reach the same kernels: of a step read as assembly or in lanes, of ropes that
# meet, of imported models, of water that changes, of every scene. Side by side two of them would
# compile the same code at the same moment.
ALIKE = {
    "test_compiled_effects.py": "assembly",
    "test_bench_command.py": "assembly",
    "test_ensemble_speed.py": "assembly",
    "test_cut_joined.py": "joined",
    "test_joined_energy.py": "joined",
    "test_joined_bending.py": "joined",
    "test_depth_profiles.py": "profiles",
    "test_fluid_ramp.py": "profiles",
    "test_current_and_drag.py": "profiles",
    "test_payload_shedding.py": "profiles",
    "test_moordyn.py": "imported",
    "test_orcaflex.py": "imported",
    "test_oscillating_drag.py": "oscillating",
    "test_payload_oscillation.py": "oscillating",
    "test_golden_states.py": "scenes",
    "test_scenes_run.py": "scenes",
}
# The groups that take longest, in the order in which they are begun.
FIRST = (
    "ros",
    "scenes",
    "test_effects.py",
    "test_snippets.py",
    "assembly",
    "test_accuracy_study.py",
    "test_cut_body_twin.py",
)

for name in ("COLUMNS", "LINES", "NO_COLOR", "FORCE_COLOR", "PYTHONWARNINGS",
             "PYTHONDONTWRITEBYTECODE"):  # fmt: skip
    os.environ.pop(name, None)

# Thousands of tests and of types stay: to look through them at every 700 new objects takes 4 %.
gc.set_threshold(50_000, 20, 50)

# A counterexample is printed as found: shrinking it takes minutes where an example is a simulation.
PHASES = (Phase.explicit, Phase.reuse, Phase.generate)
# How long a machine takes for an example is nothing that a test is about.
UNTIMED = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("repeated", UNTIMED, derandomize=True, database=None, phases=PHASES)
settings.register_profile("search", UNTIMED, print_blob=True)
settings.load_profile("repeated")


def pytest_xdist_auto_num_workers() -> int:
    """One worker more than there are cores: the tests over ROS mostly wait for processes."""
    return (os.cpu_count() or 1) + 1


@pytest.hookimpl(tryfirst=True)  # before xdist, which reads the groups in the same hook
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """A file's tests share a worker and its fixtures; those over ROS all share one.

    They start processes of their own, whose pace should not depend on each other. So do files that
    compile the same kernels into entries of their own: a worker translates a kernel once.

    Groups are handed out in the order of their first tests, and a worker takes its next one while
    it still has two tests to run. So the long ones come first: none is left to one worker alone.
    """
    place = {group: number for number, group in enumerate(FIRST)}
    items.sort(key=lambda item: place.get(_group(item.path), len(FIRST)))
    for item in items:
        item.add_marker(pytest.mark.xdist_group(_group(item.path)))


def _group(path: Path) -> str:
    """Return the group of a test file, whose tests share a worker."""
    return "ros" if ROS in path.parents else ALIKE.get(path.name, path.name)
