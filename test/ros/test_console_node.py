"""The console node over DDS: rows of a running simulation, and a winch commanded by a page."""

from __future__ import annotations

import json
import threading
from typing import Any

import pytest
from ros_bench import Bench

pytestmark = pytest.mark.ros
TOKEN = "5e1f0c77aa21"


class Client:
    """A page without a browser: a WebSocket, the newest values and the answers."""

    def __init__(self, address: str) -> None:
        from websockets.sync.client import connect

        origin = address.rstrip("/")
        self._socket = connect(f"ws{origin[4:]}/live", origin=origin)  # type: ignore[arg-type]
        self.values: dict[str, Any] = {}
        self.facts: dict[str, Any] = {}
        self.answers: dict[int, list[dict[str, Any]]] = {}
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def ask(self, number: int, **content: Any) -> None:
        self.answers[number] = []
        self._socket.send(json.dumps({"id": number, **content}))

    def close(self) -> None:
        self._socket.close()
        self._thread.join()

    def _read(self) -> None:
        from websockets.exceptions import ConnectionClosed

        try:
            for text in self._socket:
                for frame in json.loads(text):
                    if frame["type"] == "row":
                        self.values |= frame["values"]
                    elif frame["type"] == "hello":
                        self.facts = frame["facts"]
                    elif frame["type"] == "reply":
                        self.answers[frame["id"]].append(frame)
        except ConnectionClosed:
            return


def test_a_page_reads_the_topics_and_commands_the_winch(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROPE_TWIN_CONSOLE_TOKEN", TOKEN)
    console = bench.make("console", address="127.0.0.1:0", control=True)
    simulation = bench.make("simulation", scene="emergency_stop")
    tensions = bench.listen("ropes/tension_top")
    console.begin()
    simulation.begin()
    page = Client(console.address)
    bench.until(lambda: page.values.get("tension_n") and tensions, "rows arrive")
    bench.until(lambda: page.facts.get("scene") == "emergency_stop", "the scene of twin/session")
    assert page.facts["winches"]["winch"]["speed_limit_m_per_s"] == pytest.approx(1.0)
    shown = page.values["tension_n"][0]
    bench.until(
        lambda: any(one.effort[0] == pytest.approx(shown, rel=1e-7) for one in tensions),
        "the number on the page is one of the topic",
    )
    page.ask(1, do="sign_in", token=TOKEN)
    page.ask(2, do="take_seat")
    bench.until(lambda: page.answers[1] and page.answers[2], "answers")
    page.ask(3, do="command", kind="speed", value=0.25, winch="winch")
    bench.until(lambda: len(page.answers[3]) == 2, "the twin's answer")
    assert page.answers[3][-1]["ok"], page.answers[3]
    assert "speed 0.25 m/s" in page.answers[3][-1]["words"]
    assert page.values["seat"] == "winch: console"
    page.ask(5, do="what_if", orders="swim")
    page.ask(6, do="what_if", orders="stop lower:0.5")
    bench.until(lambda: page.answers[5] and page.answers[6], "why orders are not compared")
    assert "there is no 'swim'" in page.answers[5][0]["words"]
    assert "no forecast runs" in page.answers[6][0]["words"]
    asked = bench.listen("forecast/what_if")  # as a forecast node does
    bench.until(lambda: console._what_if.get_subscription_count(), "a forecast listens")
    page.ask(7, do="what_if", orders="stop lower:0.5")
    bench.until(lambda: asked, "the forecast is asked")
    assert asked[0].data == "stop lower:0.5"
    page.ask(4, do="command", kind="emergency_stop", winch="winch")
    bench.until(lambda: len(page.answers[4]) == 2, "the twin's answer")
    assert "emergency stop" in page.answers[4][-1]["words"]
    page.ask(5, do="limit", name="tension_n", value=150e3)
    bench.until(lambda: len(page.answers[5]) == 2, "the limit is in force")
    assert page.answers[5][-1]["ok"], page.answers[5]
    raised = "tension of 'hoist'"
    bench.until(lambda: any(one["text"].startswith(raised) and "150.0 kN" in one["text"]
                            for one in page.values.get("alerts", ())), "its alert")  # fmt: skip
    page.ask(6, do="learning", what="tare")  # this run does not learn
    bench.until(lambda: len(page.answers[6]) == 2, "no answer of the service")
    assert "--learn" in page.answers[6][-1]["words"]
    page.close()  # the page is lost: its commander gives up the seat
    bench.until(lambda: "winch: free" in _seat(simulation), "the seat is free")
    console.close()
    simulation.close()


def _seat(simulation: Any) -> str:
    assert simulation.paced is not None
    return str(simulation.paced.border.seats.words())
