"""`python -m benchmarks band`: its rows on docs/error_band.md, and which scenes are among them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks import band, band_page
from benchmarks.__main__ import main
from benchmarks.band import BandRow
from rope_twin.errors import InputError
from rope_twin.scene.load import scene_names

DOCS = Path(__file__).resolve().parents[2] / "docs"


def test_every_scene_but_one_is_measured_and_held() -> None:
    """docs/error_band.md has a row for each but one in which nothing moves, and says what it holds.

    The rows stand in a file beside the page; that they are what a run finds is the test above.
    """
    rows = band_page.read_rows(DOCS)
    assert {row.scene for row in rows} == set(scene_names()) - {"still_water"}
    assert all(row.ok for row in rows)
    page = (DOCS / band_page.PAGE).read_text(encoding="utf-8")
    assert f"{band_page.BEGIN}\n{band_page.as_section(rows)}\n{band_page.END}" in page


def row_of(scene: str, held_pct: float = 97.0, ratio: float = 3.0) -> BandRow:
    return BandRow(scene, 60.0, 50, 0.01, 2.5e4, 0.53, 0.0034, 1.6, ratio, held_pct, 98.0, 48.6, 4)


def test_rows_are_kept_on_the_page_as_they_are_found(tmp_path: Path) -> None:
    page = tmp_path / band_page.PAGE
    with pytest.raises(InputError, match=r"it has no lines .*; give a folder with"):
        band_page.keep_rows([row_of("storm")], tmp_path)
    page.write_text(f"before\n{band_page.BEGIN}\nold\n{band_page.END}\nafter\n")
    band_page.keep_rows([row_of("storm")], tmp_path)
    band_page.keep_rows([row_of("landing", held_pct=94.96), row_of("grab_lift")], tmp_path)
    band_page.keep_rows([row_of("storm", ratio=2.0)], tmp_path)
    text = page.read_text()
    assert text.startswith("before\n")
    assert text.endswith("\nafter\n")
    assert "2 of 3 scenes are held" in text
    assert "Not so: landing." in text
    assert "| storm | 60 | 25 | 0.53 | 0.0034 | 1.6 | 2.0 | 97.0 | 98.0 | 49 | x 4 |" in text
    assert (
        text.index("| storm |")
        < text.index("| landing |")
        < text.index("later")
        < text.index("| grab_lift |")
    )
    (tmp_path / band_page.STORED).write_text('{"rows": [{"scene": "storm"}]}')
    with pytest.raises(InputError, match=r"error_band\.json: it holds no rows .*; delete it and"):
        band_page.read_rows(tmp_path)


@pytest.mark.parametrize(
    ("held_pct", "ratio", "code"), [(95.0, 5.0, 0), (94.9, 3.0, 1), (99.0, 5.1, 1)]
)
def test_the_command_writes_the_page_and_says_whether_all_are_held(
    held_pct: float,
    ratio: float,
    code: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(band, "measure_band", lambda case: row_of(case.scene, held_pct, ratio))
    (tmp_path / band_page.PAGE).write_text(f"{band_page.BEGIN}\n{band_page.END}\n")
    words = ["band", "ship_6dof", "storm", "--into", str(tmp_path)]
    assert main([*words, "--json"]) == code
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [row["scene"] for row in rows] == ["storm", "ship_6dof"]
    assert [row.scene for row in band_page.read_rows(tmp_path)] == ["storm", "ship_6dof"]
    assert main(["band", "strom"]) == 1
    assert "did you mean 'storm'?" in capsys.readouterr().err
