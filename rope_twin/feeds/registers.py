"""Maps of a PLC: the place of each quantity in registers or nodes, and the line of a poll.

Modbus has no standard map, so the settings of a feed say where each quantity is: address (counted
from 0), table, type, word order of types of several registers, and scale; its unit is in `units`.
OPC UA has types, and nodes with names that each PLC chooses.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from rope_twin.feeds.readings import nmea
from rope_twin.quantity import quantity, text

START, OPCUA_START = "$MODBUS", "$OPCUA"
# type and number of registers
TYPES = {"int16": 1, "uint16": 1, "int32": 2, "uint32": 2, "int64": 4, "uint64": 4,
         "float32": 2, "float64": 4}  # fmt: skip
TABLES = "holding", "input"
MOST_REGISTERS = 125  # in one request


@dataclass(frozen=True, kw_only=True)
class Register:
    """Place of one quantity in the registers of a PLC."""

    address: int = quantity("address of its first register, counted from 0", "", 0, 65535)
    table: str = text("holding or input registers")
    type: str = text(f"type of the value: {', '.join(TYPES)}")
    word_order: str = text(
        "of types of several registers: big (most significant word first) or little", ""
    )
    scale: float = quantity("factor from the number in the registers to the value in its unit", "",
                            -1e12, 1e12, default=1.0)  # fmt: skip

    def check(self) -> str | None:
        """Return what is wrong and what would be right, or None."""
        if self.table not in TABLES:
            return f"table is '{self.table}'; give {' or '.join(TABLES)}"
        if self.type not in TYPES:
            return f"type is '{self.type}'; give one of {', '.join(TYPES)}"
        if self.scale == 0.0:
            return "scale is 0; give the value of one count"
        if TYPES[self.type] == 1 and self.word_order:
            return f"word_order has no effect with {self.type}; remove it"
        if TYPES[self.type] > 1 and self.word_order not in ("big", "little"):
            return f"word_order of {self.type} is missing; there is no default, give big or little"
        if self.address + TYPES[self.type] > 65536:
            return f"address {self.address} is too high for {self.type}; the last one is 65535"
        return None

    @property
    def end(self) -> int:
        """Return the address after its last register."""
        return self.address + TYPES[self.type]


def requests(registers: Mapping[str, Register]) -> list[tuple[str, int, int]]:
    """Return table, first address and count of the requests for all registers, as few as can be."""
    found: list[tuple[str, int, int]] = []
    for one in sorted(registers.values(), key=lambda one: (one.table, one.address, one.end)):
        if found:
            table, first, count = found[-1]
            if one.table == table and one.end - first <= MOST_REGISTERS:
                found[-1] = table, first, max(count, one.end - first)
                continue
        found.append((one.table, one.address, one.end - one.address))
    return found


_NODE = re.compile(r"(?:(?:ns=\d{1,5}|nsu=[^;]+);)?(?:i=\d{1,10}|[sgb]=.+)")


@dataclass(frozen=True, kw_only=True)
class OpcNode:
    """Node of one quantity in the address space of an OPC UA server."""

    id: str = text("its identifier, such as ns=2;s=Hoist.Load or nsu=URI;i=5001")
    scale: float = quantity("factor from its value to the value in its unit", "",
                            -1e12, 1e12, default=1.0)  # fmt: skip

    def check(self) -> str | None:
        """Return what is wrong and what would be right, or None."""
        if not _NODE.fullmatch(self.id):
            return f"id is '{self.id}'; give one such as ns=2;s=Hoist.Load or nsu=URI;i=5001"
        return "scale is 0; give the value of one count" if self.scale == 0.0 else None


def line_of(values: Sequence[float | str], start: str = START) -> bytes:
    """Return the line of one poll; a value that is not finite is left as it is, to be refused.

    values: in the order of the map; text: why a value is missing, or is no number.
    """
    fields = [
        one if isinstance(one, str) else f"{one:.9f}" if math.isfinite(one) else str(one)
        for one in values
    ]
    return nmea(",".join([start[1:], *fields]))
