"""Contents of a recording by RopeView, read by rerun's own reader."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rerun as rr
from sample_snapshot import hanging_rope
from view_session import EPOCH_NS, Session

from rope_twin import messages
from rope_twin.errors import InputError
from rope_twin.messages import Level, Status
from rope_twin.twin.snapshot import (
    BodySnapshot,
    Crossing,
    LineEvent,
    LinesSnapshot,
    Nearest,
    PayloadSnapshot,
    RopeSnapshot,
    StrutSnapshot,
    WinchSnapshot,
)
from rope_twin.view import charts
from rope_twin.view.sinks import FileSink


@pytest.fixture(autouse=True)
def strict_rerun() -> Iterator[None]:
    """rerun swallows errors unless reported otherwise."""
    rr.set_strict_mode(True)
    yield
    rr.set_strict_mode(False)


@pytest.fixture
def session(tmp_path: Path) -> Session:
    return Session(tmp_path / "view.rrd")


def test_everything_that_an_operator_looks_for_is_there(session: Session) -> None:
    session.epoch()
    stamp_ns = EPOCH_NS + 10**9
    for k in range(30):
        session.rope(k * 0.04)
    session.show("ship/heave", messages.encode_heave(stamp_ns, 1.25, 0.5), stamp_ns)
    session.show("sea/elevation", messages.encode_elevation(stamp_ns, -0.5), stamp_ns)
    rows = [Status("simulation: pacing", Level.OK, "fine", {"real-time factor": "421.5"})]
    session.show("diagnostics", messages.encode_diagnostics(stamp_ns, rows), stamp_ns)
    found = session.finish()
    assert found.entities >= {
        "overview/rope", "overview/payload", "overview/hang_off", "overview/scale",
        "surface/rope", "surface/hang_off", "surface/sea",
        "profile/now", "profile/range", "profile/axes/colours", "profile/axes/tension",
        "plots/tension/top", "plots/tension/payload", "plots/heave", "plots/line_out",
        "plots/real_time_factor", "diagnostics",
    }  # fmt: skip
    assert found.blueprints >= 1
    assert found.column("plots/heave", "Scalars:scalars") == [[1.25]]
    assert found.column("plots/real_time_factor", "Scalars:scalars") == [[421.5]]
    assert found.column("plots/line_out", "Scalars:scalars")[0] == [3000.0]


def test_every_scalar_is_kept_and_ropes_are_drawn_ten_times_a_second(session: Session) -> None:
    session.epoch()
    for k in range(250):
        session.rope(k * 0.02)
    found = session.finish()
    assert len(found.seconds("plots/tension/top")) == 250
    assert len(found.seconds("plots/tension/payload")) == 250
    drawn = found.seconds("overview/rope")
    assert 45 <= len(drawn) <= 50
    assert np.diff(drawn).min() > 0.0999


def test_an_interval_around_the_tension_is_drawn_with_it_where_there_is_one(
    session: Session,
) -> None:
    """Both edges lie below the entity of the top tension, so that one plot shows all three."""
    session.epoch()
    session.rope(1.0)
    snapshot = hanging_rope(21, time_s=1.0)
    assert snapshot.error_interval is not None
    topic = "ropes/tension_top_error"
    session.show(topic, session.encoder.encode(topic, snapshot), EPOCH_NS)
    found = session.finish()
    for edge, force_n in (
        ("low", snapshot.error_interval.low_n),
        ("high", snapshot.error_interval.high_n),
    ):
        drawn = found.column(f"plots/tension/top/{edge}", "Scalars:scalars")
        assert drawn == [[pytest.approx(force_n / 1e3)]]
        assert found.seconds(f"plots/tension/top/{edge}") == pytest.approx([1.0])


def test_the_parts_of_a_winch_are_curves_by_their_unit(session: Session) -> None:
    """Motor and brake in one plot, in kN m; a part that is new is drawn by its own name."""
    session.epoch()
    session.rope(1.0)
    figures = {
        "drum_radius_m": 0.82, "drum_speed_rad_per_s": 1.2, "motor_torque_n_m": 2.5e5,
        "brake_torque_n_m": 0.0, "compensation_m": -0.4, "grip_n": 7.0,
    }  # fmt: skip
    snapshot = replace(
        hanging_rope(21, time_s=1.0),
        winches=(WinchSnapshot("winch", "speed", 0.5, "", tuple(figures.items())),),
    )
    session.show("winch/state", session.encoder.encode("winch/state", snapshot), EPOCH_NS)
    found = session.finish()
    assert found.column("plots/winch/torque/winch/motor", "Scalars:scalars") == [[250.0]]
    assert found.column("plots/winch/torque/winch/brake", "Scalars:scalars") == [[0.0]]
    assert found.column("plots/winch/stroke/winch/stroke", "Scalars:scalars") == [[-0.4]]
    assert found.column("plots/winch/grip_n/winch/grip_n", "Scalars:scalars") == [[7.0]]
    assert not [name for name in found.entities if "target" in name]


def test_measured_values_are_drawn_beside_computed_ones(session: Session) -> None:
    """At the time of the reading, once, though the table is published again and again."""
    session.epoch()
    for k in range(3):
        snapshot = hanging_rope(21, time_s=2.5 + 0.1 * k)  # with a reading of 2.4 s
        arrived_ns = EPOCH_NS + snapshot.stamp_ns
        session.show("residuals", session.encoder.encode("residuals", snapshot), arrived_ns)
    found = session.finish()
    for curve, value in (
        ("measured/tension/winch/measured", 321.0),
        ("measured/tension/winch/computed", 320.8),
        ("residual/tension/winch/residual", 0.2),
        ("residual/tension/winch/upper", 1.5),
    ):
        ((drawn,),) = found.column(f"plots/{curve}", "Scalars:scalars")
        assert drawn == pytest.approx(value)
        assert found.seconds(f"plots/{curve}") == [pytest.approx(2.4)]


def test_the_quality_index_is_a_curve_for_each_element(session: Session) -> None:
    session.epoch()
    snapshot = hanging_rope(21, time_s=1.0)
    topic = "twin/quality"
    session.show(topic, session.encoder.encode(topic, snapshot), EPOCH_NS + 10**9)
    found = session.finish()
    ((drawn,),) = found.column("plots/quality/top_tension", "Scalars:scalars")
    assert drawn == pytest.approx(0.8)


def test_two_lines_are_shown_with_their_crossings(session: Session) -> None:
    """Curves of distance, height and angle, a point in the picture, events in the log."""
    session.epoch()
    session.rope(1.0)
    crossing = Crossing(depth_m=836.0, angle_deg=0.08, gap_m=0.02, position_m=(3.0, 4.0, -836.0))
    lines = LinesSnapshot(Nearest(1.0, 900.0, 0.5), (crossing,))
    event = LineEvent(1.0, "cross", 836.0, 0.08, 0.02)
    snapshot = replace(hanging_rope(21, time_s=1.0), lines=lines, line_events=(event,))
    for topic in ("lines/crossings", "lines/events"):
        session.show(topic, session.encoder.encode(topic, snapshot), EPOCH_NS + 10**9)
    found = session.finish()
    assert found.column("plots/lines/distance/nearest", "Scalars:scalars") == [[0.5]]
    assert found.column("plots/lines/crossings/crossing_1", "Scalars:scalars") == [[-836.0]]
    ((spot,),) = found.column("overview/crossings", "Points3D:positions")
    assert spot[2] == pytest.approx(-836.0)
    assert "the lines cross at 836 m" in str(found.column("diagnostics", "TextLog:text"))


def test_the_lower_end_is_drawn_about_itself_to_scale(session: Session) -> None:
    """Slings and bars below a rope of 3 km, within some metres of the middle of their picture."""
    first = hanging_rope(21, time_s=1.0)
    end = first.node_position_m[-1]
    sling = end + np.array([[0.0, 0.0, 0.0], [2.0, 0.0, -4.0], [4.0, 0.0, -8.0]])
    ropes = (
        RopeSnapshot("hoist", first.node_position_m, first.node_tension_n, first.element_tension_n,
                 1e5, 3000.0, 0.0),
        RopeSnapshot("sling", sling, np.full(3, 5e4), np.full(2, 5e4), 5e4, 9.0, 0.0),
    )  # fmt: skip
    snapshot = replace(
        first, ropes=ropes, payloads=(PayloadSnapshot("load", sling[-1], np.zeros(3)),),
        struts=(StrutSnapshot("bar", sling[:2], 1.0),),
    )  # fmt: skip
    session.epoch()
    session.rope(1.0)
    for topic in ("payloads/state", "struts/state", "ropes/element_tension", "ropes/nodes"):
        later = replace(snapshot, stamp_ns=snapshot.stamp_ns + 200_000_000)
        session.show(topic, session.encoder.encode(topic, later), EPOCH_NS + later.stamp_ns)
    sight = session.view._lower_end.sight
    assert sight is not None
    assert (sight.below, sight.beside) == pytest.approx((8.0, 4.0 + 1.0), rel=1e-4)
    found = session.finish()
    (strips,) = found.column("lower_end/rope/1", "LineStrips3D:strips")
    assert np.array(strips[-1][-1]) == pytest.approx([4.0, 0.0, -8.0], abs=1e-3)
    for strips in found.column("lower_end/rope", "LineStrips3D:strips"):
        points = np.array(strips).reshape(-1, 3)
        assert np.linalg.norm(points, axis=1).max() <= 2.0 * sight.half * 1.0001
        assert points[-1] == pytest.approx([0.0, 0.0, 0.0], abs=1e-6)
    (bar,) = found.column("lower_end/bars", "LineStrips3D:strips")
    assert np.array(bar[0][1]) == pytest.approx([2.0, 0.0, -4.0], abs=1e-3)
    assert found.column("lower_end/depth", "Points3D:labels")[-1] == ["2999.6 m depth"]
    assert found.column("lower_end/payload", "Boxes3D:labels")[-1] == ["load"]
    assert found.column("overview/payload", "Boxes3D:labels") == [["payload"], ["load"]]
    ((_, _, deep),) = found.column("overview/payload", "Boxes3D:centers")[-1]
    frame = session.view._overview.frame
    assert frame is not None
    assert deep == pytest.approx(sling[-1][2] - frame.depth_m / 70.0, abs=1e-2)


def test_a_rigid_body_hangs_on_its_slings(session: Session) -> None:
    """Lines from the hook, the rope's end, to where each sling holds the body."""
    snapshot = hanging_rope(21, time_s=1.0)
    hook = snapshot.node_position_m[-1]
    ends = hook + np.array([[2.0, 1.5, -5.0], [-2.0, -1.5, -5.0]])
    body = BodySnapshot(
        quaternion=np.array([0.0, 0.0, 0.0, 1.0]), angular_velocity_rad_per_s=np.zeros(3),
        size_m=np.array([4.0, 3.0, 2.0]), leg_tension_n=np.array([5e4, 0.0]),
        leg_length_m=np.array([5.6, 5.6]), leg_end_m=ends, hook_m=hook,
    )  # fmt: skip
    session.epoch()
    session.rope(1.0)
    middle = hook + np.array([0.0, 0.0, -6.0])
    later = replace(
        snapshot, stamp_ns=snapshot.stamp_ns + 200_000_000, body=body, payload_position_m=middle
    )
    for topic in ("payloads/body", "slings/state", "payloads/state", "ropes/nodes"):
        session.show(topic, session.encoder.encode(topic, later), EPOCH_NS + later.stamp_ns)
    found = session.finish()
    ((left, right),) = found.column("lower_end/slings", "LineStrips3D:strips")
    assert np.array(left) == pytest.approx(np.array([[0, 0, 0], [2.0, 1.5, -5.0]]), abs=1e-3)
    assert np.array(right) == pytest.approx(np.array([[0, 0, 0], [-2.0, -1.5, -5.0]]), abs=1e-3)
    slack, taut = found.column("lower_end/slings", "LineStrips3D:colors")[-1][::-1]
    assert slack != taut
    deep = f"{-middle[2]:.1f} m depth"
    assert found.column("lower_end/depth", "Points3D:labels")[-1] == [deep], "of the body"


