"""Settings of feeds: format, units, signs and source of each instrument, from a YAML file.

Units and signs have no default, since hardly any telegram states them and ships differ.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from rope_twin.errors import InputError, did_you_mean
from rope_twin.feeds import telegrams
from rope_twin.feeds.readings import OPCUA_START, START, OpcNode, Parser, Register
from rope_twin.files import share_dir
from rope_twin.quantity import quantity, text
from rope_twin.scene.reader import Place, read_document, read_object

_G = 9.80665  # standard gravity [m/s²], exact
_LB_N = 0.45359237 * _G
_FT_M = 0.3048
UNITS: dict[str, dict[str, float]] = {
    "tension": {
        "N": 1.0, "kN": 1e3, "daN": 10.0, "kgf": _G, "t": 1e3 * _G, "lbf": _LB_N,
        "klbf": 1e3 * _LB_N, "short_ton": 2e3 * _LB_N, "long_ton": 2240.0 * _LB_N,
    },
    "payout": {"m": 1.0, "cm": 0.01, "ft": _FT_M, "fathom": 6.0 * _FT_M},
    "speed": {
        "m/s": 1.0, "cm/s": 0.01, "m/min": 1.0 / 60.0, "m/h": 1.0 / 3600.0, "ft/s": _FT_M,
        "ft/min": _FT_M / 60.0,
    },
    "heave": {"m": 1.0, "cm": 0.01, "ft": _FT_M},
}  # fmt: skip
SIGNS: dict[str, dict[str, float]] = {
    "payout": {"out": 1.0, "in": -1.0},
    "speed": {"out": 1.0, "in": -1.0},
    "heave": {"up": 1.0, "down": -1.0},
    "roll": {"port_up": 1.0, "starboard_up": -1.0},  # REP 103: x forward, y to port
    "pitch": {"bow_down": 1.0, "bow_up": -1.0},
}
MODBUS, OPCUA = "modbus", "opcua"
LINE, MOTION = "line monitor", "motion sensor"
LOAD_PIN, MOTOR = "load_pin", "motor"
CRANE_TIP, REFERENCE = "crane_tip", "reference"
ARRIVAL, INSTRUMENT = "arrival", "instrument"
NO_FIT = 3  # samples whose parabola gives the rate of the middle one
EM3000 = "em3000"  # the only binary format: records without an end of line
_QUANTITIES = ("tension", "speed", "payout")
MAPPED = {MODBUS: "registers", OPCUA: "nodes"}  # formats that are polled by the map of a key
_SPECIAL = (  # keys of some formats only
    "tension_of", "channel", "length_at", "checksum", "start", "columns", "sentences", "heave_of",
    "rest_heading_deg", "registers", "nodes", "stale_after_s",
    "parity",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class FeedSettings:
    """Settings of one instrument."""

    format: str = text("format of its lines, such as lci90 or psxn")
    source: str = text(
        "where its lines come from: FILE, udp://HOST:PORT, tcp://HOST:PORT, serial:DEVICE@BAUD, "
        "modbus://HOST:PORT or opc.tcp://HOST:PORT/PATH",
        "",
    )
    units: dict[str, str] = field(
        default_factory=dict, metadata={"about": "unit of each quantity in its lines"}
    )
    positive: dict[str, str] = field(
        default_factory=dict, metadata={"about": "what a positive value of each quantity means"}
    )
    winch: str = text("name of its winch in the scene", "winch")
    tension_of: str = text("what its tension is of: load_pin (at the sheave) or motor", "")
    channel: str = text("number of the winch or display in its lines; empty: all", "")
    length_at: str = text("rcwd: line out measured at the block or at the motor", "")
    checksum: str = text("wir, columns: xor, sum or none", "")
    start: str = text("columns: beginning of a line, such as $R30C", "")
    columns: dict[str, int] = field(
        default_factory=dict,
        metadata={"about": "columns: number of the field of each quantity, the start being 0"},
    )
    sentences: str = text("psxn, octans: sentences that make a reading, such as PHTRO PHLIN", "")
    registers: dict[str, Register] = field(
        default_factory=dict, metadata={"about": "modbus: registers of each quantity"}
    )
    parity: str = text("modbus by a serial line: none, even or odd", "")
    device: int = quantity("modbus: unit identifier of the device", "", 0, 255, default=1)
    nodes: dict[str, OpcNode] = field(
        default_factory=dict, metadata={"about": "opcua: node of each quantity"}
    )
    stale_after_s: float | None = quantity(
        "opcua: a value is missing once its source timestamp has stood still for so long", "s",
        0.01, 600.0, default=None,
    )  # fmt: skip
    poll_rate_hz: float = quantity("modbus, opcua: polls a second", "Hz", 0.1, 100.0, default=10.0)
    heave_of: str = text("point whose heave is meant: crane_tip or reference", "")
    rest_heading_deg: float | None = quantity(
        "true heading of the bow in the scene's rest attitude", "°", 0.0, 360.0, default=None
    )
    fit_samples: int = quantity("motion sensors: number of samples in each fit, odd; 3: no fit", "",
                                3, 101, default=NO_FIT)  # fmt: skip
    stamp: str = text("time of a reading: arrival, or the instrument's own clock", ARRIVAL)
    latency_s: float = quantity("delay from the measurement to the stamp, subtracted from it", "s",
                                0.0, 10.0, default=0.0)  # fmt: skip
    silent_after_s: float = quantity("time without a reading after which data are missing", "s",
                                     0.01, 600.0, default=1.0)  # fmt: skip
    replay_rate_hz: float = quantity("rate of the lines of a file that have no time; 0: they have",
                                     "Hz", 0.0, 1000.0, default=0.0)  # fmt: skip
    forward: str = text("serve the lines to several readers: tcp-server://HOST:PORT", "")

    def check(self) -> str | None:
        """Return problem of the settings and remedy, or None."""
        form = FORMATS.get(self.format)
        if form is None:
            return f"format '{self.format}' is unknown; {did_you_mean(self.format, FORMATS)}"
        choices: dict[str, tuple[str, ...]] = {"stamp": (ARRIVAL, INSTRUMENT)}
        if form.kind == LINE:
            if "tension_of" in form.takes:
                choices["tension_of"] = (LOAD_PIN, MOTOR)
            if self.fit_samples != NO_FIT:
                return "fit_samples is of motion sensors; remove it"
        else:
            choices["heave_of"] = (CRANE_TIP, REFERENCE)
            if self.fit_samples % 2 == 0:
                return f"fit_samples is {self.fit_samples}; give an odd number"
        if self.parity:
            choices["parity"] = ("none", "even", "odd")
        for key, allowed in (choices | {**form.keys}).items():
            if (value := getattr(self, key)) not in allowed:
                problem = f"{key} is '{value}'" if value else f"{key} is missing"
                return f"{problem}; give {' or '.join(allowed)}"
        if self.stamp == INSTRUMENT and not form.has_time:
            return f"stamp is instrument, but {self.format} has no time; give arrival"
        if self.heave_of == REFERENCE and self.rest_heading_deg is None:
            return "rest_heading_deg is missing; give the true heading of the bow at rest [°]"
        if self.heave_of == REFERENCE and self.sentences.startswith("PHLIN"):
            problem = f"sentences is '{self.sentences}', without roll and pitch"
            return f"{problem}; give PHTRO {self.sentences}"
        if self.forward and not self.forward.startswith("tcp-server://"):
            return f"forward is '{self.forward}'; give tcp-server://HOST:PORT"
        fault = self._columns_fault() if self.format == "columns" else None
        if self.format in MAPPED:
            fault = self._map_fault(MAPPED[self.format])
        if fault := fault or self._idle_key():
            return fault
        units, signs = _measured(form.units, self), _measured(form.signs, self)
        return _table_fault("units", self.units, units, UNITS) or _table_fault(
            "positive", self.positive, signs, SIGNS
        )

    def _idle_key(self) -> str | None:
        """Return the complaint about a key that this format does not take, or None."""
        used = {*FORMATS[self.format].keys, *FORMATS[self.format].takes}
        if self.heave_of != REFERENCE:
            used.discard("rest_heading_deg")
        for key in _SPECIAL:
            if getattr(self, key) not in ("", None, {}) and key not in used:
                return f"{key} has no effect with {self.format}; remove it"
        return None

    def _columns_fault(self) -> str | None:
        if not self.start:
            return "start is missing; give the beginning of a line, such as $R30C"
        if "," in self.start:
            return f"start is '{self.start}'; give what is before the first comma"
        known = (*_QUANTITIES, "motor_tension", "channel")
        names: dict[int, str] = {}
        for name, column in self.columns.items():
            if name not in known:
                return f"columns has '{name}'; {did_you_mean(name, known)}"
            if not 1 <= column <= 99:
                return f"column of {name} is {column}; give a number from 1 to 99"
            if column in names:
                return f"column of {name} is {column}, that of {names[column]}; give its own"
            names[column] = name
        if not set(self.columns) & set(_QUANTITIES):
            return "columns has no quantity; give tension, speed or payout"
        return None

    def _map_fault(self, key: str) -> str | None:
        mapping, known = getattr(self, key), (*_QUANTITIES, "motor_tension")
        for name in mapping:
            if name not in known:
                return f"{key} has '{name}'; {did_you_mean(name, known)}"
        if not set(mapping) & set(_QUANTITIES):
            return f"{key} has no quantity; give tension, speed or payout"
        return None

    def parser(self) -> Parser:
        """Return a new parser of this instrument's lines."""
        return FORMATS[self.format].make(self)

    @property
    def is_line_monitor(self) -> bool:
        """Return whether it is a line monitor; else it is a motion sensor."""
        return FORMATS[self.format].kind == LINE


