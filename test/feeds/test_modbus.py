"""Registers of a PLC: their map, and polls of pymodbus's own server."""

from __future__ import annotations

import asyncio
import math
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from serial_cable import cable

from rope_twin.errors import InputError
from rope_twin.feeds.configuration import FeedSettings
from rope_twin.feeds.instrument import Instrument, LineSample
from rope_twin.feeds.readings import MAX_REGISTERS, Register, line_of, requests
from rope_twin.feeds.transports import open_source

pytest.importorskip("pymodbus", reason="pymodbus is missing: pip install '.[modbus]'")
from pymodbus.server import ModbusSerialServer, ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

DEVICE = 7
MAP = {
    "payout": {"address": 100, "table": "input", "type": "int32", "word_order": "little",
               "scale": 0.01},
    "speed": {"address": 40, "table": "holding", "type": "int16", "scale": 0.1},
    "tension": {"address": 42, "table": "holding", "type": "float32", "word_order": "big"},
    "motor_tension": {"address": 300, "table": "holding", "type": "uint16"},
}  # fmt: skip


def settings(registers: dict[str, Any], **more: Any) -> FeedSettings:
    given: dict[str, Any] = {
        "format": "modbus",
        "registers": {name: Register(**one) for name, one in registers.items()},
        "units": {"payout": "m", "speed": "m/min", "tension": "kN"},
        "positive": {"payout": "in", "speed": "out"},
        "tension_of": "load_pin",
        "device": DEVICE,
        **more,
    }
    return FeedSettings(**given)


def plc() -> SimDevice:
    """A PLC with -1234.56 m, 12.3 m/min, 52.5 kN and 61 kN."""
    none = [SimData(0, values=[False] * 16, datatype=DataType.BITS)]
    count = -123456 & 0xFFFFFFFF
    inputs = [SimData(100, values=[count & 0xFFFF, count >> 16], datatype=DataType.REGISTERS)]
    holding = [
        SimData(40, values=123, datatype=DataType.INT16),
        SimData(41, values=0, datatype=DataType.INT16),
        SimData(42, values=52.5, datatype=DataType.FLOAT32),
        SimData(300, values=61, datatype=DataType.UINT16),
        SimData(400, values=math.nan, datatype=DataType.FLOAT32),
    ]
    return SimDevice(DEVICE, (none, none, holding, inputs))


@contextmanager
def served(make: Callable[[], Any]) -> Iterator[None]:
    """pymodbus's server in a thread of its own."""
    loop = asyncio.new_event_loop()
    ready, servers = threading.Event(), []

    async def serve() -> None:
        servers.append(make())
        await servers[0].serve_forever(background=True)
        ready.set()

    task = loop.create_task(serve())
    thread = threading.Thread(target=loop.run_forever, daemon=True)
    thread.start()
    assert ready.wait(20.0)
    yield
    assert task.done()
    asyncio.run_coroutine_threadsafe(servers[0].shutdown(), loop).result(10.0)
    loop.call_soon_threadsafe(loop.stop)
    thread.join(10.0)


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        number = int(one.getsockname()[1])
    with served(lambda: ModbusTcpServer(plc(), address=("127.0.0.1", number))):
        yield number


def polled(chosen: FeedSettings, wanted: int = 3) -> tuple[list[Any], Instrument, str]:
    """Samples of the first polls, the instrument, and the fault of the source."""
    instrument, samples, polls = Instrument(chosen), [], []

    def take(data: bytes, arrival_ns: int, whole: bool) -> None:
        polls.append(data)
        samples.extend(instrument.take(data, arrival_ns, whole))

    source = open_source(chosen, take)
    source.start()
    deadline = time.monotonic() + 30.0
    while len(polls) < wanted and not source.fault:
        assert time.monotonic() < deadline
        time.sleep(0.01)
    fault = source.fault
    source.close()
    return samples, instrument, fault


def test_registers_become_a_sample_in_si(port: int) -> None:
    chosen = settings(MAP, source=f"modbus://127.0.0.1:{port}", poll_rate_hz=50.0)
    assert chosen.check() is None
    before_ns = time.time_ns()
    samples, instrument, fault = polled(chosen)
    assert not fault
    first = samples[0]
    assert isinstance(first, LineSample)
    assert first.payout_m == pytest.approx(1234.56)  # positive is in
    assert first.speed_m_per_s == pytest.approx(12.3 / 60.0)
    assert (first.tension_n, first.motor_tension_n) == (52.5e3, 61e3)
    assert before_ns <= first.stamp_ns < samples[1].stamp_ns <= time.time_ns()
    assert instrument.counts.accepted >= 3
    assert instrument.counts.refused_total == 0


