"""`python -m benchmarks peers`: decks, errors, the race's rows and page. No time is asserted.

The peers are no dependency: where they are missing the command says how to get them, and that is
what is tested then.
"""

from __future__ import annotations

import importlib.util
import json
import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.__main__ import main
from benchmarks.peers import page as peers_page
from benchmarks.peers import race as peers
from benchmarks.peers.codes import PEERS, Setting, require_peers
from benchmarks.peers.decks import cabledyn_deck, current_table, figures, moordyn_deck
from benchmarks.peers.race import Case, Marks, PeerRace, PeerRow, marks
from rope_twin.errors import InputError
from rope_twin.scene.load import load_scene
from rope_twin.studies.accuracy_study import Machine

ROOT = Path(__file__).resolve().parents[2]
HERE = all(importlib.util.find_spec(name) is not None for name in PEERS)
ROW = PeerRow(
    peer="moordyn", scheme="RK2, 1 ms, 1 of critical", case="smooth_2km", segments=20, seconds=28.0,
    peer_real_time_factor=100.0, peer_error_pct=0.5, elements=20, step_s=0.1,
    real_time_factor=2000.0, error_pct=0.4, ratio=20.0, any_elements=20, any_step_s=0.1,
    any_real_time_factor=2100.0, any_error_pct=0.4, doubt_pct=0.001,
)  # fmt: skip
MACHINE = Machine("a processor", 2, 0.5, 1.0, "3.11", "0.68")


def test_a_missing_peer_is_reported_with_the_way_to_get_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "cabledyn", None)  # an import of it fails from now on
    with pytest.raises(ImportError):
        importlib.import_module("cabledyn")
    with pytest.raises(InputError, match=r"cabledyn, which .* `pip install moordyn==2.7.2 cabled"):
        require_peers()
    assert main(["peers", "--quick"]) == 1
    assert capsys.readouterr().err.count("pip install moordyn==2.7.2 cabledyn==0.3.0") == 1


