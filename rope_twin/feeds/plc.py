"""Sources that poll a PLC: registers by Modbus TCP or RTU, or nodes of an OPC UA server.

One poll gives one line `$MODBUS,VALUE,...*hh` or `$OPCUA,VALUE,...*hh`, stamped in the middle
between request and reply. The values of one poll are consistent:

* Modbus (pymodbus): if their registers fit into one request, as the specification allows 125 of
  them (MODBUS Application Protocol V1.1b3, 6.3).
* OPC UA (asyncua): all nodes are read in one request, and a server that does not answer is noticed;
  a subscription would report changes only, and could not tell a winch that stands still from one
  that has fallen silent. A value whose status is not Good (OPC 10000-4, 7.39), or whose source
  timestamp stands still, is missing: its status is in its place.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
import time
from collections.abc import Awaitable
from datetime import datetime
from typing import Any, TypeVar

from rope_twin.errors import InputError, require
from rope_twin.feeds.configuration import FeedSettings
from rope_twin.feeds.readings import OPCUA_START, Register, line_of, requests
from rope_twin.feeds.transports import SERIAL, Address, Source, Take

_MODBUS_TIMEOUT_S = 1.0  # of a request, and of a connection
_OPCUA_TIMEOUT_S = 2.0
_POLL_S = 0.2  # until a stop request is noticed
_PARITIES = {"none": "N", "even": "E", "odd": "O"}
STALE, NO_TIMESTAMP, NO_NUMBER = "Stale", "NoSourceTimestamp", "NoNumber"
_UNKNOWN = "BadNodeIdUnknown", "BadNodeIdInvalid"

Given = TypeVar("Given")


class ModbusSource(Source):
    """Polls the registers of one device at a rate, and hands over a line for each poll."""

    def __init__(self, address: Address, take: Take, settings: FeedSettings) -> None:
        """Prepare the polls.

        Raises:
            InputError: pymodbus is not installed, or a serial line has no parity.
        """
        super().__init__(address, take)
        if address.kind == SERIAL and not settings.parity:
            remedy = f"give {', '.join(_PARITIES)}; there is no default"
            raise InputError(f"source {address}", "parity is missing", remedy)
        if address.kind != SERIAL and settings.parity:
            problem = f"parity is '{settings.parity}'"
            raise InputError(f"source {address}", problem, "it is of a serial line; remove it")
        require("pymodbus", "pymodbus is missing", "modbus", "source modbus")
        from pymodbus import client

        self._clients, self._parity = client, settings.parity
        self._registers = dict(settings.registers)
        self._requests = requests(self._registers)
        self._period_s, self._device = 1.0 / settings.poll_rate_hz, settings.device

    def _client(self) -> Any:
        name, number = self._address.name, self._address.number
        limits = {"timeout": _MODBUS_TIMEOUT_S, "retries": 0}
        if self._address.kind == SERIAL:
            parity = _PARITIES[self._parity]
            return self._clients.ModbusSerialClient(name, baudrate=number, parity=parity, **limits)
        return self._clients.ModbusTcpClient(name or "127.0.0.1", port=number, **limits)

    def _read(self) -> None:
        with contextlib.closing(self._client()) as client:
            if not client.connect():
                end = "line" if self._address.kind == SERIAL else "server"
                raise OSError(None, f"no connection to the Modbus {end}")
            due_s = time.monotonic()
            while not self._stop.is_set():
                before_ns = time.time_ns()
                values = self._poll(client)
                arrival_ns = (before_ns + time.time_ns()) // 2
                self.fault = ""
                self._take(line_of(values), arrival_ns, True)
                # a poll that took longer than the period is followed by the next one at once
                due_s = max(due_s + self._period_s, time.monotonic())
                self._stop.wait(due_s - time.monotonic())

    def _poll(self, client: Any) -> list[float]:
        """Return the values of all registers. Raises OSError where the device refuses."""
        words: dict[tuple[str, int], int] = {}
        for table, first, count in self._requests:
            read = getattr(client, f"read_{table}_registers")
            try:
                reply = read(first, count=count, device_id=self._device)
            except Exception as error:  # pymodbus has its own kinds, for links and for frames
                raise OSError(None, f"{type(error).__name__}: {error}") from error
            if reply.isError() or len(reply.registers) < count:
                raise OSError(None, f"{table} register {first} to {first + count - 1}: {reply}")
            words |= {(table, first + k): word for k, word in enumerate(reply.registers)}
        return [self._value(client, register, words) for register in self._registers.values()]

    def _value(self, client: Any, register: Register, words: dict[tuple[str, int], int]) -> float:
        own = [words[register.table, at] for at in range(register.address, register.end)]
        kind, order = client.DATATYPE[register.type.upper()], register.word_order or "big"
        return register.scale * float(client.convert_from_registers(own, kind, word_order=order))


class Freshness:
    """Whether the source timestamp of a node still moves, by a clock of the reader's own."""

    def __init__(self, stale_after_s: float | None) -> None:
        """Begin without a value; stale_after_s: None accepts any timestamp."""
        self._limit_s = stale_after_s
        self._newest: datetime | None = None
        self._moved_s = 0.0

    def fault(self, stamp: datetime | None, now_s: float) -> str:
        """Return why the value with this source timestamp is missing, or ""."""
        if self._limit_s is None:
            return ""
        if stamp is None:
            return NO_TIMESTAMP
        if stamp != self._newest:
            self._newest, self._moved_s = stamp, now_s
        return STALE if now_s - self._moved_s > self._limit_s else ""