def test_the_water_is_drawn_where_the_lower_end_passes_it(session: Session) -> None:
    """The seabed is a line at its height, absent once the rope's end is far below."""
    snapshot = hanging_rope(21, time_s=1.0)
    session.epoch()
    for k, height_m in enumerate((2.0, -2.0, -400.0, -401.0)):
        nodes = snapshot.node_position_m - [0.0, 0.0, snapshot.node_position_m[-1, 2] - height_m]
        session.rope(1.0 + 0.2 * k, node_position_m=nodes, payload_position_m=nodes[-1])
    found = session.finish()
    above, below, gone = found.column("lower_end/water", "LineStrips3D:strips")
    for strips, height_m in ((above, -2.0), (below, 2.0)):
        assert np.array(strips[0])[:, 2] == pytest.approx([height_m] * 2, abs=1e-3)
    assert gone == []
    words = found.column("lower_end/depth", "Points3D:labels")
    assert words[:2] == [["2.0 m above the water"], ["2.0 m depth"]]


def test_a_ship_under_way_takes_its_piece_of_sea_along(session: Session) -> None:
    """Its hang-off was drawn where it went: after 20 m it had left the picture."""
    session.epoch()
    places = hanging_rope(21).node_position_m
    for k, east_m in enumerate((0.0, 5.0, 120.0)):
        session.rope(0.2 * k, node_position_m=places + np.array([east_m, 0.0, 0.0]))
    drawn = session.finish().column("surface/hang_off", "Points3D:positions")
    assert [spot[0] for (spot,) in drawn] == pytest.approx([0.0, 5.0, 0.0], abs=0.01)