def _table_fault(
    key: str,
    given: Mapping[str, str],
    needed: tuple[str, ...],
    known: Mapping[str, Mapping[str, float]],
) -> str | None:
    """Return what is wrong with `units` or `positive`, or None."""
    for name in needed:
        options = " or ".join(known[name])
        if name not in given:
            return f"{key} has no {name}; there is no default, give {options}"
        if given[name] not in known[name]:
            return f"{key} of {name} is '{given[name]}'; give {options}"
    for name in given:
        if name not in needed:
            remedy = f"it takes {', '.join(needed)}" if needed else "remove it"
            return f"{key} has '{name}', which this format does not take; {remedy}"
    return None


class Format(NamedTuple):
    """Row of the table of formats."""

    kind: str
    about: str
    make: Callable[[FeedSettings], Parser]
    units: tuple[str, ...]  # quantities whose unit the settings must state
    signs: tuple[str, ...]  # quantities whose sign they must state
    keys: Mapping[str, tuple[str, ...]] = {}  # further keys that they must give, and their values
    has_time: bool = False
    takes: tuple[str, ...] = ("heave_of", "rest_heading_deg")  # of _SPECIAL; here: motion sensors'


def _measured(names: tuple[str, ...], settings: FeedSettings) -> tuple[str, ...]:
    """Return the quantities that a feed by columns or a map has, or all of another one."""
    if settings.format not in ("columns", *MAPPED):
        return names
    quantities = {*settings.columns, *settings.registers, *settings.nodes}
    quantities |= {"tension"} if "motor_tension" in quantities else set()
    return tuple(name for name in names if name in quantities)


