"""Source that polls the registers of a PLC by Modbus TCP or RTU, with pymodbus.

One poll gives one line `$MODBUS,VALUE,...*hh`, stamped in the middle between request and reply.
The values of one poll are consistent if their registers fit into one request, as the specification
allows 125 of them (MODBUS Application Protocol V1.1b3, 6.3).
"""

from __future__ import annotations

import contextlib
import time
from typing import Any

from rope_twin.errors import InputError
from rope_twin.feeds.configuration import FeedSettings
from rope_twin.feeds.readings import Register, line_of, requests
from rope_twin.feeds.transports import SERIAL, Address, Source, Take

_TIMEOUT_S = 1.0
_PARITIES = {"none": "N", "even": "E", "odd": "O"}


def load_pymodbus() -> Any:
    """Return the clients of pymodbus.

    Raises:
        InputError: it is not installed.
    """
    try:
        from pymodbus import client
    except ImportError as error:
        right = "install it with: pip install '.[modbus]'"
        raise InputError("source modbus", f"pymodbus is missing ({error})", right) from None
    return client


class ModbusSource(Source):
    """Polls the registers of one device at a rate, and hands over a line for each poll."""

    def __init__(self, address: Address, take: Take, settings: FeedSettings) -> None:
        """Prepare the polls.

        Raises:
            InputError: pymodbus is not installed, or a serial line has no parity.
        """
        super().__init__(address, take)
        if (address.kind == SERIAL) != bool(settings.parity):
            what, right = "parity is missing", f"give {', '.join(_PARITIES)}; there is no default"
            if settings.parity:
                what, right = f"parity is '{settings.parity}'", "it is of a serial line; remove it"
            raise InputError(f"source {address}", what, right)
        self._clients, self._parity = load_pymodbus(), settings.parity
        self._registers = dict(settings.registers)
        self._requests = requests(self._registers)
        self._period_s, self._device = 1.0 / settings.poll_rate_hz, settings.device

    def _client(self) -> Any:
        name, number = self._address.name, self._address.number
        if self._address.kind == SERIAL:
            return self._clients.ModbusSerialClient(
                name, baudrate=number, parity=_PARITIES[self._parity], timeout=_TIMEOUT_S, retries=0
            )
        name = name or "127.0.0.1"
        return self._clients.ModbusTcpClient(name, port=number, timeout=_TIMEOUT_S, retries=0)

    def _read(self) -> None:
        client = self._client()
        with contextlib.closing(client):
            if not client.connect():
                raise OSError(None, f"no connection to the Modbus {self._end}")
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

    @property
    def _end(self) -> str:
        return "line" if self._address.kind == SERIAL else "server"

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
        return [self._value(client, one, words) for one in self._registers.values()]

    def _value(self, client: Any, one: Register, words: dict[tuple[str, int], int]) -> float:
        own = [words[one.table, at] for at in range(one.address, one.end)]
        kind = client.DATATYPE[one.type.upper()]
        return one.scale * float(
            client.convert_from_registers(own, kind, word_order=one.word_order or "big")
        )
