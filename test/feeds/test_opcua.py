"""Nodes of an OPC UA server: their map, values, statuses and connections, by asyncua's server."""

from __future__ import annotations

import asyncio
import math
import socket
import threading
import time
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from rope_twin.errors import InputError, SceneError
from rope_twin.feeds.configuration import FeedSettings, read_settings
from rope_twin.feeds.instrument import Instrument, LineSample
from rope_twin.feeds.plc import NO_TIMESTAMP, STALE, Freshness
from rope_twin.feeds.readings import OPCUA_START, OpcNode, Refusal, line_of
from rope_twin.feeds.transports import Address, Source, open_source, read_address

pytest.importorskip("asyncua", reason="asyncua is missing: pip install '.[opcua]'")
from asyncua import Server, ua

URI = "http://example.com/hoist"
NODES = {
    "payout": {"id": f"nsu={URI};s=Hoist.Length", "scale": 0.01},
    "speed": {"id": "ns=2;s=Hoist.Speed"},
    "tension": {"id": "ns=2;s=Hoist.Load"},
    "motor_tension": {"id": "ns=2;i=5001"},
}
VALUES = {"s=Hoist.Length": -123456, "s=Hoist.Speed": 12.3, "s=Hoist.Load": 52.5, "i=5001": 61}


class Hoist:
    """asyncua's server with the nodes of a hoist, in a thread of its own."""

    def __init__(self, port: int) -> None:
        self.port, self._values = port, dict[str, Any]()
        self.reset()
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()
        self.do(self._start())

    def do(self, call: Any) -> Any:
        return asyncio.run_coroutine_threadsafe(call, self._loop).result(20.0)

    async def _start(self) -> None:
        self._server = Server()
        await self._server.init()
        self._server.set_endpoint(f"opc.tcp://127.0.0.1:{self.port}/hoist/")
        index = await self._server.register_namespace(URI)
        assert index == 2
        for name, value in VALUES.items():
            node = ua.NodeId.from_string(f"ns={index};{name}")
            await self._server.nodes.objects.add_variable(node, name[2:], value)

            def read(*_: Any, name: str = name) -> Any:
                return self._values[name]

            self._server.set_attribute_value_callback(node, read)
        await self._server.start()

    def set(self, name: str, value: Any, status: str = "Good") -> None:
        """Have a value, with the time of now as its source timestamp."""
        code = ua.StatusCode(getattr(ua.StatusCodes, status))
        now = datetime.now(UTC).replace(tzinfo=None)
        self._values[name] = ua.DataValue(ua.Variant(value), code, now)

    def reset(self) -> None:
        for name, value in VALUES.items():
            self.set(name, value)

    def close(self) -> None:
        self.do(self._server.stop())
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(10.0)


def free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


@pytest.fixture(scope="module")
def server() -> Iterator[Hoist]:
    made = Hoist(free_port())
    yield made
    made.close()


@pytest.fixture
def hoist(server: Hoist) -> Hoist:
    """The server with its values as at first: -1234.56 m, 12.3 m/min, 52.5 kN and 61 kN."""
    server.reset()
    return server


def settings(port: int, nodes: dict[str, Any] | None = None, **more: Any) -> FeedSettings:
    given = NODES if nodes is None else nodes
    made: dict[str, Any] = {
        "format": "opcua",
        "source": f"opc.tcp://127.0.0.1:{port}/hoist/",
        "nodes": {name: OpcNode(**one) for name, one in given.items()},
        "units": {"payout": "m", "speed": "m/min", "tension": "kN"},
        "positive": {"payout": "in", "speed": "out"},
        "tension_of": "load_pin",
        "poll_rate_hz": 50.0,
        **more,
    }
    return FeedSettings(**made)


class Reader:
    """A source that is open, its instrument, and the samples that came."""

    def __init__(self, chosen: FeedSettings) -> None:
        assert chosen.check() is None
        self.instrument, self.samples, self.polls = Instrument(chosen), list[Any](), 0
        self.source: Source = open_source(chosen, self._take)
        self.source.start()

    def _take(self, data: bytes, arrival_ns: int, whole: bool) -> None:
        self.samples += self.instrument.take(data, arrival_ns, whole)
        self.polls += 1

    def until(self, condition: Any) -> None:
        deadline = time.monotonic() + 20.0
        while not condition():
            assert time.monotonic() < deadline, (self.source.fault, self.instrument.counts)
            time.sleep(0.01)

    def __enter__(self) -> Reader:
        return self

    def __exit__(self, *_: object) -> None:
        self.source.close()