_LINE_SIGNS = ("speed", "payout")
_MOTION_SIGNS = ("heave", "roll", "pitch")
OCTANS_SENTENCES = ("PHTRO PHLIN", "PHTRO PHLIN PHSPD", "PHLIN PHSPD", "PHLIN")
FORMATS: dict[str, Format] = {
    "lci90": Format(
        LINE, "MTNW LCI-90 and LCI-90i: RD, with or without time and name",
        lambda s: telegrams.lci90(s.channel), _QUANTITIES, _LINE_SIGNS, has_time=True,
        takes=("tension_of", "channel"),
    ),
    "wir": Format(
        LINE, "UNOLS wire string: $WIR", lambda s: telegrams.wir(s.checksum),
        _QUANTITIES, _LINE_SIGNS, {"checksum": ("sum", "none")}, has_time=True,
        takes=("tension_of",),
    ),
    "rcwd": Format(
        LINE, "Rapp: @RCWD", lambda s: telegrams.rcwd(s.length_at, s.channel),
        _QUANTITIES, _LINE_SIGNS, {"length_at": ("block", "motor")}, takes=("channel",),
    ),
    "columns": Format(
        LINE, "any line of separated fields, such as $R30C of MacArtney's Mermac",
        lambda s: telegrams.columns(s.start, s.columns, s.checksum, s.channel),
        _QUANTITIES, _LINE_SIGNS, {"checksum": telegrams.SUM_KINDS},
        takes=("tension_of", "channel", "start", "columns"),
    ),
    MODBUS: Format(
        LINE, "Modbus TCP or RTU by a map of registers",
        lambda s: telegrams.columns(START, {n: k for k, n in enumerate(s.registers, 1)}, "xor"),
        _QUANTITIES, _LINE_SIGNS, takes=("tension_of", "registers", "parity"),
    ),
    OPCUA: Format(
        LINE, "OPC UA by a map of nodes", lambda s: telegrams.polled(OPCUA_START, (*s.nodes,)),
        _QUANTITIES, _LINE_SIGNS, takes=("tension_of", "nodes", "stale_after_s"),
    ),
    "psxn": Format(
        MOTION, "Kongsberg Seapath: $PSXN,20, 23 and 24",
        lambda s: telegrams.psxn(s.sentences == "23 24"), (), _MOTION_SIGNS,
        {"sentences": ("", "23", "23 24")},
    ),
    "pashr": Format(
        MOTION, "Applanix, Trimble and others: $PASHR", lambda s: telegrams.pashr,
        ("heave",), _MOTION_SIGNS, has_time=True,
    ),
    "tss1": Format(
        MOTION, "TSS1 and CDL: colon and hexadecimal accelerations",
        lambda s: telegrams.tss1, (), _MOTION_SIGNS,
    ),
    "tss3": Format(
        MOTION, "TSS3: with remote heave, used where heave_of is crane_tip",
        lambda s: telegrams.tss3(s.heave_of == CRANE_TIP), (), _MOTION_SIGNS,
    ),
    "em3000": Format(
        MOTION, "Kongsberg EM3000, binary", lambda s: telegrams.em3000, (), _MOTION_SIGNS
    ),
    "octans": Format(
        MOTION, "iXblue Octans and Phins: $PHTRO, $PHLIN, $PHSPD, $PHINF",
        lambda s: telegrams.octans(s.sentences or OCTANS_SENTENCES[0]), (), ("heave",),
        {"sentences": ("", *OCTANS_SENTENCES)},
    ),
    "phtrh": Format(
        MOTION, "iXblue Octans: $PHTRH; positive heave is that of its letter O or U",
        lambda s: telegrams.phtrh(s.positive["letter"]), (), ("letter",),
    ),
    "smc": Format(
        MOTION, "SMC: $PSMCE and $PSMCK", lambda s: telegrams.smc, (), _MOTION_SIGNS
    ),
    "norsub": Format(
        MOTION, "Norwegian Subsea: $PNORSUB2", lambda s: telegrams.norsub, (), _MOTION_SIGNS
    ),
}  # fmt: skip
SIGNS["letter"] = {"O": 1.0, "U": 1.0}  # PHTRH: the letter of a heave that is up


