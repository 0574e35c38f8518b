"""Settings, recorded or printed lines of every feed format, and what they mean."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rope_twin.feeds.configuration import FORMATS, FeedSettings
from rope_twin.feeds.readings import OpcNode, Register

DATA = Path(__file__).parents[1] / "data" / "feeds"
US = {
    "units": {"tension": "lbf", "payout": "m", "speed": "m/min"},
    "positive": {"payout": "in", "speed": "in"},
    "tension_of": "load_pin",
}
METRIC = {
    "units": {"tension": "t", "payout": "m", "speed": "m/min"},
    "positive": {"payout": "out", "speed": "out"},
}
UP = {"heave": "up", "roll": "port_up", "pitch": "bow_up"}
TIP = {"heave_of": "crane_tip"}
SETTINGS: dict[str, dict[str, Any]] = {
    "lci90": US,
    "wir": {**US, "checksum": "sum"},
    "rcwd": {**METRIC, "length_at": "block", "channel": "2"},
    "columns": {
        **METRIC, "tension_of": "motor", "start": "$R30C", "checksum": "xor",
        "columns": {"channel": 1, "payout": 2, "speed": 3, "tension": 4},
    },
    "modbus": {
        **METRIC, "tension_of": "load_pin",
        "registers": {
            name: {"address": 2 * k, "table": "holding", "type": "float32", "word_order": "big"}
            for k, name in enumerate(("payout", "speed", "tension"))
        },
    },
    "opcua": {
        **METRIC, "tension_of": "load_pin",
        "nodes": {name: {"id": f"ns=2;s=Hoist.{name}"} for name in ("payout", "speed", "tension")},
    },
    "psxn": {**TIP, "positive": {**UP, "heave": "down"}},
    "pashr": {**TIP, "positive": UP, "units": {"heave": "m"}},
    "tss1": {**TIP, "positive": UP},
    "tss3": {**TIP, "positive": UP},
    "em3000": {**TIP, "positive": UP},
    "octans": {**TIP, "positive": {"heave": "up"}},
    "phtrh": {**TIP, "positive": {"letter": "O"}},
    "smc": {**TIP, "positive": {**UP, "pitch": "bow_down"}},
    "norsub": {**TIP, "positive": {**UP, "heave": "down"}},
}  # fmt: skip
LINES = ("lci90", "wir", "rcwd", "columns", "modbus", "opcua")
MOTIONS = tuple(name for name in FORMATS if name not in LINES)
# A telegram of each format: lci90 as recorded; rcwd, psxn, pashr, tss1, tss3, octans, phtrh and
# smc as printed in manuals and cruise reports; wir, columns, modbus, opcua, em3000 and norsub are
# ours.
SAMPLES: dict[str, bytes] = {
    "lci90": b"\x0102RD,2014-08-01T00:28:38.351,STBD TRAWL,00000061,000000.0,-00034.0,3596\r\n",
    "wir": b"$WIR,2024-05-01,12:00:00.500,001234.0,-00030.0,-00100.5,00000000,00000000,3647\r\n",
    "rcwd": b"@RCWD,2,3,103.64,0.42,-29.95,0,102.96,0.294791*3d\r\n",
    "columns": b"$R30C,1,120.5,30.0,2.5*3F\r\n",
    "modbus": b"$MODBUS,120.500000000,30.000000000,2.500000000*32\r\n",
    "opcua": b"$OPCUA,120.500000000,30.000000000,2.500000000*78\r\n",
    "psxn": b"$PSXN,23,1.24,-2.35,218.66,0.15*19\r\n",
    "pashr": b"$PASHR,163029.000,158.09,T,-0.30,+0.31,+0.01,0.029,0.029,0.059,1,1*3B\r\n",
    "tss1": b":00FFCA -0003F-0325  0319\r\n",
    "tss3": b":R 0014 0014H 0037 0983\r\n",
    "em3000": bytes.fromhex("90907c0015ff0f006a55"),
    "octans": b"$PHTRO,1.72,M,0.34,T*4B\r\n$PHLIN,0.335,0.407,0.542*54\r\n",
    "phtrh": b"$PHTRH,1.81,M,1.69,B,0.16,O*09\r\n",
    "smc": b"$PSMCE,+03.20,+05.75,+350.7,-00.38,+00.26,+00.42*40\r\n",
    "norsub": b"$PNORSUB2,1234567,2500,1.24,-2.35,218.66,-0.15,0.20,0*62\r\n",
}


def settings(name: str, **more: Any) -> FeedSettings:
    """Return the checked settings of a format."""
    given = {**SETTINGS[name], **more}
    if "registers" in given:
        given["registers"] = {key: Register(**one) for key, one in given["registers"].items()}
    if "nodes" in given:
        given["nodes"] = {key: OpcNode(**one) for key, one in given["nodes"].items()}
    checked = FeedSettings(format=name, **given)
    assert checked.check() is None
    return checked
