"""The storm scene goes slack at the payload and snaps, as its description says."""

from rope_twin.recording.heave import open_heave
from rope_twin.scene.lift import lift_figures
from rope_twin.scene.load import load_scene
from rope_twin.twin.twin import Twin

LASTS_NS = 55_000_000_000


def test_storm_goes_slack_and_snaps() -> None:
    scene = load_scene("storm")
    twin = Twin(scene)
    for sample in open_heave(scene.sea_state.bag).between(-100_000_000, LASTS_NS):
        assert twin.submit_heave(sample.stamp_ns, sample.position_m, sample.velocity_m_per_s) == ""
    lowest, highest = [], []
    while twin.time_ns < LASTS_NS:
        twin.advance(2)
        snapshot = twin.snapshot()
        lowest.append(snapshot.element_tension_n[-1])
        highest.append(snapshot.tension_payload_n)
    assert sum(tension <= 0.0 for tension in lowest) * 2 * scene.time.step_s > 1.0  # [s] slack
    assert max(highest) > 2.0 * lift_figures(scene).payload_weight_n
