"""Exact replay of bags made without ROS: equal, changed by one bit, cut off, incomplete."""

from __future__ import annotations

import json
import math
import shutil
import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from rope_twin.cli import main
from rope_twin.errors import BagError
from rope_twin.files import share_dir
from rope_twin.messages import decode, encode_heave
from rope_twin.recording.bag_writer import BagWriter
from rope_twin.recording.exact_replay import Outcome, same_payload, verify
from rope_twin.recording.recorded_run import Recorded, read_content
from rope_twin.recording.session import decode_json, encode_json
from rope_twin.run.options import RunOptions
from rope_twin.run.unpaced import run_unpaced
from rope_twin.scene.load import load_scene
from rope_twin.topics import BY_NAME, INPUT_LOG_TOPIC, SESSION_TOPIC, TOPICS
from rope_twin.vortex.results import MonitorSettings

EPOCH_NS = 1_700_000_000 * 10**9
SCENE = "shallow_lift"
Change = Callable[[Recorded], bytes | None]


def record(place: Path, end_s: float = 2.0, **options: Any) -> Path:
    given = {"scene": SCENE, "speed": 0.0, "end_s": end_s, "record": place, **options}
    summary = run_unpaced(RunOptions(**given), lambda run: None, EPOCH_NS)
    assert not summary.error
    return place


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("recorded") / "bag")


def rewritten(bag: Path, out: Path, change: Change) -> Path:
    """The bag with some of its messages changed, or (None) left out."""
    with BagWriter(out, TOPICS) as writer:
        for one in read_content(bag).messages(tuple(BY_NAME)):
            data = change(one)
            if data is not None:
                writer.write(one.topic, one.log_ns, data, sequence=one.sequence)
    return out


def at(topic: str, number: int, change: Callable[[bytes], bytes | None]) -> Change:
    """A change of one message of a topic."""
    chosen = topic, number
    return lambda one: change(one.data) if (one.topic, one.sequence) == chosen else one.data


def one_bit(data: bytes) -> bytes:
    """A JointState of one effort, with the last bit of it turned."""
    return data[:-8] + bytes([data[-8] ^ 1]) + data[-7:]


def code_of(bag: Path) -> int:
    return main(["replay", str(bag), "--verify"])


