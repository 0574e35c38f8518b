"""The recorder and the viewer in this process: every byte kept, and no harm to the run."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import pytest
from ros_bench import Bench

from rope_twin.errors import BagError
from rope_twin.messages import Encoder, encode_epoch, encode_heave
from rope_twin.messages.cdr import new, serialise
from rope_twin.recording.bag import BagReader
from rope_twin.scene.load import load_scene
from rope_twin.twin.twin import Twin

pytestmark = pytest.mark.ros


def recorder(bench: Bench, directory: Path) -> Any:
    return bench.make("recorder", out=str(directory))


def test_the_recorder_keeps_every_byte_of_inputs_and_outputs(bench: Bench, tmp_path: Path) -> None:
    node = recorder(bench, tmp_path / "bag")
    node.begin()
    names = ("ship/heave", "twin/epoch")
    publishers = {name: bench.publisher(name) for name in names}
    bench.until(
        lambda: all(p.get_subscription_count() for p in publishers.values()), "the recorder listens"
    )
    sent = [encode_heave(10**18 + k * 50_000_000, 0.01 * k, 0.2) for k in range(400)]
    before_ns = time.time_ns()
    publishers["twin/epoch"].publish(encode_epoch(10**18))
    for data in sent:
        publishers["ship/heave"].publish(data)
    bench.until(lambda: node.received >= 401, "all of them have come")
    node.close()
    with BagReader(tmp_path / "bag") as bag:
        kept = list(bag.messages("/ship/heave"))
        assert [data for _, data in kept] == sent
        assert len(list(bag.messages("/twin/epoch"))) == 1
        log_ns = [time_ns for time_ns, _ in kept]
        assert log_ns == sorted(log_ns)
        assert before_ns <= log_ns[0] <= log_ns[-1] <= time.time_ns()
    node.close()  # harmless


def test_a_directory_in_use_is_refused_with_one_sentence(bench: Bench, tmp_path: Path) -> None:
    (tmp_path / "precious").write_text("data", encoding="utf-8")
    with pytest.raises(BagError, match="holds something"):
        recorder(bench, tmp_path).begin()


def test_the_recorder_tells_how_it_goes(bench: Bench, tmp_path: Path) -> None:
    heard = bench.listen("diagnostics")
    node = recorder(bench, tmp_path / "bag")
    node.begin()
    bench.until(lambda: heard, "its diagnostics")
    status = heard[0].status[0]
    assert status.name == "recorder: bag"
    assert {pair.key: pair.value for pair in status.values}["directory"] == str(tmp_path / "bag")


def test_the_viewer_writes_what_it_hears_to_a_file(bench: Bench, tmp_path: Path) -> None:
    node = bench.make("viewer", file=str(tmp_path / "run.rrd"), simulation_node="bench")
    node.begin()
    names = ("twin/epoch", "ropes/nodes", "residuals")
    publishers = {name: bench.publisher(name) for name in names}
    bench.until(
        lambda: all(p.get_subscription_count() for p in publishers.values()), "the viewer listens"
    )
    publishers["twin/epoch"].publish(encode_epoch(10**18))
    encoder, snapshot = Encoder(10**18), Twin(load_scene("shallow_lift")).snapshot()
    strange = serialise(new("sensor_msgs/msg/PointCloud2", width=1, point_step=8))
    for data in (strange, b"strange"):
        publishers["residuals"].publish(data)  # of any node: left out
    empty = (tmp_path / "run.rrd").stat().st_size if (tmp_path / "run.rrd").exists() else 0

    def show() -> bool:
        for name in ("ropes/nodes",):
            publishers[name].publish(encoder.encode(name, snapshot))
        file = tmp_path / "run.rrd"
        return file.exists() and file.stat().st_size > empty + 10_000

    bench.until(show, "the file grows")
    node.close()
    assert (tmp_path / "run.rrd").read_bytes()[:3] == b"RRF"
    assert not node.finished


def test_without_a_screen_the_viewer_says_so_and_harms_nobody(bench: Bench) -> None:
    from rope_twin.errors import InputError

    node = bench.make("viewer")
    node.begin()
    with pytest.raises(InputError, match="no display"):
        bench.until(lambda: node.finished, "it has noticed")
    node.close()
