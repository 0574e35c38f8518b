"""Quantities on the command line: units are accepted and never demanded."""

from __future__ import annotations

import argparse
import re

import pytest

from rope_twin.errors import InputError
from rope_twin.quantity import UNITS, read_quantity
from rope_twin.run.options import add_arguments, measure, read_options


@pytest.mark.parametrize(
    ("words", "unit", "value"),
    [
        ("90", "s", 90.0),
        ("90s", "s", 90.0),
        ("2min", "s", 120.0),
        ("1.5 h", "s", 5400.0),
        ("20ms", "s", 0.02),
        ("1e-3", "s", 1e-3),
        ("-3", "s", -3.0),
        ("1.5km", "m", 1500.0),
        (".5m", "m", 0.5),
        ("40mm", "m", 0.04),
        ("30m/min", "m/s", 0.5),
        ("2kn", "m/s", 3704.0 / 3600.0),
        ("50kN", "N", 50e3),
        ("20Hz", "Hz", 20.0),
    ],
)
def test_a_quantity_is_read_in_si_units(words: str, unit: str, value: float) -> None:
    assert read_quantity(words, unit) == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize(
    "words", ["", "s", "nan", "inf", "1e999s", "1,5s", "90 sec", "3S", "5m 5s"]
)
def test_a_wrong_quantity_is_reported_in_one_sentence(words: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError) as failed:
        measure("s")(words)
    assert str(failed.value) == (
        f"'{words}' is not a time; give a number in s or with a unit (ms, s, min, h), like 90s"
    )


@pytest.mark.parametrize("unit", UNITS)
def test_each_unit_is_exactly_one_of_its_kind(unit: str) -> None:
    assert UNITS[unit][unit] == 1.0
    for name, size in UNITS[unit].items():
        assert read_quantity(f"1{name}", unit) == size


@pytest.mark.parametrize(
    ("given", "kept"),
    [
        ("1.5km@30s", "1500@30"),
        ("1500@0.5min", "1500@30"),
        ("end@30s", "end@30"),
        ("leg_port:4m@30", "leg_port:4@30"),
    ],
)
def test_a_cut_is_passed_on_in_si_units(given: str, kept: str) -> None:
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    args = parser.parse_args(["deep_lift", "--cut", given, "--duration", "1min"])
    options = read_options(args)
    assert (options.cut, options.end_s) == (kept, 60.0)


@pytest.mark.parametrize(
    ("given", "reported"),
    [
        ("500@3m", "'3m' is not a time; give a number in s or with a unit (ms, s, min, h)"),
        ("10kn@3s", "'10kn' is not a length; give a number in m or with a unit (mm, "),
    ],
)
def test_a_cut_in_another_unit_is_refused_by_its_unit(given: str, reported: str) -> None:
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    args = parser.parse_args(["deep_lift", "--cut", given, "--duration", "1min"])
    with pytest.raises(InputError, match=re.escape(f"--cut {given}: {reported}")):
        read_options(args)
