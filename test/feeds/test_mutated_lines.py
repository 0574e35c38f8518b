"""Mutated lines of every format: no crash, no number that is not finite, none out of range.

`python test/feeds/test_mutated_lines.py [COUNT]` runs 1e7 lines, or COUNT.
"""

from __future__ import annotations

import math
import random
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

import pytest
from feed_samples import LINES, MOTIONS, SAMPLES, settings

from rope_twin.feeds.instrument import (
    MAX_HEAVE_M,
    MAX_PAYOUT_M,
    MAX_SPEED_M_PER_S,
    MAX_TENSION_N,
    MAX_TILT_DEG,
    Instrument,
    LineSample,
)
from rope_twin.feeds.readings import REASONS, nmea, sum_of

IN_CI, LONG = 100_000, 10_000_000
S = 1_000_000_000
ALPHABET = b"0123456789+-.,*$@:\\ RDTMBPeEinfaNx\r\n\x00\x01\x1e\x90\xff"
NAMES = (*LINES, *MOTIONS)


def mutated(line: bytes, chance: random.Random) -> bytes:
    """A line with one to four bytes changed, put in, taken out, or a part repeated or cut."""
    data = bytearray(line)
    for _ in range(chance.randint(1, 4)):
        at = chance.randrange(len(data) + 1)
        match chance.randrange(5):
            case 0 if at < len(data):
                data[at] = chance.choice(ALPHABET)
            case 1:
                data.insert(at, chance.choice(ALPHABET))
            case 2 if at < len(data):
                del data[at]
            case 3:
                to = min(len(data), at + chance.randint(1, 12))
                data[at:at] = data[at:to] * chance.randint(1, 3)
            case _:
                del data[at:]
    return bytes(data)


def summed(line: bytes) -> bytes:
    """The line with a checksum that fits, so that the numbers are read too."""
    text = line.decode("latin-1").strip("\r\n\x01")
    if "*" in text and text.isascii():
        return nmea(text.partition("*")[0][1:], text[0]) if text[0] in "$@" else line
    if "RD," in text and text.isascii() and "," in text:
        body = text[: text.rindex(",") + 1]
        return f"{body}{sum_of(''.join(c for c in body if c >= ' '))}".encode("ascii")
    return line


def check(count: int, seed: int) -> dict[str, int]:
    """Read `count` mutated lines; return how many were accepted or refused, by reason."""
    chance = random.Random(seed)
    instruments = {name: Instrument(settings(name)) for name in NAMES}
    for k in range(count):
        name = NAMES[k % len(NAMES)]
        line = mutated(SAMPLES[name], chance)
        if chance.random() < 0.5:
            line = summed(line)
        for found in instruments[name].take(line, k * S, is_complete=True):
            if isinstance(found, LineSample):
                given = found.payout_m, found.speed_m_per_s, found.tension_n
                values = [one for one in (*given, found.motor_tension_n) if not math.isnan(one)]
                limits = (MAX_PAYOUT_M, MAX_SPEED_M_PER_S, MAX_TENSION_N)
                assert all(abs(v) <= m for v, m in zip(given, limits, strict=True) if v == v), line
                assert values, line
                assert all(map(math.isfinite, values)), line
            else:
                assert abs(found.heave_m) <= MAX_HEAVE_M, line
                turns = found.roll_rad, found.pitch_rad
                assert all(abs(math.degrees(one)) <= MAX_TILT_DEG + 1e-9 for one in turns), line
    counts = {"lines": sum(one.counts.lines for one in instruments.values())}
    counts["accepted"] = sum(one.counts.accepted for one in instruments.values())
    for one in instruments.values():
        for reason, number in one.counts.refused.items():
            counts[reason] = counts.get(reason, 0) + number
    return counts


def test_no_mutated_line_does_harm() -> None:
    counts = check(IN_CI, seed=1)
    assert 0.02 * IN_CI < counts["accepted"] < 0.9 * IN_CI
    assert set(counts) <= {"lines", "accepted", *REASONS}
    assert {"checksum", "incomplete", "not a number"} <= set(counts)


@pytest.mark.long
def test_ten_million_mutated_lines_do_no_harm() -> None:
    assert check(LONG, seed=2)["lines"] >= LONG // 2


if __name__ == "__main__":
    print(check(int(float(sys.argv[1])) if len(sys.argv) > 1 else LONG, seed=2))
