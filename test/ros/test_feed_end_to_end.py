"""A ship's winch and motion sensor over UDP and a serial line into a twin on board, with faults.

Two simulations in two ROS domains, each in a process of its own: the ship, whose winch and motion
are sent as lines of instruments over ways that lose, double, cut, garble and delay them; and on
board a feed node with a twin that follows and compares. `pytest -m long` runs it for 30 min:

    pytest -m long -n 0 -s test/ros/test_feed_end_to_end.py
"""

from __future__ import annotations

import json
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import free_domain
from feed_samples import SETTINGS
from ros_bench import Bench, free_port
from ros_process import Processes
from serial_cable import cable

from rope_twin.feeds.configuration import FeedSettings
from rope_twin.feeds.instrument import Instrument, LineSample
from rope_twin.files import share_dir
from rope_twin.messages import read_cloud

pytestmark = pytest.mark.ros
FAULTS = "lost:0.01,doubled:0.01,cut:0.01,garbled:0.01,delayed:0.01:0.1s"
UNPLUGGED_S = 3.0
BUILT_UP_S, SETTLED_S = 60.0, 40.0  # until tensions of both twins can be compared
SENSORS = """
measured:
  tension: {uncertainty_n: 2500.0}
  line_out: {uncertainty_m: 0.06, resolution_m: 0.01}
"""


def settings_file(path: Path, **feeds: dict[str, Any]) -> str:
    path.write_text(json.dumps({"feeds": feeds}), "utf-8")
    return str(path)


def sent_by(path: Path, feed: dict[str, Any]) -> set[tuple[float, ...]]:
    """Return the values of every line that was sent, rounded.

    The lines have the time of day at most, so they are read as if they came today.
    """
    instrument = Instrument(FeedSettings(**{**feed, "source": str(path)}))
    found, lines = set(), path.read_bytes().splitlines(keepends=True)
    for line in lines:
        for one in instrument.take(line, path.stat().st_mtime_ns):
            if isinstance(one, LineSample):
                found.add(rounded(one.payout_m, one.speed_m_per_s, one.tension_n))
            else:
                found.add(rounded(one.heave_m, one.heave_rate_m_per_s))
    assert instrument.counts.accepted == len(lines), instrument.counts.last_fault
    return found


def rounded(*values: float) -> tuple[float, ...]:
    return tuple(round(float(value), 6) for value in values)  # NumPy rounds ties otherwise


class Board:
    """Messages heard on board: values, residuals and the last row of each name."""

    def __init__(self) -> None:
        self.line: list[tuple[float, ...]] = []
        self.heave: list[tuple[float, ...]] = []
        self.residuals: list[tuple[int, dict[str, Any]]] = []
        self.rows: dict[str, Any] = {}
        self.levels: dict[str, set[int]] = {}

    def take(self, lines: list[Any], heaves: list[Any], clouds: list[Any], diagnostics: list[Any],
             ) -> None:  # fmt: skip
        """Keep the figures of messages, and drop the messages."""
        self.line += [rounded(m.position[0], m.velocity[0], m.effort[0]) for m in lines]
        self.heave += [rounded(m.pose.pose.position.z, m.twist.twist.linear.z) for m in heaves]
        for cloud in clouds:
            rows = {row["name"].decode(): row for row in read_cloud(cloud)}
            self.residuals.append((time.monotonic_ns(), rows))
        for message in diagnostics:
            for row in message.status:
                self.rows[row.name] = row
                self.levels.setdefault(row.name, set()).add(int(row.level))
        for heard in (lines, heaves, clouds, diagnostics):
            heard.clear()

    def value(self, row: str, key: str) -> str:
        return {pair.key: pair.value for pair in self.rows[row].values}.get(key, "0")


def is_followed(heard: Board) -> bool:
    """Return whether the newest residual of the line out lies in its interval."""
    lengths = residuals(heard, "line_out_m winch", lambda at_s: True)
    return lengths.size > 0 and bool(abs(lengths[-1, 0]) < lengths[-1, 1])