def test_nodes_become_a_sample_in_si(hoist: Hoist) -> None:
    before_ns = time.time_ns()
    with Reader(settings(hoist.port)) as reader:
        reader.until(lambda: len(reader.samples) >= 3)
        assert not reader.source.fault
    first, second = reader.samples[:2]
    assert isinstance(first, LineSample)
    assert first.payout_m == pytest.approx(1234.56)  # positive is in
    assert first.speed_m_per_s == pytest.approx(12.3 / 60.0)
    assert (first.tension_n, first.motor_tension_n) == (52.5e3, 61e3)
    assert before_ns <= first.stamp_ns < second.stamp_ns <= time.time_ns()
    assert reader.instrument.counts.refused_total == 0


def test_a_winch_that_stands_still_goes_on_being_read(hoist: Hoist) -> None:
    """Values that do not change are values, unless the settings want their timestamps to move."""
    with Reader(settings(hoist.port)) as reader:
        reader.until(lambda: len(reader.samples) >= 20)
    assert {round(one.payout_m, 6) for one in reader.samples} == {1234.56}
    with Reader(settings(hoist.port, stale_after_s=0.1)) as reader:
        reader.until(lambda: reader.instrument.counts.refused["bad status"] > 0)
    assert reader.instrument.counts.last_fault == (
        "bad status: payout Stale, speed Stale, tension Stale, motor_tension Stale"
    )
    assert reader.samples, "before that they were fresh"


@pytest.mark.parametrize("status", ["BadSensorFailure", "UncertainLastUsableValue"])
def test_a_value_that_is_not_good_is_missing(hoist: Hoist, status: str) -> None:
    """The others are taken; with none left there is no sample."""
    hoist.set("s=Hoist.Load", 52.5, status)
    with Reader(settings(hoist.port)) as reader:
        reader.until(lambda: reader.samples)
    one = reader.samples[0]
    assert math.isnan(one.tension_n)
    assert (one.payout_m, one.motor_tension_n) == (pytest.approx(1234.56), 61e3)
    counts = reader.instrument.counts
    assert counts.accepted == counts.refused["bad status"] > 0
    assert counts.last_fault == f"bad status: tension {status}"
    only = settings(hoist.port, {"tension": NODES["tension"]}, units={"tension": "kN"}, positive={})
    with Reader(only) as reader:
        reader.until(lambda: reader.polls >= 3)
    assert reader.samples == []
    assert reader.instrument.counts.refused["bad status"] >= 3


@pytest.mark.parametrize("value", [math.nan, math.inf, "52.5", True])
def test_what_is_no_number_is_missing(hoist: Hoist, value: Any) -> None:
    hoist.set("s=Hoist.Load", value)
    with Reader(settings(hoist.port)) as reader:
        reader.until(lambda: reader.samples)
    assert math.isnan(reader.samples[0].tension_n)
    assert reader.instrument.counts.last_fault == "bad status: tension NoNumber"


def test_a_node_or_namespace_that_the_server_does_not_have(hoist: Hoist) -> None:
    for words, fault in (
        ("ns=2;s=Hoist.Lod", "tension: node ns=2;s=Hoist.Lod: BadNodeIdUnknown"),
        ("nsu=http://example.com/crane;s=Load", "it has no namespace 'http://example.com/crane'"),
    ):
        with Reader(settings(hoist.port, {**NODES, "tension": {"id": words}})) as reader:
            reader.until(lambda reader=reader: reader.source.fault)
            assert reader.source.fault == fault
            assert reader.polls == 0


def test_a_server_that_goes_and_comes_back() -> None:
    port = free_port()
    with Reader(settings(port)) as reader:
        reader.until(lambda: reader.source.fault)
        assert "Connect call failed" in reader.source.fault
        for _ in range(2):
            hoist, before = Hoist(port), len(reader.samples)
            reader.until(lambda before=before: len(reader.samples) > before + 3)
            assert not reader.source.fault
            hoist.close()
            reader.until(lambda: reader.source.fault)


