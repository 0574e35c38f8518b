"""A mutated scene loads or is rejected in one sentence; nothing else is ever raised."""

import copy
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scene_text import GOOD, written

from rope_twin.errors import SceneError
from rope_twin.scene.load import load_scene
from rope_twin.scene.rope_warnings import sense_checks

QUICK = settings(
    max_examples=150,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
TREE = yaml.safe_load(GOOD)

scalars = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(max_size=12),
    st.sampled_from(["1e5", "no", "010", "1:30", "tool", "hoist", "weight", "payload", ".nan", ""]),
    st.sampled_from([0, 0.0, 1, -1, 1e-300, 1e300, 10**400, 1e-5, 0.2, 500, 1e7]),
)
junk = st.recursive(
    scalars,
    lambda inner: st.one_of(
        st.lists(inner, max_size=3),
        st.dictionaries(st.one_of(st.text(max_size=6), st.sampled_from(["box", "name"])), inner,
                        max_size=3),
    ),
    max_leaves=6,
)  # fmt: skip


def paths(tree: Any, prefix: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return the path to every value of a tree of mappings and lists."""
    pairs = tree.items() if isinstance(tree, dict) else enumerate(tree)
    found = []
    for key, value in pairs:
        found.append((*prefix, key))
        if isinstance(value, dict | list):
            found += paths(value, (*prefix, key))
    return found


PATHS = paths(TREE)


def parent_of(tree: Any, path: tuple[Any, ...]) -> Any:
    for key in path[:-1]:
        tree = tree[key]
    return tree


def loads_or_says_why(text: str | bytes, folder: Path) -> None:
    path = written(folder, text)
    refusals: list[str] = []
    warnings: list[str] = []
    try:
        warnings = sense_checks(load_scene(path))
    except SceneError as error:
        refusals = [str(error), *error.every]
    assert not refusals or refusals[0] in refusals[1:]
    assert all(words.startswith((f"{path}: ", f"{path}, line ")) for words in refusals)
    assert all("\n" not in words and "; " in words for words in (*refusals, *warnings))


@QUICK
@given(path=st.sampled_from(PATHS), value=junk)
def test_any_replaced_value_loads_or_is_rejected(
    path: tuple[Any, ...], value: Any, tmp_path: Path
) -> None:
    tree = copy.deepcopy(TREE)
    parent_of(tree, path)[path[-1]] = value
    loads_or_says_why(yaml.safe_dump(tree, allow_unicode=True), tmp_path)


@QUICK
@given(changes=st.lists(st.tuples(st.sampled_from(PATHS), junk), min_size=2, max_size=5))
def test_several_replaced_values_load_or_are_rejected(
    changes: list[tuple[Any, Any]], tmp_path: Path
) -> None:
    """Rules that rely on broken ones do not raise anything else."""
    tree = copy.deepcopy(TREE)
    for path, value in changes:
        try:
            parent = parent_of(tree, path)
            parent[path[-1]] = value
        except (LookupError, TypeError):
            continue  # an earlier change has taken its parent away
    loads_or_says_why(yaml.safe_dump(tree, allow_unicode=True), tmp_path)


@pytest.mark.parametrize("path", PATHS, ids=str)
def test_any_deleted_key_loads_or_is_rejected(path: tuple[Any, ...], tmp_path: Path) -> None:
    tree = copy.deepcopy(TREE)
    del parent_of(tree, path)[path[-1]]
    loads_or_says_why(yaml.safe_dump(tree), tmp_path)


@QUICK
@given(
    path=st.sampled_from([path for path in PATHS if isinstance(path[-1], str)]),
    name=st.one_of(st.text(max_size=10), st.integers(), st.booleans(), st.none()),
)
def test_any_renamed_key_loads_or_is_rejected(
    path: tuple[Any, ...], name: Any, tmp_path: Path
) -> None:
    tree = copy.deepcopy(TREE)
    parent = parent_of(tree, path)
    parent[name] = parent.pop(path[-1])
    loads_or_says_why(yaml.safe_dump(tree, allow_unicode=True), tmp_path)


@QUICK
@given(
    start=st.integers(0, len(GOOD)),
    removed=st.integers(0, 40),
    inserted=st.text(alphabet=st.sampled_from("[]{}:,-*&!|>'\"#?%@`\t\n ab10.~<e"), max_size=8),
)
def test_any_mangled_text_loads_or_is_rejected(
    start: int, removed: int, inserted: str, tmp_path: Path
) -> None:
    loads_or_says_why(GOOD[:start] + inserted + GOOD[start + removed :], tmp_path)


@QUICK
@given(data=st.binary(max_size=200))
def test_any_bytes_load_or_are_rejected(data: bytes, tmp_path: Path) -> None:
    loads_or_says_why(data, tmp_path)