def test_what_a_rope_shakes_and_has_used_is_drawn_over_its_length(session: Session) -> None:
    """Amplitudes on a scale from 0 to a round number, from the hang-off down; aboard is not."""
    session.epoch()
    session.rope(1.0)
    snapshot = hanging_rope(21, time_s=1.0)
    for topic in ("ropes/vibration", "ropes/fatigue"):
        session.show(topic, session.encoder.encode(topic, snapshot), EPOCH_NS + 10**9)
    found = session.finish()
    assert snapshot.vibration is not None
    (strip,) = found.column("vibration/amplitude/cross-flow", "LineStrips2D:strips")[0]
    across, down = np.array(strip).T
    assert down[0] == 0.0
    assert across == pytest.approx(across.max() * snapshot.vibration.cross_flow / 0.5, abs=1e-3)
    assert 0.4 * charts.WIDTH < across.max() <= charts.WIDTH
    (strip,) = found.column("vibration/drag/amplification", "LineStrips2D:strips")[0]
    across = np.array(strip)[:, 0] - 2.0 * (charts.WIDTH + charts.GAP)
    assert across == pytest.approx(
        across.max() * snapshot.vibration.drag_amplification / 2.0, abs=1e-3
    )
    for entity in ("vibration/frequency/in-line", "vibration/amplitude/title", "fatigue/grid"):
        assert entity in found.entities
    assert snapshot.fatigue is not None
    assert snapshot.fatigue.bent is not None
    (strip,) = found.column("bends/count/per_metre_of_rope", "LineStrips2D:strips")[0]
    across = np.array(strip)[:, 0]
    bends = snapshot.fatigue.bent.bends
    assert across == pytest.approx(across.max() * bends / bends.max(), abs=1e-3)
    assert {"bends/damage/damage", "bends/damage/of_discard_value"} <= set(found.entities)