def check(
    heard: Board, feeds: dict[str, Any], faults: dict[str, int], sent: dict[str, set[Any]],
    times: dict[str, float],
) -> None:  # fmt: skip
    """Check what was accepted against what was sent, and print the figures."""
    line, heave = sent["winch"], {values[0] for values in sent["mru"]}
    print(f"faults: {faults}\nfeeds: {feeds}")
    logged = times["winch_sent"] + times["mru_sent"]
    assert faults["lines"] == logged, "the log has every line that was sent"
    strange = [(k, one) for k, one in enumerate(heard.line) if one not in line]
    assert not strange, f"{len(strange)} of {len(heard.line)}: {strange[:2]} to {strange[-1]}"
    odd = [(k, one) for k, one in enumerate(heard.heave) if one[0] not in heave]  # rate: derived
    assert not odd, f"{len(odd)} of {len(heard.heave)}: {odd[:2]} to {odd[-1]}"
    assert all(faults.get(name, 0) > 0 for name in ("lost", "doubled", "cut", "garbled"))
    assert {"checksum", "duplicate"} <= {*feeds["winch"]["refused"], *feeds["mru"]["refused"]}
    for name, one in feeds.items():
        # as it was sent: the listener of this test may miss messages of a stream, the feed no lines
        assert one["accepted"] > 0.9 * (one["lines"] - one["other_sentences"]), (
            f"{name}: most lines are sound"
        )
    # the unplugged cable is a hole and an error, and the motion comes back
    assert feeds["mru"]["holes"] >= 1
    assert feeds["mru"]["longest_hole_s"] > 0.8 * UNPLUGGED_S
    assert 2 in heard.levels["feed: mru"]
    assert 2 in heard.levels["simulation: input heave"]
    assert int(heard.rows["feed: mru"].level) < 2
    for name in ("simulation: messages", "simulation: solver"):
        assert heard.levels[name] == {0}, heard.rows[name].message
    lengths = residuals(heard, "line_out_m winch", lambda at_s: at_s > times["began"])
    apart = np.abs(lengths[:, 0])
    print(f"line out: {apart.size} residuals, standard deviation {lengths[:, 0].std():.4f} m, "
          f"largest {apart.max():.3f} m")  # fmt: skip
    assert np.mean(apart < lengths[:, 1]) >= 0.95
    assert apart.max() < 0.5, "nothing jumps"
    print("\n".join(f"{name}: {sorted(levels)} {heard.rows[name].message}"
                    for name, levels in heard.levels.items()))  # fmt: skip
    tensions = residuals(
        heard,
        "top_tension_n winch",
        lambda at_s: (
            at_s > times["began"] + BUILT_UP_S and not 0.0 < at_s - times["unplugged"] < SETTLED_S
        ),
    )
    if len(tensions):
        inside = float(np.mean(np.abs(tensions[:, 0]) < tensions[:, 1]))
        print(f"tension: {len(tensions)} residuals, standard deviation "
              f"{tensions[:, 0].std():.0f} N, {inside:.1%} inside")  # fmt: skip
        assert inside >= 0.95


def residuals(heard: Board, name: str, wanted: Callable[[float], bool]) -> np.ndarray:
    """Return residual and upper end of its interval, (n, 2), of the times that are wanted [s]."""
    found = [(row[name]["residual"], row[name]["upper"]) for at_ns, row in heard.residuals
             if name in row and wanted(at_ns * 1e-9)]  # fmt: skip
    return np.array(found).reshape(-1, 2)


@pytest.mark.parametrize(
    "seconds", [7.0, pytest.param(1800.0, marks=pytest.mark.long)], ids=["quick", "30 min"]
)
def test_instruments_with_faulty_lines_into_a_twin(
    bench: Bench, processes: Processes, tmp_path: Path, seconds: float
) -> None:
    port = free_port()
    winch = {"format": "lci90", **SETTINGS["lci90"], "winch": "winch", "stamp": "instrument"}
    mru = {"format": "pashr", **SETTINGS["pashr"], "stamp": "instrument"}
    logs = {name: tmp_path / f"{name}_sent" for name in ("winch", "mru")}
    scene = tmp_path / "board.yaml"
    text = (share_dir() / "config" / "scenes" / "shallow_lift.yaml").read_text("utf-8")
    scene.write_text(text + SENSORS, "utf-8")
    with cable() as line, free_domain() as ship:
        address = f"udp://127.0.0.1:{port}"
        sent = settings_file(
            tmp_path / "ship.yaml",
            winch={**winch, "source": address},
            mru={**mru, "source": f"serial:{line.out}@115200"},
            winch_sent={**winch, "source": str(logs["winch"])},
            mru_sent={**mru, "source": str(logs["mru"])},
        )
        received = settings_file(
            tmp_path / "board_feeds.yaml",
            winch={**winch, "source": address},
            mru={**mru, "source": f"serial:{line.back}@115200"},
        )
        domain = {"ROS_DOMAIN_ID": str(ship)}
        running = processes.start(
            ["-m", "rope_twin", "run", "shallow_lift", "--headless", "--no-record"], **domain
        )
        sender = processes.start(
            ["-m", "rope_twin", "feed", "--settings", sent, "--simulate", "--json",
             "--faults", FAULTS], **domain,
        )  # fmt: skip
        board = processes.node(
            "simulation", scene=str(scene), follow_measured=True, input_delay_s=2.0,
            other_sea=True, wait_for="ship/heave winch/measured", wait_for_s=60.0,
        )  # fmt: skip
        feeds = bench.make("feed", settings=received)
        feeds.begin()
        heard = Board()
        topics = [bench.listen(name) for name in
                  ("winch/measured", "ship/heave", "residuals", "diagnostics")]  # fmt: skip

        def take() -> bool:
            heard.take(*topics)
            for one in (running, sender, board):
                assert not one.ended, one.text
            return False

        # the later the board's twin begins, the more line it has to follow first
        bench.until(lambda: take() or is_followed(heard), "a line out that is followed")
        began, unplugged = time.monotonic(), 0.0
        while (now := time.monotonic()) < began + seconds + UNPLUGGED_S:
            bench._spin(0.05)
            take()
            if not unplugged and now > began + 0.4 * seconds:
                unplugged, line.plugged = now, False
            if not line.plugged and now > unplugged + UNPLUGGED_S:
                line.plugged = True
        sender.send(signal.SIGINT)
        sender.wait()
        heard.take(*topics)
        counted = feeds.figures()["feeds"]
        for one in (running, board):
            one.send(signal.SIGINT)
            one.wait()
        feeds.close()
    check(
        heard,
        counted,
        json.loads(sender.text.splitlines()[-1])["faults"],
        {"winch": sent_by(logs["winch"], winch), "mru": sent_by(logs["mru"], mru)},
        {
            "began": began,
            "unplugged": unplugged,
            **{f"{name}_sent": path.read_bytes().count(b"\n") for name, path in logs.items()},
        },
    )
