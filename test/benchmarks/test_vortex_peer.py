"""MoorDyn's vortices beside ours on the curved pipe: its deck, its rows, where it is missing.

MoorDyn is no dependency: where it is missing, that is what is tested. No time is asserted.
"""

from __future__ import annotations

import importlib.util
import json
import math
import sys

import pytest

from benchmarks import vortex_speed
from benchmarks.__main__ import main
from benchmarks.peers import vortices as vortex_peer
from benchmarks.peers.decks import figures, moordyn_deck
from rope_twin.scene.load import load_scene

HERE = importlib.util.find_spec("moordyn") is not None


def test_the_deck_has_bending_and_lift() -> None:
    """The last three columns are Cl, dF and cF; a line without lift has none of them."""
    given = vortex_peer.pipe_figures(load_scene("curved_pipe"))
    (line,) = (
        row for row in moordyn_deck(given, 200, "RK2", -1.0, 5e-4).splitlines()
        if row.startswith("rope ")
    )  # fmt: skip
    columns = line.split()
    assert [float(cell) for cell in columns[1:6]] == [0.0363, 1.2682, 3.322e6, -1.0, 613.0]
    assert [float(cell) for cell in columns[6:]] == [1.2, 1.0, 0.01, 0.0, 0.8, 0.08, 0.18]
    assert given.load_Ca == pytest.approx(27.0 / (1035.0 * 0.05329))
    plain = moordyn_deck(figures(load_scene("smooth_2km")), 20, "RK2", -1.0, 5e-4)
    assert len(next(row for row in plain.splitlines() if row.startswith("rope ")).split()) == 10


def test_a_race_of_equal_elements_and_step(capfd: pytest.CaptureFixture[str]) -> None:
    """Each model beside none, then both pipes: they move, and the ratio is that of the speeds.

    What MoorDyn says stays out of the JSON.
    """
    assert main(["vortices", "--quick", "--json"]) == 0
    shown, said = capfd.readouterr()
    reported = json.loads(shown)
    assert [row["model"] for row in reported["rows"]] == ["none", "wake_oscillator"]
    for row in reported["rows"]:
        assert row["best_factor"] >= row["real_time_factor"] > 0.0
        per_step_s = 1e-9 * row["ns_per_node_step"] * row["nodes"]
        assert row["real_time_factor"] == pytest.approx(1e-3 / per_step_s)
    assert [(row["rope"], row["model"]) for row in reported["pace"]] == [
        ("[LCD] riser", "modal_vibration"), ("[LCD] riser", "decomposed_force"),
    ]  # fmt: skip
    for row in reported["pace"]:
        assert row["best_factor"] >= row["real_time_factor"] > 0.0
        assert row["modes"] >= 7 < row["places"]
    if not HERE:
        assert reported["peer"] is None
        assert "get it with `pip install moordyn==2.7.2`" in said
        return
    assert [row["scheme"] for row in reported["peer"]] == ["RK2", "Midpoint5"]
    for row in reported["peer"]:
        assert (row["elements"], row["step_s"]) == (20, 1e-3)
        assert row["ratio"] == pytest.approx(row["real_time_factor"] / row["peer_real_time_factor"])
        assert 0.0 < row["peer_rms_diameters"] < math.inf
        assert 0.0 < row["rms_diameters"] < 2.0
    assert vortex_peer.race_table(reported["peer"])[1][1] == "RK2"


def test_where_it_is_missing_the_rest_runs(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """One sentence tells how to get it; the table of the models is there."""
    monkeypatch.setitem(sys.modules, "moordyn", None)  # an import of it fails from now on
    monkeypatch.setattr(vortex_speed, "vortex_rows", lambda cases, listen: iter(()))
    assert main(["vortices", "--quick"]) == 0
    reported = capsys.readouterr()
    assert "ns/node/step" in reported.out
    assert reported.err.count("get it with `pip install moordyn==2.7.2`") == 1


def test_a_scheme_that_is_lost_is_reported_so() -> None:
    """No speed, no ratio."""
    row = {
        "peer": "MoorDyn", "scheme": "RK2", "elements": 200, "step_s": 1e-3,
        "peer_real_time_factor": None, "peer_rms_diameters": None, "real_time_factor": 20.0,
        "rms_diameters": 0.5, "ratio": None,
    }  # fmt: skip
    assert vortex_peer.race_table([row])[1][4:] == ("lost", "", "20.0", "0.50", "")