def test_without_a_band_nothing_of_it_is_drawn(session: Session) -> None:
    session.epoch()
    session.rope(1.0)
    assert not [name for name in session.finish().entities if name.startswith("plots/tension/top/")]


def test_times_are_those_of_the_stamps_since_the_epoch(session: Session) -> None:
    session.epoch()
    for k in range(5):
        session.rope(3.0 + k * 0.2, late_s=0.9)
    found = session.finish()
    assert found.seconds("plots/line_out") == pytest.approx([3.0, 3.2, 3.4, 3.6, 3.8])
    assert found.seconds("overview/rope") == pytest.approx([3.0, 3.2, 3.4, 3.6, 3.8])


def test_messages_before_the_epoch_wait_for_it(session: Session) -> None:
    for k in range(5):
        session.rope(1.0 + k * 0.2)
    session.epoch()
    assert session.finish().seconds("plots/line_out") == pytest.approx([1.0, 1.2, 1.4, 1.6, 1.8])


def test_without_an_epoch_time_begins_with_the_first_message(session: Session) -> None:
    for k in range(20):
        session.rope(100.0 + k * 0.2)
    session.epoch()  # too late: what is drawn stays where it is
    times = session.finish().seconds("plots/line_out")
    assert len(times) == 20
    assert times[:2] == pytest.approx([0.0, 0.2])


