"""A recorded run on the console: plays, pauses, jumps with the minute before, ends."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from console_rig import EPOCH_NS, Clock, encode_text, frames, recorded_lift
from sample_snapshot import hanging_rope

from rope_twin import messages
from rope_twin.console.control import RequestHandler
from rope_twin.console.pages import Pages
from rope_twin.console.playback import Recording, connect_playback
from rope_twin.errors import BagError
from rope_twin.recording.bag_writer import BagWriter
from rope_twin.topics import BY_NAME

LASTS_S = 100.0


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded_lift(tmp_path_factory.mktemp("bags") / "lift", LASTS_S)


class Player:
    """A recording with its pages on a clock set by hand."""

    def __init__(self, bag: Path) -> None:
        self.clock = Clock()
        self.source = Recording(bag)
        while not self.source.state()["loaded"]:
            time.sleep(0.01)
        self.pages = Pages(self.source, self.clock)
        self.desk = RequestHandler(self.pages, self.clock)
        connect_playback(self.source, self.pages, self.desk, self.clock)
        self.page = self.pages.connect("127.0.0.1")

    def ask(self, **content: object) -> None:
        self.desk.take(self.page, {"id": 1, **content})

    def tick(self, count: int = 1) -> None:
        for _ in range(count):
            self.clock.now_s += 0.05
            self.pages.tick()

    @property
    def line_out_m(self) -> float:
        return self.pages.readings.values["line_out_m"][0]  # type: ignore[no-any-return]


def test_it_plays_at_its_rate_and_pauses(bag: Path) -> None:
    player = Player(bag)
    player.tick(41)
    assert player.line_out_m == pytest.approx(1002.0, abs=0.11)
    player.ask(do="rate", rate=5.0)
    player.tick(20)
    assert player.line_out_m == pytest.approx(1007.0, abs=0.11)
    player.ask(do="pause")
    player.tick(40)
    assert player.line_out_m == pytest.approx(1007.0, abs=0.11)
    ages = player.pages.readings.ages(player.clock())
    assert max(ages.values()) == 0.0  # a pause is not a loss
    player.source.close()


def test_a_jump_brings_the_minute_before(bag: Path) -> None:
    player = Player(bag)
    player.tick(5)
    frames(player.page)
    player.ask(do="seek", time_s=80.0)
    player.tick(2)
    assert player.line_out_m == pytest.approx(1080.0, abs=0.2)
    hello = next(one for one in frames(player.page) if one["type"] == "hello")
    times = hello["trend"][0]["time_s"]
    assert times[0] == pytest.approx(20.0, abs=0.3)
    assert times[-1] == pytest.approx(80.0, abs=0.3)
    player.ask(do="seek", time_s=5.0)  # and back
    player.tick(2)
    assert player.line_out_m == pytest.approx(1005.0, abs=0.2)
    player.source.close()


def test_a_slow_look_back_skips_nothing_of_the_recording(
    bag: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    player = Player(bag)
    player.tick(5)
    look_back = player.source.look_back

    def slow(pages: Pages, now_s: float) -> None:
        look_back(pages, now_s)
        player.clock.now_s += 6.0

    monkeypatch.setattr(player.source, "look_back", slow)
    player.ask(do="seek", time_s=30.0)
    player.tick(3)
    assert player.source.position_s == pytest.approx(30.1, abs=0.01)
    player.source.close()


def test_it_ends_at_its_end_and_refuses_nonsense(bag: Path) -> None:
    player = Player(bag)
    player.ask(do="seek", time_s=1e9)
    player.tick(40)
    assert player.source.position_s == pytest.approx(LASTS_S - 0.1)
    frames(player.page)
    for content in ({"do": "seek", "time_s": "x"}, {"do": "seek", "time_s": float("nan")},
                    {"do": "seek", "time_s": 10**400},
                    {"do": "rate", "rate": 3.0}, {"do": "rate", "rate": True}):  # fmt: skip
        player.ask(**content)
    assert [one["ok"] for one in frames(player.page) if one["type"] == "reply"] == [False] * 5
    player.source.close()


def test_what_is_no_bag_of_a_twin_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BagError):
        Recording(tmp_path / "none")
    writer = BagWriter(tmp_path / "empty", [BY_NAME["ropes/fatigue"]])
    writer.close()
    with pytest.raises(BagError, match="no topic of a twin"):
        Recording(tmp_path / "empty")


def test_of_a_topic_on_change_the_newest_message_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "modes"
    writer = BagWriter(path, [BY_NAME["winch/mode"], BY_NAME["ropes/length"]])
    encoder = messages.Encoder(EPOCH_NS)
    for number in range(50):
        snapshot = hanging_rope(nodes=5, length_m=1000.0, time_s=0.1 * number)
        writer.write(
            "ropes/length", EPOCH_NS + snapshot.stamp_ns, encoder.encode("ropes/length", snapshot)
        )
    for after_ns, words in ((0, "winch: speed 1 m/s"), (10_000_000, "winch: emergency stop")):
        writer.write("winch/mode", EPOCH_NS + after_ns, encode_text(words))
    writer.close()
    player = Player(path)
    player.tick(20)
    assert player.pages.readings.values["winch_mode"] == "winch: emergency stop"


def test_diagnostics_of_every_node_are_shown(tmp_path: Path) -> None:
    """Two nodes that publish their rows within the same moment, at every rate and after a jump."""
    path = tmp_path / "nodes"
    writer = BagWriter(path, [BY_NAME["diagnostics"], BY_NAME["ropes/length"]])
    encoder = messages.Encoder(EPOCH_NS)
    for number in range(200):
        snapshot = hanging_rope(nodes=5, length_m=1000.0, time_s=0.1 * number)
        stamp_ns = EPOCH_NS + snapshot.stamp_ns
        writer.write("ropes/length", stamp_ns, encoder.encode("ropes/length", snapshot))
        if number % 10 == 0:
            for node, after_ns in (
                ("simulation: state", 40_000_000),
                ("recorder: bag", 60_000_000),
            ):
                row = messages.Status(node, messages.Level.ERROR, f"{number // 10}")
                data = messages.encode_diagnostics(stamp_ns, [row])
                writer.write("diagnostics", stamp_ns + after_ns, data)
    writer.close()
    player = Player(path)

    def shown() -> list[str]:
        rows = player.pages.readings.values
        names = ("simulation: state", "recorder: bag")
        return [rows.get(f"diagnostics {name}", {}).get("message") for name in names]

    player.ask(do="rate", rate=10.0)
    player.tick(12)  # 5.5 s
    assert shown() == ["5", "5"]
    player.ask(do="seek", time_s=15.2)
    player.tick(1)
    assert shown() == ["15", "15"]