@dataclass(frozen=True, kw_only=True)
class FeedsFile:
    """Settings of all feeds in a file."""

    feeds: dict[str, FeedSettings] = text("name of each feed and its settings")

    def check(self) -> str | None:
        """Return what is wrong with the file, or None."""
        return None if self.feeds else "feeds is empty; name at least one feed"


def read_settings(name_or_path: str) -> dict[str, FeedSettings]:
    """Return the feeds of a settings file, from a name in config/feeds/ or a path.

    Raises:
        InputError: there is no such file or name.
        SceneError: the file is invalid; one sentence for each error.
    """
    folder = share_dir() / "config" / "feeds"
    names = sorted(path.stem for path in folder.glob("*.yaml"))
    path = folder / f"{name_or_path}.yaml" if name_or_path in names else Path(name_or_path)
    if not path.is_file():
        problem = "there is no such file or name in config/feeds/"
        raise InputError(f"settings '{name_or_path}'", problem, did_you_mean(name_or_path, names))
    item, _ = read_document(path)
    read: FeedsFile = read_object(FeedsFile, item, Place(path))
    return read.feeds


def with_source(
    feeds: Mapping[str, FeedSettings], source: str, name: str = ""
) -> dict[str, FeedSettings]:
    """Return one feed of a file with another source.

    Raises:
        InputError: the file has several feeds and none is named, or not this one.
    """
    if not name and len(feeds) != 1:
        problem = f"the settings have {len(feeds)} feeds"
        raise InputError(f"source {source}", problem, f"name one: {', '.join(feeds)}")
    chosen = name or next(iter(feeds))
    if chosen not in feeds:
        raise InputError(f"feed '{chosen}'", "not in the settings", did_you_mean(chosen, feeds))
    one = feeds[chosen]
    return {chosen: dataclasses.replace(one, source=source) if source else one}