def test_a_bag_is_equal_to_its_replay(bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert code_of(bag) == 0
    content = capsys.readouterr().out
    assert f"{bag}: bit-identical" in content
    assert "left out: diagnostics" in content
    found = verify(bag)
    assert found.compared["ropes/tension_top"] == found.compared["ropes/length"] == 100
    assert found.compared["ropes/nodes"] == found.compared["ropes/markers"] == 50
    assert not found.missing
    assert not found.unrecorded
    assert found.until_s == 2.0
    assert found.applied["ship/heave"] > 40


def test_its_sessions_say_what_was_run(bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["replay", str(bag), "--json"]) == 0
    (session,) = json.loads(capsys.readouterr().out)["sessions"]
    assert session["scene"]["files"][0] == f"{SCENE}.yaml"
    assert session["program"].keys() == {"version", "commit", "sources", "solver"}
    assert session["machine"].keys() >= {"processor", "numba", "python"}
    assert main(["replay", str(bag)]) == 0
    assert "from static equilibrium" in capsys.readouterr().out
    scene = read_content(bag).sessions[0].session.content["scene"]
    assert scene["files"][f"{SCENE}.yaml"] == load_scene(SCENE).path.read_text(encoding="utf-8")


def test_one_bit_of_one_tension_is_found(
    bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = rewritten(bag, tmp_path / "other", at("ropes/tension_top", 61, one_bit))
    assert main(["replay", str(other), "--verify", "--json"]) == 3
    different = json.loads(capsys.readouterr().out)["difference"]
    (there,) = (one.data for one in read_content(other).messages(("ropes/tension_top",))
                if one.sequence == 61)  # fmt: skip
    assert (different["topic"], different["where"]) == ("ropes/tension_top", "effort[0]")
    assert different["time_s"] == pytest.approx(61 * 0.02)
    assert float(different["recorded"]) == decode("ropes/tension_top", there).effort[0]
    gap = abs(float(different["recorded"]) - float(different["replayed"]))
    assert 0.0 < gap <= math.ulp(float(different["recorded"]))


def test_the_first_of_several_differences_is_reported(bag: Path, tmp_path: Path) -> None:
    def change(one: Recorded) -> bytes:
        changed = one.topic == "ropes/tension_bottom" and one.sequence >= 30
        return one_bit(one.data) if changed else one.data

    found = verify(rewritten(bag, tmp_path / "other", change))
    assert found.difference is not None
    assert found.difference.topic == "ropes/tension_bottom"
    assert found.difference.time_s == pytest.approx(30 * 0.02)


def test_a_heave_sample_that_was_edited_is_found(bag: Path, tmp_path: Path) -> None:
    """In its own topic, in the log of inputs, and in both: each comes out as different."""

    def in_topic(one: Recorded) -> bytes:
        if (one.topic, one.sequence) != ("ship/heave", 12):
            return one.data
        heave = decode("ship/heave", one.data)
        stamp_ns = heave.header.stamp.sec * 10**9 + heave.header.stamp.nanosec
        z, v = heave.pose.pose.position.z, heave.twist.twist.linear.z
        return encode_heave(stamp_ns, z + 0.01, v)

    def in_log(one: Recorded) -> bytes:
        if one.topic != INPUT_LOG_TOPIC:
            return one.data
        content = decode_json(one.topic, one.data)
        for method, arguments, _ in content["calls"]:
            if method == "submit_heave" and arguments[0] == 450_000_000:
                arguments[1] += 0.01
        return encode_json(content)

    def in_both(one: Recorded) -> bytes:
        return in_topic(one) if one.topic == "ship/heave" else in_log(one)

    found = verify(rewritten(bag, tmp_path / "topic", in_topic))
    assert found.difference is not None
    assert (found.difference.topic, found.difference.where) == (
        "ship/heave", "pose.pose.position.z",
    )  # fmt: skip
    assert found.difference.time_s == 0.45
    logged = verify(rewritten(bag, tmp_path / "log", in_log))
    assert logged.outcome is Outcome.DIFFERENT
    both = verify(rewritten(bag, tmp_path / "both", in_both))
    assert both.difference is not None
    assert both.difference.topic in ("ropes/tension_top", "payloads/state", "ropes/length",
                                     "hang_off/wrench", "hang_off/odometry", "ropes/nodes",
                                     "ropes/element_tension", "ropes/tension_bottom",
                                     "ropes/markers")  # fmt: skip


def test_messages_that_the_recorder_lost_are_counted(bag: Path, tmp_path: Path) -> None:
    def change(one: Recorded) -> bytes | None:
        lost = (one.topic, one.sequence) in (("ropes/tension_top", 1), ("ropes/tension_top", 50),
                                             ("ship/heave", 9))  # fmt: skip
        return None if lost else one.data

    found = verify(rewritten(bag, tmp_path / "other", change))
    assert found.outcome is Outcome.EQUAL
    assert found.missing == {"ropes/tension_top": 2}
    assert found.unrecorded == {"ship/heave": 1}


def test_a_message_that_the_run_never_made_is_a_difference(bag: Path, tmp_path: Path) -> None:
    messages = list(read_content(bag).messages(tuple(BY_NAME)))
    with BagWriter(tmp_path / "other", TOPICS) as writer:
        for one in messages:
            writer.write(one.topic, one.log_ns, one.data, sequence=one.sequence)
        extra = next(one for one in messages if one.topic == "ropes/tension_top")
        writer.write("ropes/tension_top", messages[-1].log_ns, extra.data, sequence=1000)
    found = verify(tmp_path / "other")
    assert found.difference is not None
    assert "message 1000" in str(found.difference)


def test_a_gap_in_the_log_ends_what_can_be_verified(bag: Path, tmp_path: Path) -> None:
    def change(one: Recorded) -> bytes | None:
        content = decode_json(one.topic, one.data) if one.topic == INPUT_LOG_TOPIC else {}
        return None if content.get("number") == 15 else one.data

    found = verify(rewritten(bag, tmp_path / "other", change))
    assert found.outcome is Outcome.IMPOSSIBLE
    assert "are not in its twin/inputs" in found.fault
    assert 0.3 < found.until_s < 1.5
    assert found.unverified > 100


def test_a_difference_without_any_inputs_names_what_the_bag_lacks(
    bag: Path, tmp_path: Path
) -> None:
    def change(one: Recorded) -> bytes | None:
        return None if one.topic == INPUT_LOG_TOPIC else one.data

    found = verify(rewritten(bag, tmp_path / "other", change))
    assert found.difference is not None
    assert "no twin/inputs in the bag: the run is repeated without inputs" in found.notes


def test_a_bag_that_was_cut_off_is_verified_as_far_as_it_goes(tmp_path: Path) -> None:
    whole = record(tmp_path / "whole", 12.0)
    (file,) = whole.glob("*.mcap")
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(file.read_bytes()[: file.stat().st_size * 7 // 10])
    found = verify(cut)
    assert found.outcome is Outcome.EQUAL, found.difference
    assert any("compared up to" in note for note in found.notes)
    assert 1.0 < found.until_s < 11.0


def test_a_bag_without_sessions_is_refused_in_one_sentence(
    bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = rewritten(
        bag, tmp_path / "other", lambda one: None if one.topic == SESSION_TOPIC else one.data
    )
    assert code_of(other) == 1
    assert "it has no twin/session" in capsys.readouterr().err
    assert code_of(tmp_path / "none") == 1
    assert "there is no such file or name in bags/" in capsys.readouterr().err
    assert code_of(Path("sea_2p5m")) == 1
    assert "it has no twin/session" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["../outside.yaml", "/outside.yaml"])
def test_a_bag_cannot_name_files_outside_its_folder(bag: Path, tmp_path: Path, name: str) -> None:
    def change(one: Recorded) -> bytes:
        if one.topic != SESSION_TOPIC:
            return one.data
        content = decode_json(one.topic, one.data)
        content["scene"]["files"][name] = "about: nothing"
        return encode_json(content)

    with pytest.raises(BagError, match="leads out of its folder"):
        verify(rewritten(bag, tmp_path / "other", change))


def test_the_scene_comes_from_the_bag_where_its_file_has_changed(tmp_path: Path) -> None:
    path = tmp_path / "scene" / "own.yaml"
    path.parent.mkdir()
    path.write_text(load_scene(SCENE).path.read_text(encoding="utf-8"), encoding="utf-8")
    first = record(tmp_path / "first", 1.0, scene=str(path), save=tmp_path / "own.state")
    second = record(tmp_path / "second", 2.0, scene=str(path), start_from=tmp_path / "own.state")
    shutil.rmtree(path.parent)
    for one in (first, second):
        assert verify(one).outcome is Outcome.EQUAL
    path.parent.mkdir()
    path.write_text("about: another\n", encoding="utf-8")
    assert verify(second).outcome is Outcome.EQUAL


FORCES = {"decomposed_force: {}": "decomposed_force: {table: {path: tables/fitted_forces.csv}}"}
SWELL = "{measured: {file: ./tables/ndbc_46042_1996.csv, column: 1996-10-16T00Z}}"
SEA = {
    "responses: vessel_120m": "responses: ./tables/vessel_120m.csv",
    "      spreading: 6.0\n": f"      spreading: 6.0\n      also: [{SWELL}]\n",
}


@pytest.mark.parametrize(
    ("scene", "changes", "tables"),
    [
        ("vortices_decomposed", FORCES, ["viv/fitted_forces.csv"]),
        ("ship_6dof", SEA, ["responses/vessel_120m.csv", "sea_states/ndbc_46042_1996.csv"]),
    ],
    ids=["forces", "responses and the spectrum of a swell"],
)
def test_tables_beside_a_scene_come_from_the_bag_too(
    tmp_path: Path, scene: str, changes: dict[str, str], tables: list[str]
) -> None:
    """In a folder of their own; with what the bag has, replay needs none of it."""
    share, folder = share_dir() / "config", tmp_path / "scene"
    (folder / "tables").mkdir(parents=True)
    copies = [Path(shutil.copy(share / name, folder / "tables")) for name in tables]
    path = folder / "own.yaml"
    text = (share / "scenes" / f"{scene}.yaml").read_text(encoding="utf-8")
    for old, new in changes.items():
        assert text.count(old) == 1
        text = text.replace(old, new)
    path.write_text(text, encoding="utf-8")
    bag = record(tmp_path / "bag", 1.0, scene=str(path))
    kept = read_content(bag)
    session = next(one for one in kept.messages((SESSION_TOPIC,)) if one.topic == SESSION_TOPIC)
    files = decode_json(SESSION_TOPIC, session.data)["scene"]["files"]
    assert {"own.yaml", *(f"tables/{copy.name}" for copy in copies)} <= set(files)
    copies[0].write_text("another table\n")
    assert verify(bag).outcome is Outcome.EQUAL
    shutil.rmtree(folder)
    assert verify(bag).outcome is Outcome.EQUAL


OPTIONS: dict[str, dict[str, Any]] = {
    "ropes that meet": {"scene": "bridle_lift"},
    "poses of the ship": {"scene": "ship_6dof"},
    "everything kept": {
        "energy": True, "error_interval": True,
        "watch": MonitorSettings("frequency-domain", "stranded_wire"),
    },
    "a cut, another setting, another sea": {
        "elements": 30, "step_s": 0.005, "bag": "sea_2p5m", "cut": "100@1.1",
    },
}  # fmt: skip


@pytest.mark.parametrize("options", OPTIONS.values(), ids=OPTIONS)
def test_runs_of_every_kind_are_replayed_also_from_a_saved_state(
    tmp_path: Path, options: dict[str, Any]
) -> None:
    state = tmp_path / "one.state"
    first = record(tmp_path / "first", 1.5, save=state, **options)
    further = {name: value for name, value in options.items() if name != "cut"}
    second = record(tmp_path / "second", 2.5, start_from=state, **further)
    for one in (first, second):
        found = verify(one)
        assert found.difference is None, str(found.difference)
        assert found.outcome is Outcome.EQUAL
        assert found.compared["ropes/tension_top"] == (75 if one is first else 50)
        assert not found.missing
    assert found.sessions[0].time_ns == 1_500_000_000


def test_padding_of_the_middleware_is_no_difference() -> None:
    message = b"\x00\x01\x00\x00" + struct.pack("<dB", 1.5, 7)
    assert same_payload(message + b"\x00\x00\x00", message)
    assert not same_payload(message + b"\x00" * 7, message)
    assert not same_payload(message[:-1] + b"\x08\x00\x00\x00", message)
    assert not same_payload(message + b"\x00", message)


def test_another_machine_is_reported(bag: Path, tmp_path: Path) -> None:
    def change(one: Recorded) -> bytes:
        if one.topic != SESSION_TOPIC:
            return one.data
        content = decode_json(one.topic, one.data)
        content["machine"]["processor"] = "an abacus"
        return encode_json(content)

    found = verify(rewritten(bag, tmp_path / "other", change))
    assert found.outcome is Outcome.EQUAL
    assert any("machine processor was an abacus" in note for note in found.notes)


def test_the_log_skips_what_was_not_published(bag: Path, tmp_path: Path) -> None:
    """Snapshots that the publisher was too slow for have no number, and the log names them."""
    lost = {40, 41, 42}
    stamps = {"hang_off/wrench", "hang_off/odometry", "payloads/state", "ropes/length",
              "winch/state"}  # fmt: skip
    every = {"ropes/tension_top", "ropes/tension_top_error", "ropes/tension_bottom", *stamps}
    slots = {
        **dict.fromkeys(every, 1), "ropes/element_tension": 2, "ropes/nodes": 2, "ropes/markers": 2,
        "winch/mode": 5, "ropes/utilisation": 10, "twin/quality": 10,
        "seabed/contact": 1, "seabed/touchdown": 2,
    }  # fmt: skip
    numbers: dict[str, int] = {}

    with BagWriter(tmp_path / "other", TOPICS) as writer:
        log = 0
        for one in read_content(bag).messages(tuple(BY_NAME)):
            sequence, data = one.sequence, one.data
            if one.topic in slots:
                if one.sequence * slots[one.topic] in lost:
                    continue
                sequence = numbers[one.topic] = numbers.get(one.topic, 0) + 1
            if one.topic == INPUT_LOG_TOPIC:
                content, log = decode_json(one.topic, one.data), log + 1
                if content["time_ns"] >= 43 * 20_000_000 and not any(
                    key == "skipped" for key in numbers
                ):
                    numbers["skipped"] = 1
                    head = {key: content[key] for key in ("run", "session")}
                    skipped = {**head, "number": log, "skipped_ns": [780_000_000, 860_000_000]}
                    writer.write(one.topic, one.log_ns, encode_json(skipped), sequence=log)
                    log += 1
                data = encode_json({**content, "number": log})
                sequence = log
            writer.write(one.topic, one.log_ns, data, sequence=sequence)
    found = verify(tmp_path / "other")
    assert found.difference is None, str(found.difference)
    assert found.outcome is Outcome.EQUAL
    assert found.compared["ropes/tension_top"] == 97


def test_options_with_other_values_are_other_runs(bag: Path, tmp_path: Path) -> None:
    """The comparison can fail: the description of the run decides."""

    def change(one: Recorded) -> bytes:
        if one.topic != SESSION_TOPIC:
            return one.data
        content = decode_json(one.topic, one.data)
        content["setup"]["other_sea"] = True  # the tension's error is then unknown
        return encode_json(content)

    found = verify(rewritten(bag, tmp_path / "other", change))
    assert found.difference is not None
    assert found.difference.topic == "ropes/tension_top_error"
    assert replace(found.difference, time_s=0.02) == found.difference