def test_registers_by_a_serial_line() -> None:
    """RTU over a cable that is unplugged and plugged again."""
    with cable() as line, served(lambda: ModbusSerialServer(plc(), port=line.back)):
        chosen = settings(MAP, source=f"serial:{line.out}@19200", parity="none", poll_rate_hz=20.0)
        assert chosen.check() is None
        samples, instrument, fault = polled(chosen)
        assert not fault
        assert samples[0].payout_m == pytest.approx(1234.56)
        assert (samples[0].tension_n, samples[0].motor_tension_n) == (52.5e3, 61e3)
        assert instrument.counts.refused_total == 0
        line.plugged = False
        samples, _, fault = polled(chosen, 1)
        assert "No response" in fault
        assert not samples
        line.plugged = True
        samples, _, fault = polled(chosen)
        assert not fault
        assert len(samples) >= 3
    _, _, fault = polled(settings(MAP, source="serial:/dev/none@19200", parity="even"), 1)
    assert fault == "no connection to the Modbus line"


def test_a_serial_line_needs_its_parity() -> None:
    for source, parity, words in (
        ("serial:/dev/ttyS0@19200", "", "parity is missing; give none, even, odd"),
        ("modbus://plc:502", "even", "parity is 'even'; it is of a serial line; remove it"),
    ):
        with pytest.raises(InputError, match=words):
            open_source(settings(MAP, source=source, parity=parity), lambda *_: None)
    assert "parity is 'mark'; give none or even or odd" in str(settings(MAP, parity="mark").check())


def test_a_number_that_is_none_is_refused(port: int) -> None:
    tension = {**MAP["tension"], "address": 400}
    chosen = settings({"tension": tension}, source=f"modbus://127.0.0.1:{port}",
                      units={"tension": "kN"}, positive={})  # fmt: skip
    assert chosen.check() is None
    samples, instrument, _ = polled(chosen, 1)
    assert samples == []
    assert instrument.counts.refused == {"not a number": 1}
    several = {"payout": MAP["payout"], "speed": MAP["speed"], "tension": tension}
    chosen = settings(several, source=f"modbus://127.0.0.1:{port}")
    samples, instrument, _ = polled(chosen, 2)
    assert math.isnan(samples[0].tension_n), "a load cell that fails leaves the line out"
    assert samples[0].payout_m == pytest.approx(1234.56)
    assert instrument.counts.last_fault == "not a number: tension 'nan'"


def test_a_register_that_the_device_does_not_have_is_a_fault_of_the_connection(port: int) -> None:
    chosen = settings({**MAP, "speed": {**MAP["speed"], "address": 900}},
                      source=f"modbus://127.0.0.1:{port}")  # fmt: skip
    _, _, fault = polled(chosen, 1)
    assert "holding register 900" in fault
    _, _, fault = polled(settings(MAP, source="modbus://127.0.0.1:9"), 1)
    assert fault == "no connection to the Modbus server"


def test_registers_are_read_in_as_few_requests_as_can_be() -> None:
    def at(address: int, kind: str = "int16", table: str = "holding") -> Register:
        order = "" if kind == "int16" else "big"
        return Register(address=address, table=table, type=kind, word_order=order)

    assert requests({"a": at(5), "b": at(0, "int32"), "c": at(3, table="input")}) == [
        ("holding", 0, 6), ("input", 3, 1),
    ]  # fmt: skip
    last = MAX_REGISTERS - 2
    assert requests({"a": at(0), "b": at(last, "int32")}) == [("holding", 0, MAX_REGISTERS)]
    assert len(requests({"a": at(0), "b": at(last + 1, "int32")})) == 2


@pytest.mark.parametrize("value", [0.0, -1234.56, 1e9 / 3.0, 123456789012345.0, -1e-9])
def test_a_line_holds_a_value_to_a_billionth(value: float) -> None:
    chosen = settings({"payout": MAP["payout"]}, units={"payout": "m"}, positive={"payout": "out"})
    reading = chosen.parser()(line_of([value]))
    assert reading.payout == pytest.approx(value, rel=1e-15, abs=1e-9)  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("name", "change", "reason"),
    [
        ("payout", {"word_order": ""}, "word_order of int32 is missing; there is no default"),
        ("speed", {"word_order": "big"}, "word_order has no effect with int16; remove it"),
        ("speed", {"type": "int8"}, "type is 'int8'"),
        ("speed", {"table": "coil"}, "give holding or input"),
        ("speed", {"scale": 0.0}, "scale is 0"),
        ("payout", {"address": 65535}, "too high for int32"),
    ],
)
def test_an_impossible_register_is_one_sentence(
    name: str, change: dict[str, Any], reason: str
) -> None:
    assert reason in str(Register(**{**MAP[name], **change}).check())


def test_settings_that_cannot_be_are_refused() -> None:
    assert "did you mean 'payout'" in str(settings({"payuot": MAP["payout"]}).check())
    assert "units has no tension; there is no default" in str(settings(MAP, units={}).check())
    assert "registers has no quantity" in str(settings({}).check())
    lci = FeedSettings(format="lci90", source="modbus://127.0.0.1:502")
    for one in (lci, settings(MAP, source="udp://:6224")):
        with pytest.raises(InputError, match="format modbus takes modbus://HOST:PORT"):
            open_source(one, lambda *_: None)