class OpcUaSource(Source):
    """Reads the nodes of one server at a rate, and hands over a line for each read."""

    def __init__(self, address: Address, take: Take, settings: FeedSettings) -> None:
        """Prepare the reads. Raises InputError: asyncua is not installed."""
        super().__init__(address, take)
        require("asyncua", "asyncua is missing", "opcua", "source opc.tcp")
        import asyncua

        self._asyncua: Any = asyncua
        logging.getLogger("asyncua").setLevel(logging.CRITICAL)  # `fault` says it in one sentence
        host = address.name or "127.0.0.1"
        host = f"[{host}]" if ":" in host else host
        self._url = f"opc.tcp://{host}:{address.number}{address.endpoint or '/'}"
        self._nodes, self._period_s = dict(settings.nodes), 1.0 / settings.poll_rate_hz
        self._stale_after_s = settings.stale_after_s

    def _read(self) -> None:
        asyncio.run(self._session())

    async def _session(self) -> None:
        """Connect and read until a stop is requested. Raises OSError."""
        client = self._asyncua.Client(self._url, timeout=_OPCUA_TIMEOUT_S)
        await self._answer(client.connect())
        try:
            request = await self._answer(self._request(client))
            fresh = [Freshness(self._stale_after_s) for _ in self._nodes]
            due_s = time.monotonic()
            while not self._stop.is_set():
                before_ns = time.time_ns()
                values = await self._answer(client.uaclient.read(request))
                arrival_ns = (before_ns + time.time_ns()) // 2
                fields = self._fields(values, fresh)
                self.fault = ""
                self._take(line_of(fields, OPCUA_START), arrival_ns, True)
                # a read that took longer than the period is followed by the next one at once
                due_s = max(due_s + self._period_s, time.monotonic())
                while (left_s := due_s - time.monotonic()) > 0.0 and not self._stop.is_set():
                    await asyncio.sleep(min(left_s, _POLL_S))
        finally:
            with contextlib.suppress(Exception):  # the server may be gone
                await asyncio.wait_for(client.disconnect(), _OPCUA_TIMEOUT_S)

    async def _answer(self, asked: Awaitable[Given]) -> Given:
        """Return the answer of the server. Raises OSError if there is none, or a refusal."""
        try:
            return await asyncio.wait_for(asked, 2.0 * _OPCUA_TIMEOUT_S)
        except TimeoutError:
            raise OSError(None, f"no answer within {2.0 * _OPCUA_TIMEOUT_S:g} s") from None
        except OSError:
            raise
        except Exception as error:  # asyncua has its own kinds, for links and for answers
            raise OSError(None, f"{type(error).__name__}: {error}") from error

    async def _request(self, client: Any) -> Any:
        """Return the request to read all values, not from a cache of the server."""
        ua, wanted = self._asyncua.ua, []
        for one in self._nodes.values():
            words = one.id
            if words.startswith("nsu="):
                uri, _, rest = words.removeprefix("nsu=").partition(";")
                known = await client.get_namespace_array()
                if uri not in known:
                    raise OSError(None, f"it has no namespace '{uri}'")
                words = f"ns={known.index(uri)};{rest}"
            node = ua.NodeId.from_string(words)
            wanted.append(ua.ReadValueId(NodeId=node, AttributeId=ua.AttributeIds.Value))
        return ua.ReadParameters(
            MaxAge=0, TimestampsToReturn=ua.TimestampsToReturn.Source, NodesToRead=wanted
        )

    def _fields(self, values: Any, fresh: list[Freshness]) -> list[float | str]:
        """Return the value of each node in its unit, or why it is missing.

        Raises:
            OSError: the server does not have a node.
        """
        found: list[float | str] = []
        now_s = time.monotonic()
        for (name, node), read, moving in zip(self._nodes.items(), values, fresh, strict=True):
            status, stamp = read.StatusCode, read.SourceTimestamp
            if status is not None and not status.is_good():
                if status.name in _UNKNOWN:
                    raise OSError(None, f"{name}: node {node.id}: {status.name}")
                found.append(status.name)
                continue
            value = None if read.Value is None else read.Value.Value
            fault = moving.fault(stamp, now_s)
            if isinstance(value, bool) or not isinstance(value, int | float):
                found.append(NO_NUMBER)
            elif fault or not math.isfinite(value):
                found.append(fault or NO_NUMBER)
            else:
                found.append(node.scale * value)
        return found