def test_a_small_race_where_the_peers_are_and_a_refusal_where_they_are_not(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    picture = tmp_path / "race.png"
    code = main(["peers", "--quick", "--json", "--picture", str(picture)])
    shown, said = capfd.readouterr()
    if not HERE:
        assert code == 1
        assert "pip install" in said
        return
    stored = tmp_path / "race.json"
    stored.write_text(shown, encoding="utf-8")  # and nothing that the peers print
    rows = peers_page.read_race(stored).rows
    assert [row.peer for row in rows].count("moordyn") == 2
    assert {row.peer for row in rows} == {"moordyn", "cabledyn"}
    for row in rows:
        assert row.peer_error_pct is not None
        assert row.peer_error_pct < peers.LIMIT_PCT  # three codes agree
        assert row.elements == row.segments == 20
        assert row.error_pct is not None
        assert row.error_pct <= max(row.peer_error_pct, row.doubt_pct)
        assert row.real_time_factor is not None
        assert row.ratio == pytest.approx(row.real_time_factor / row.peer_real_time_factor)
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_a_scene_as_figures() -> None:
    """Scene A of the solver study: 1.2 and 0.01 on 76 mm, 0.8 % of critical, 168 kN at rest."""
    given = figures(load_scene("smooth_2km"))
    assert given.Cdn * given.diameter == pytest.approx(1.2 * 0.076, rel=1e-6)
    assert given.Ca * given.diameter**2 == pytest.approx(0.076**2, rel=1e-5)
    assert given.load_Ca == pytest.approx(1.0, rel=1e-6)
    assert given.wave_speed == pytest.approx(6454.97, rel=1e-6)
    assert given.frequency(1000) == pytest.approx(2.0 * given.wave_speed / 2.0)
    assert given.damping_ratio(1000) == pytest.approx(5e5 * given.wave_speed / (1.5e8 * 2.0))
    pull = (20000.0 - 1025.0 * 2.927) * 9.81 + 0.5 * 0.04 * 2000.0 * 9.81
    assert given.hanging_m == pytest.approx(2000.0 * (1.0 + pull / 1.5e8), rel=1e-7)


def test_decks_say_the_figures() -> None:
    given = figures(load_scene("smooth_2km"))
    ours = moordyn_deck(given, 20, "RK2", -1.0, 0.01).splitlines()
    theirs = cabledyn_deck(given, 20, 0.01, 28.0).splitlines()
    rope = "rope 0.06649946 3.6 150000000.0"
    assert f"{rope} -1.0 0 1.37144 1.306144 0.01142866 0" in ours
    assert f"{rope} 500000.0 0 1.37144 0.01142866 1.306144 0" in theirs
    assert {"1 rope 2 1 2000.0 20 -", "RK2 tScheme", "0.01 dtM", "1 Currents"} <= set(ours)
    assert "profile -2000.0 0.0 0.0 0 0.0 0.5 0.0 0 current" in theirs
    assert current_table(given).splitlines()[3:] == [
        "-2000.0 0 0 0", "0 0.5 0 0", "50.0 0.5 0 0",
    ]  # fmt: skip
    quiet = figures(load_scene("snap_vertical"))
    assert "0 Currents" in moordyn_deck(quiet, 20, "RK2", 5e5, 0.01).splitlines()
    assert "none current" in cabledyn_deck(quiet, 20, 0.01, 28.0).splitlines()


@pytest.mark.parametrize("name", ["riser_300m", "wave_zone"])
def test_what_a_deck_cannot_say_is_refused(name: str) -> None:
    with pytest.raises(
        InputError, match=rf"scene {name}: its .* be written in a deck; take one of"
    ):
        figures(load_scene(name))


def test_errors_are_of_mean_maximum_and_minimum() -> None:
    truth = Marks(100.0, 200.0, 50.0)
    assert truth.error_pct(Marks(101.0, 200.0, 50.0)) == pytest.approx(1.0)
    assert truth.error_pct(Marks(101.0, 206.0, 50.0)) == pytest.approx(3.0)
    assert truth.error_pct(Marks(101.0, 206.0, 48.0)) == pytest.approx(4.0)
    assert Marks(100.0, 200.0, 1.0).error_pct(Marks(100.0, 200.0, 0.0)) == pytest.approx(1.0)
    assert truth.error_pct(Marks(math.nan, 200.0, 50.0)) == math.inf


def test_the_start_is_not_judged_and_a_run_that_ended_early_has_no_error() -> None:
    case = Case("made up", 1, 4.0, 2.0)
    tension = np.array([9.0, 9.0, 1.0, 3.0])
    assert marks(tension, 1.0, case) == Marks(2.0, 3.0, 1.0)
    assert marks(tension[:3], 1.0, case) is None
    assert marks(tension[:0], 1.0, case) is None


def test_a_setting_in_words() -> None:
    assert Setting("Euler", 0.0142, -1.0).words == "Euler, 14.2 ms, 1 of critical"
    assert Setting("RK2", 0.001, 5e5).words == "RK2, 1 ms, 500000 N·s"


def test_the_best_of_a_peer_is_its_fastest_within_the_limit_and_a_loss_is_shown() -> None:
    wrong = replace(ROW, peer_real_time_factor=900.0, peer_error_pct=3.0)
    slow = replace(ROW, peer_real_time_factor=50.0)
    lost = replace(ROW, peer="cabledyn", peer_error_pct=None)
    beaten = replace(
        lost, peer_error_pct=4.0, elements=None, step_s=None, real_time_factor=None, error_pct=None,
        ratio=None,
    )  # fmt: skip
    assert peers_page.best([wrong, slow, ROW, lost, beaten]) == [ROW, beaten]
    table = peers_page.peer_table([ROW, lost, beaten])
    assert table[1][-5:] == ["0.5", "20 at 100 ms", "2,000", "0.4", "20"]
    assert table[2][5] == "lost"
    assert table[3][-4:] == ["none", "", "", "loss"]


def test_a_stored_race_is_read_as_it_was_and_anything_else_refused(tmp_path: Path) -> None:
    raced = PeerRace(MACHINE, dict(PEERS), 1.0, (ROW, replace(ROW, peer_error_pct=None)), {})
    stored = tmp_path / "race.json"
    stored.write_text(json.dumps(raced.as_json()))
    assert peers_page.read_race(stored) == raced
    stored.write_text('{"rows": [{"peer": "moordyn"}]}')
    with pytest.raises(InputError, match=r"race.json: it is no race of the peers .* peers --json"):
        peers_page.read_race(stored)


def test_the_section_that_we_ship_is_made_of_the_race_that_we_ship() -> None:
    page = (ROOT / "docs" / "performance.md").read_text(encoding="utf-8")
    raced = peers_page.read_race(ROOT / "docs" / peers_page.STORED)
    assert page.endswith("\n" + peers_page.as_section(raced))
    assert {(row.case, row.segments) for row in raced.rows} == {
        (case.scene, case.segments) for case in peers.FULL
    }
    assert (ROOT / "docs" / peers_page.PICTURE).read_bytes().startswith(b"\x89PNG")