def test_a_timestamp_that_stands_still_is_stale_after_its_time() -> None:
    begin = datetime(2026, 5, 1, tzinfo=UTC)
    fresh = Freshness(2.0)
    assert [fresh.fault(begin, now_s) for now_s in (100.0, 101.0, 102.0, 102.1)] == [
        "", "", "", STALE,
    ]  # fmt: skip
    assert fresh.fault(begin + timedelta(milliseconds=1), 102.2) == ""
    assert fresh.fault(None, 102.3) == NO_TIMESTAMP
    assert Freshness(None).fault(None, 0.0) == ""


def test_a_line_with_missing_values() -> None:
    chosen = settings(4840)
    parse = chosen.parser()
    found: Any = parse(line_of([1.0, "BadNoCommunication", -2.5, 3.0], OPCUA_START))
    assert (found.payout, found.tension, found.motor_tension) == (1.0, -2.5, 3.0)
    assert math.isnan(found.speed)
    assert found.missing.fault == "speed BadNoCommunication"
    with pytest.raises(Refusal) as short:
        parse(line_of([1.0, 2.0, 3.0], OPCUA_START))
    assert (short.value.reason, short.value.fault) == ("incomplete", "3 values after $OPCUA")


def test_addresses_of_endpoints() -> None:
    assert read_address("opc.tcp://plc:4840") == Address("opc.tcp", "plc", 4840)
    one = read_address("opc.tcp://[::1]:4840/UA/Hoist")
    assert one == Address("opc.tcp", "::1", 4840, "/UA/Hoist")
    with pytest.raises(InputError, match="port 70000"):
        read_address("opc.tcp://plc:70000/x")
    with pytest.raises(InputError, match="it is no address"):
        read_address("opc.tcp://plc")


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"nodes": {"tensoin": {"id": "i=1"}}}, "did you mean 'tension'"),
        ({"nodes": {}}, "nodes has no quantity; give tension, speed or payout"),
        ({"units": {"payout": "m", "speed": "m/s"}}, "units has no tension; there is no default"),
        ({"positive": {"speed": "out"}}, "positive has no payout; there is no default"),
        ({"stamp": "instrument"}, "opcua has no time; give arrival"),
        ({"registers": {"tension": 1}}, "registers has no effect with opcua; remove it"),
        ({"format": "lci90"}, "nodes has no effect with lci90; remove it"),
    ],
)
def test_settings_that_cannot_be_are_one_sentence(change: dict[str, Any], reason: str) -> None:
    nodes = change.pop("nodes", None)
    assert reason in str(settings(4840, nodes, **change).check())


def test_a_node_that_cannot_be_is_one_sentence() -> None:
    for words in ("Hoist.Load", "ns=2", "ns=x;s=Load", "s=", ""):
        assert "give one such as ns=2;s=Hoist.Load" in str(OpcNode(id=words).check())
    for words in ("i=85", "ns=4;i=5001", "ns=2;s=a;b=c", f"nsu={URI};g=09087e75-8e5e-499b-954f-1"):
        assert OpcNode(id=words).check() is None
    assert "scale is 0" in str(OpcNode(id="i=1", scale=0.0).check())


def test_settings_of_a_file(tmp_path: Path) -> None:
    """Maps of the documentation are read; a wrong node is one sentence with its place."""
    page = (Path(__file__).parents[2] / "docs" / "how-to" / "instruments.md").read_text("utf-8")
    text = page.partition("## Nodes of an OPC UA server")[2].split("```")[1].removeprefix("yaml")
    path = tmp_path / "feeds.yaml"
    path.write_text(text, "utf-8")
    (one,) = read_settings(str(path)).values()
    assert one.nodes["payout"] == OpcNode(id=f"nsu={URI};s=Hoist.Length", scale=0.001)
    path.write_text(text.replace("ns=2;i=5001", "5001"), "utf-8")
    with pytest.raises(SceneError, match=r"feeds\.winch\.nodes\.tension.*id is '5001'; give one"):
        read_settings(str(path))


def test_other_sources_are_refused() -> None:
    for one in (
        settings(4840, source="udp://:6224"),
        FeedSettings(format="lci90", source="opc.tcp://127.0.0.1:4840"),
    ):
        with pytest.raises(InputError, match=r"format opcua takes opc\.tcp://HOST:PORT/PATH"):
            open_source(one, lambda *_: None)
