"""The recorder thread: kill -9, a full disk, a heavy queue, the end."""

import os
import resource
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from bag_samples import START_NS, STEP_NS, write_heave
from rosbags.highlevel import AnyReader

from rope_twin.errors import BagError
from rope_twin.messages import encode_heave
from rope_twin.recording import bag_writer as recorder_module
from rope_twin.recording.bag import BagReader
from rope_twin.recording.bag_writer import BagRecorder, BagWriter
from rope_twin.recording.heave import open_heave
from rope_twin.recording.recover import Outcome, recover
from rope_twin.topics import BY_NAME

HEAVE = [BY_NAME["ship/heave"]]
SOURCE = Path(__file__).resolve().parents[2]


def stamps_in(directory: Path) -> list[int]:
    with AnyReader([directory]) as reader:
        return [stamp_ns for _, stamp_ns, _ in reader.messages()]


def wait_for(condition, seconds: float = 20.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


@pytest.mark.parametrize("messages", [110, 150])
def test_kill_9_loses_at_most_a_second(tmp_path, messages):
    bag = tmp_path / "bag"
    script = SOURCE / "test" / "support" / "bag_recording_process.py"
    environment = os.environ | {"PYTHONPATH": str(SOURCE)}
    with subprocess.Popen(
        [sys.executable, str(script), str(bag)], stdout=subprocess.PIPE, env=environment
    ) as process:
        handed_over = [int(process.stdout.readline()) for _ in range(messages)]
        process.send_signal(signal.SIGKILL)
        handed_over += [int(line) for line in process.stdout.read().split()]
    with pytest.raises(BagError, match="rope_twin recover"):
        open_heave(bag)
    result = recover(bag)
    assert result.outcome is Outcome.LOSS
    found = stamps_in(result.directory)
    assert handed_over[-1] - found[-1] <= 1_000_000_000
    assert found == handed_over[: len(found)]
    assert len(found) == result.counts["/ship/heave"]


def test_recorder_writes_everything_from_several_threads(tmp_path):
    bag = tmp_path / "bag"
    with BagRecorder(bag, HEAVE, {"source": "a test"}) as recorder:

        def speak(first: int) -> None:
            for k in range(first, 4000, 4):
                assert recorder.write("ship/heave", START_NS + k, encode_heave(START_NS, 0, 0))

        threads = [threading.Thread(target=speak, args=(k,)) for k in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    health = recorder.health()
    assert (health.recorded, health.lost, health.queued, health.trouble) == (4000, 0, 0, "")
    assert sorted(stamps_in(bag)) == list(range(START_NS, START_NS + 4000))
    recorder.close()  # again: nothing
    assert not recorder.write("ship/heave", START_NS, b"")
    assert "1 messages were not recorded (the recorder has ended)" in recorder.health().trouble


def test_messages_reach_the_file_without_a_close(tmp_path):
    recorder = BagRecorder(tmp_path / "bag", HEAVE)
    before = recorder.health().size_bytes
    recorder.write("ship/heave", START_NS, encode_heave(START_NS, 0.5, 0.0))
    wait_for(lambda: recorder.health().size_bytes > before)
    assert recover(tmp_path / "bag", tmp_path / "copy").counts == {"/ship/heave": 1}
    recorder.close()


def test_what_cannot_be_recorded_is_counted_and_reported(tmp_path):
    with BagRecorder(tmp_path / "bag", HEAVE) as recorder:
        recorder.write("ship/heave", START_NS, encode_heave(START_NS, 0.5, 0.0))
        recorder.write("ropes/nodes", START_NS, b"")
        recorder.write("ship/heave", -5, b"")
        wait_for(lambda: recorder.health().lost == 2)
    health = recorder.health()
    assert health.recorded == 1
    assert "2 messages were not recorded" in health.trouble
    assert len(stamps_in(tmp_path / "bag")) == 1


def test_a_queue_that_grows_too_long_loses_the_newest_and_says_so(tmp_path, monkeypatch):
    monkeypatch.setattr(recorder_module, "QUEUE_LIMIT_BYTES", 2000)
    with BagRecorder(tmp_path / "bag", HEAVE) as recorder:
        data = encode_heave(START_NS, 0.0, 0.0)
        taken = [recorder.write("ship/heave", START_NS + k, data) for k in range(200)]
    assert taken[0]
    assert not all(taken)
    health = recorder.health()
    assert health.lost == taken.count(False)
    assert health.recorded == taken.count(True) == len(stamps_in(tmp_path / "bag"))
    assert "the disk is slower than the topics" in health.trouble


def test_a_long_recording_takes_several_files(tmp_path, monkeypatch):
    """The index of a file, 1.5 kB a chunk, would grow in memory until its end."""
    monkeypatch.setattr(recorder_module, "FLUSH_PERIOD_S", 0.05)
    monkeypatch.setattr(recorder_module, "FILE_PERIOD_S", 0.2)
    bag = tmp_path / "bag"
    count = 0
    with BagRecorder(bag, HEAVE, {"source": "a test"}) as recorder:
        until_s = time.monotonic() + 10.0
        while len(list(bag.glob("*.mcap"))) < 4 and time.monotonic() < until_s:
            stamp_ns = START_NS + count * STEP_NS
            assert recorder.write("ship/heave", stamp_ns, encode_heave(stamp_ns, 0.0, 0.0))
            count += 1
            time.sleep(0.002)
    assert recorder.health().trouble == ""
    assert recorder.health().size_bytes == sum(f.stat().st_size for f in bag.glob("*.mcap"))
    assert stamps_in(bag) == [START_NS + k * STEP_NS for k in range(count)]
    for number in range(4):
        alone = BagReader(bag / f"bag_{number}.mcap")
        assert "/ship/heave" in alone.topics
        alone.close()


def test_a_full_disk_puts_off_the_next_file(tmp_path, small_files):
    with BagWriter(tmp_path / "bag", HEAVE, chunk_bytes=8000) as bag:
        count = write_until_trouble(bag)
        assert not bag.begin_file()
        small_files()
        bag.flush()
        assert bag.begin_file()
    assert bag.trouble == ""
    assert len(list((tmp_path / "bag").glob("*.mcap"))) == 2
    assert len(stamps_in(tmp_path / "bag")) == count


def test_a_disk_that_fills_up_at_the_end_of_a_file_costs_nothing(tmp_path, small_files):
    """The end of the first file waits in memory, with the next one open already."""
    bag = BagWriter(tmp_path / "bag", HEAVE, chunk_bytes=500)
    while bag.size_bytes < 17_000:
        stamp_ns = START_NS + bag.counts["/ship/heave"] * STEP_NS
        bag.write("ship/heave", stamp_ns, encode_heave(stamp_ns, 0.0, 0.0))
    assert bag.begin_file()
    assert "the disk refuses to take it" in bag.trouble
    assert not bag.begin_file()
    small_files()
    bag.flush()
    assert bag.trouble == ""
    bag.close()
    assert len(stamps_in(tmp_path / "bag")) == bag.counts["/ship/heave"]


@pytest.fixture
def small_files():
    """The operating system refuses files beyond 20 kB, as a full disk would, until reported."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, hard))
    yield lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def write_until_trouble(bag: BagWriter) -> int:
    count = 0
    while not bag.trouble and count < 20_000:
        stamp_ns = START_NS + count * STEP_NS
        bag.write(
            "ship/heave",
            stamp_ns,
            encode_heave(stamp_ns, count * 1e-3, count * 1.7e-3, recorded=True),
        )
        count += 1
    return count


def write_much(bag: BagWriter) -> None:
    for k in range(20_000):
        bag.write("ship/heave", START_NS + k, encode_heave(START_NS + k, k * 1e-3, k * 1.7))


def test_a_disk_that_was_full_for_a_moment_costs_nothing(tmp_path, small_files):
    with BagWriter(tmp_path / "bag", HEAVE, chunk_bytes=8000) as bag:
        count = write_until_trouble(bag)
        assert "the disk refuses to take it (File too large)" in bag.trouble
        assert "make room and it goes on" in bag.trouble
        small_files()
    assert bag.trouble == ""
    assert len(stamps_in(tmp_path / "bag")) == count


def test_a_disk_that_stays_full_is_reported_and_what_it_took_is_saved(tmp_path, small_files):
    bag = BagWriter(tmp_path / "bag", HEAVE, chunk_bytes=8000)
    count = write_until_trouble(bag)
    with pytest.raises(BagError, match=r"the disk did not take its last .* `rope_twin recover"):
        bag.close()
    small_files()
    assert not (tmp_path / "bag" / "metadata.yaml").exists()
    result = recover(tmp_path / "bag")
    assert result.outcome is Outcome.LOSS
    assert 0.5 * count < result.counts["/ship/heave"] < count


def test_the_recorder_tells_a_full_disk_and_goes_on(tmp_path, small_files):
    with BagRecorder(tmp_path / "bag", HEAVE) as recorder:
        count = 0
        while not recorder.health().trouble and count < 20_000:
            stamp_ns = START_NS + count * STEP_NS
            data = encode_heave(stamp_ns, count * 1e-3, count * 1.7e-3)
            recorder.write("ship/heave", stamp_ns, data)
            count += 1
            if count % 500 == 0:
                wait_for(lambda: recorder.health().queued == 0)
        assert "the disk refuses to take it" in recorder.health().trouble
        small_files()
    assert recorder.health().trouble == ""
    assert len(stamps_in(tmp_path / "bag")) == count


@pytest.mark.parametrize("what", ["deleted", "file deleted", "moved", "made again"])
def test_a_bag_that_is_deleted_or_moved_is_noticed_within_two_seconds(tmp_path, what):
    bag = tmp_path / "bag"
    recorder = BagRecorder(bag, HEAVE)
    recorder.write("ship/heave", START_NS, encode_heave(START_NS, 0.0, 0.0))
    wait_for(lambda: recorder.health().recorded == 1)
    assert recorder.health().trouble == ""
    if what == "moved":
        bag.rename(tmp_path / "elsewhere")
    elif what == "file deleted":
        next(bag.glob("*.mcap")).unlink()
    else:
        shutil.rmtree(bag)
    if what == "made again":
        BagWriter(bag, HEAVE).close()
    wait_for(lambda: recorder.health().trouble, 2.0)
    words = f"bag {bag}: its folder or file was deleted or moved while it was being recorded"
    assert recorder.health().trouble.startswith(words)
    with pytest.raises(BagError, match="was deleted or moved"):
        recorder.close()


def test_what_waits_for_a_full_disk_is_bounded(tmp_path, small_files, monkeypatch):
    monkeypatch.setattr("rope_twin.recording.bag_writer.WAITING_LIMIT_BYTES", 10_000)
    bag = BagWriter(tmp_path / "bag", HEAVE, chunk_bytes=2000)
    write_until_trouble(bag)
    with pytest.raises(BagError, match="the disk refuses to take it"):
        write_much(bag)
    small_files()
    bag.close()
    assert len(stamps_in(tmp_path / "bag")) == bag.counts["/ship/heave"]


def test_an_error_in_the_thread_is_raised_at_the_end_and_ends_the_taking(tmp_path, monkeypatch):
    def fail(bag):
        raise RuntimeError("a fault of the code")

    recorder = BagRecorder(tmp_path / "bag", HEAVE)
    with monkeypatch.context() as patch:
        patch.setattr(BagWriter, "flush", fail)
        wait_for(lambda: not recorder.write("ship/heave", START_NS, encode_heave(START_NS, 0, 0)))
    assert "the recorder has ended: a fault of the code" in recorder.health().trouble
    with pytest.raises(RuntimeError, match="a fault of the code"):
        recorder.close()
    with AnyReader([tmp_path / "bag"]) as reader:
        assert reader.message_count > 0


def test_samples_of_a_recording_can_be_replayed(tmp_path):
    rows = [(k * STEP_NS, 0.1 * k, 2.0) for k in range(40)]
    replay = open_heave(write_heave(tmp_path / "bag", rows), loop=False)
    assert [s.position_m for s in replay.between(0, 10**12)] == [z for _, z, _ in rows]