def test_a_short_session_without_an_epoch_is_not_lost(session: Session) -> None:
    session.rope(0.5)
    assert session.finish().seconds("plots/line_out") == [0.0]


def test_the_picture_is_drawn_again_after_a_jump_back(session: Session) -> None:
    session.epoch()
    for time_s in (50.0, 50.2, 1.0, 1.2):
        session.rope(time_s)
    assert session.finish().seconds("overview/rope") == pytest.approx([1.0, 1.2, 50.0, 50.2])


def test_colours_follow_the_tension_of_the_elements(session: Session) -> None:
    session.epoch()
    tension = hanging_rope(21).element_tension_n.copy()
    tension[3] = 0.0
    session.rope(0.0, element_tension_n=tension)
    (colours,) = session.finish().column("overview/rope", "LineStrips3D:colors")
    assert len(colours) == 20
    assert colours[3] == 0xFF4040FF
    assert len(set(colours)) == 20


def test_the_rope_may_change_its_number_of_nodes(session: Session) -> None:
    session.epoch()
    session.rope(0.0)
    longer = hanging_rope(31, time_s=0.2)
    data = session.encoder.encode("ropes/nodes", longer)  # its tensions have not come yet
    session.show("ropes/nodes", data, EPOCH_NS + longer.stamp_ns)
    strips = session.finish().column("overview/rope", "LineStrips3D:strips")
    assert [len(rope) for rope in strips] == [20, 30]


def test_the_range_outlives_a_change_of_nodes(session: Session) -> None:
    session.epoch()
    for time_s, nodes, more_n in ((0.0, 21, 0.0), (1.0, 31, 40e3), (2.0, 26, 0.0), (70.0, 21, 0.0)):
        snapshot = hanging_rope(nodes, time_s=time_s)
        snapshot = replace(snapshot, node_tension_n=snapshot.node_tension_n + more_n)
        data = session.encoder.encode("ropes/nodes", snapshot)
        session.show("ropes/nodes", data, EPOCH_NS + snapshot.stamp_ns)
    sides = session.finish().column("profile/range", "LineStrips2D:strips")
    widths = [max(b[0] - a[0] for a, b in zip(low, high, strict=True)) for low, high in sides]
    assert widths[0] == widths[3] == 0.0  # one picture, and 68 s later again
    assert widths[1] == pytest.approx(widths[2], rel=0.2)
    assert widths[1] > 50.0  # 40 of 400 to 500 kN on 1250 chart units


def test_diagnostics_are_reported_when_they_change(session: Session) -> None:
    session.epoch()
    for second, words in enumerate(("fine", "fine", "late", "late", "fine")):
        level = Level.WARN if words == "late" else Level.OK
        stamp_ns = EPOCH_NS + second * 10**9
        data = messages.encode_diagnostics(stamp_ns, [Status("pacing", level, words)])
        session.show("diagnostics", data, stamp_ns)
    found = session.finish()
    assert found.seconds("diagnostics") == [0.0, 2.0, 4.0]
    assert found.column("diagnostics", "TextLog:level") == [["INFO"], ["WARN"], ["INFO"]]


def test_topics_that_are_not_shown_are_passed_over(session: Session) -> None:
    session.epoch()
    snapshot = hanging_rope()
    session.show("hang_off/wrench", session.encoder.encode("hang_off/wrench", snapshot), EPOCH_NS)
    found = session.finish()
    assert [entity for entity in found.entities if found.seconds(entity)] == []


def test_a_foreign_point_cloud_is_refused(session: Session) -> None:
    session.epoch()
    snapshot = hanging_rope()
    message = messages.decode("ropes/nodes", session.encoder.encode("ropes/nodes", snapshot))
    message.point_step = 8
    with pytest.raises(InputError, match="fields not known"):
        session.view.show("ropes/nodes", message, EPOCH_NS)
    session.view.close()


def test_a_file_that_cannot_be_made_gets_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        FileSink(tmp_path / "file" / "view.rrd")
