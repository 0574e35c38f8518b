"""Ways in and out on this machine: UDP, multicast, TCP with several readers, serial, files."""

from __future__ import annotations

import errno
import os
import pty
import socket
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest
from feed_samples import DATA, SAMPLES, settings

from rope_twin.errors import InputError
from rope_twin.feeds import transports
from rope_twin.feeds.instrument import Instrument
from rope_twin.feeds.transports import (
    Address,
    FileSource,
    Source,
    TcpServer,
    UdpSink,
    connected,
    open_sink,
    open_source,
    read_address,
)

PATIENCE_S = 30.0
S = 1_000_000_000


class Heard:
    """Pieces that a source has handed over."""

    def __init__(self) -> None:
        self.pieces: list[tuple[bytes, int, bool]] = []

    def take(self, data: bytes, arrival_ns: int, whole: bool) -> None:
        self.pieces.append((data, arrival_ns, whole))

    @property
    def data(self) -> bytes:
        return b"".join(data for data, *_ in self.pieces)


def until(condition: Callable[[], object], what: str) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline, what
        time.sleep(0.01)


@contextmanager
def running(source: Source) -> Iterator[Source]:
    source.start()
    try:
        yield source
    finally:
        source.close()


def free_port(kind: int = socket.SOCK_DGRAM) -> int:
    with socket.socket(socket.AF_INET, kind) as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


@pytest.mark.parametrize("host", ["127.0.0.1", "239.192.0.2"])
def test_datagrams_come_whole_with_the_time_of_their_arrival(host: str) -> None:
    """Also those of a multicast group of IEC 61162-450."""
    address, heard = f"udp://{host}:{free_port()}", Heard()
    try:
        sink = open_sink(address)
        with running(open_source(settings("psxn", source=address), heard.take)) as source:
            before_ns = time.time_ns()

            def arrived() -> bool:
                sink.send(SAMPLES["psxn"])
                return bool(heard.pieces)

            until(arrived, f"nothing received: {source.fault}")
    finally:
        sink.close()
    data, arrival_ns, whole = heard.pieces[0]
    assert (data, whole) == (SAMPLES["psxn"], True)
    assert before_ns <= arrival_ns <= time.time_ns()


def test_one_stream_serves_several_readers_and_comes_back() -> None:
    port = free_port(socket.SOCK_STREAM)
    address, heard = f"tcp://127.0.0.1:{port}", (Heard(), Heard())
    sources = [open_source(settings("lci90", source=address), one.take) for one in heard]
    with running(sources[0]), running(sources[1]):
        until(lambda: sources[0].fault, "a server that is not there is reported")
        for _ in range(2):  # the server ends, and another one begins
            server = TcpServer(Address("tcp-server", "127.0.0.1", port))
            with closing(server):
                until(lambda server=server: server.readers == 2, "both readers are connected")
                before = [len(one.data) for one in heard]
                for _ in range(3):
                    server.send(SAMPLES["lci90"])
                wanted = 3 * len(SAMPLES["lci90"])
                until(
                    lambda before=before, wanted=wanted: all(
                        len(one.data) - old == wanted
                        for one, old in zip(heard, before, strict=True)
                    ),
                    "all lines for both",
                )
            until(lambda: all(source.fault for source in sources), "the end is noticed")
    assert heard[0].data == 6 * SAMPLES["lci90"]


def test_a_line_is_not_pieced_together_from_two_connections() -> None:
    """A server that restarts amid a line: without a checksum nothing else would show it."""
    server = TcpServer(Address("tcp-server", "127.0.0.1", free_port(socket.SOCK_STREAM)))
    address = f"tcp://127.0.0.1:{server.port}"
    columns = {"tension": 1, "payout": 2, "speed": 3}
    made = settings("columns", checksum="none", columns=columns, source=address)
    heard, line = Heard(), b"$R30C,120.5,1530.0,0.5\r\n"
    with running(open_source(made, heard.take)) as source:
        for cut in (slice(0, -10), slice(-14, None)):
            with closing(server):
                until(lambda server=server: server.readers, "it is connected")
                before = len(heard.data)
                server.send(line[cut])
                until(lambda before=before: len(heard.data) > before, "its bytes are there")
            until(lambda: source.fault, "the end is noticed")
            server = TcpServer(Address("tcp-server", "127.0.0.1", server.port))
        with closing(server):
            until(lambda: server.readers, "it is connected")
            server.send(line)
            until(lambda: heard.data.endswith(line), "the whole line is there")
    instrument = Instrument(made)
    found = [one for piece in heard.pieces for one in instrument.take(*piece)]
    assert [sample.payout_m for sample in found] == [1530.0]


def test_a_reader_that_is_too_slow_holds_up_nobody() -> None:
    server = TcpServer(Address("tcp-server", "127.0.0.1", free_port(socket.SOCK_STREAM)))
    with closing(server), socket.create_connection(("127.0.0.1", server.port)):
        until(lambda: server.readers == 1, "it is connected")
        began_s = time.monotonic()
        while server.readers and time.monotonic() - began_s < PATIENCE_S:
            server.send(SAMPLES["lci90"] * 100)
        assert server.readers == 0


def test_a_serial_line_is_read() -> None:
    ours, theirs = pty.openpty()
    tty.setraw(ours)
    tty.setraw(theirs)
    heard = Heard()
    made = settings("tss1", source=f"serial:{os.ttyname(theirs)}@9600")
    with running(open_source(made, heard.take)):

        def arrived() -> bool:
            os.write(ours, SAMPLES["tss1"])  # what was sent before it was opened is dropped
            return len(heard.data) >= 5 * len(SAMPLES["tss1"])

        until(arrived, "five lines")
    assert heard.data == SAMPLES["tss1"] * (len(heard.data) // len(SAMPLES["tss1"]))
    os.close(ours)
    os.close(theirs)


def test_a_serial_line_that_is_not_there_is_reported() -> None:
    made = settings("tss1", source="serial:/dev/no_such_line@9600")
    with running(open_source(made, Heard().take)) as source:
        until(lambda: source.fault, "it is reported")
    assert "No such file" in source.fault


def replayed(path: Path, speed: float, start_ns: int | None) -> tuple[Heard, float]:
    heard = Heard()
    began_s = time.monotonic()
    with running(FileSource(path, heard.take, speed, start_ns)) as source:
        until(lambda: source.ended, "its end")
    return heard, time.monotonic() - began_s


def test_a_file_keeps_its_spacing_at_any_speed(tmp_path: Path) -> None:
    lines = (DATA / "twnc.txt").read_bytes().splitlines(keepends=True)[:41]
    path = tmp_path / "winch.txt"
    path.write_bytes(b"".join(lines))
    fast, _ = replayed(path, 0.0, None)
    quick, quick_s = replayed(path, 10.0, 5 * S)
    assert quick_s >= 0.2, "2 s of it ten times as fast"
    own = [arrival for _, arrival, _ in fast.pieces]
    moved = [arrival for _, arrival, _ in quick.pieces]
    assert moved[0] == 5 * S
    assert [one - moved[0] for one in moved] == [one - own[0] for one in own]
    assert own[-1] - own[0] == pytest.approx(2.0 * S, rel=0.01)
    assert fast.data == b"".join(line.split(b" ", 1)[1] for line in lines)


def test_a_file_without_times_needs_a_rate(tmp_path: Path) -> None:
    path = tmp_path / "em3000.bin"
    path.write_bytes(5 * SAMPLES["em3000"])
    with pytest.raises(InputError, match="set replay_rate_hz"):
        open_source(settings("em3000", source=str(path)), Heard().take)
    heard = Heard()
    made = settings("em3000", source=str(path), replay_rate_hz=100.0)
    with running(open_source(made, heard.take, speed=0.0, start_ns=S)) as source:
        until(lambda: source.ended, "its end")
    instrument = Instrument(made)
    found = [one for piece in heard.pieces for one in instrument.take(*piece)]
    assert [one.stamp_ns for one in found] == [S + k * S // 100 for k in range(4)]
    path.write_bytes(SAMPLES["tss1"])
    with pytest.raises(InputError, match="no line of it has a time; set replay_rate_hz"):
        open_source(settings("tss1", source=str(path)), Heard().take)


@pytest.mark.parametrize("speed", [0.0, 100.0])
def test_a_line_without_a_sound_time_does_not_stop_a_replay(tmp_path: Path, speed: float) -> None:
    """A header, a time that was cut, a year that was garbled; and a hole of a week is no wait."""
    path = tmp_path / "winch.txt"
    path.write_text(
        "# winch\n\n2024-05-01T12:00:00Z a\n4-05-01T12:00:00Z b\n9024-05-01T12:00:00Z c\n"
        "2024-05-01T12:00:01Z d\n2024-05-08T12:00:00Z e\n2024-05-08T12:00:01Z f\n"
    )
    heard, _ = replayed(path, speed, 5 * S)
    assert [(data.split()[-1], (at_ns - 5 * S) // S) for data, at_ns, _ in heard.pieces] == [
        (b"a", 0), (b"b", 0), (b"c", 0), (b"d", 1), (b"e", 1), (b"f", 1),
    ]  # fmt: skip


def test_a_silent_link_is_probed() -> None:
    server = TcpServer(Address("tcp-server", "127.0.0.1", free_port(socket.SOCK_STREAM)))
    with closing(server), connected(Address("tcp", "127.0.0.1", server.port)) as link:
        assert link.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE)
        assert link.getsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPIDLE) == 5


def test_a_link_that_fails_is_no_poll(monkeypatch: pytest.MonkeyPatch) -> None:
    """A link that keepalive finds dead ends with a TimeoutError that has a number."""

    class Dead(socket.socket):
        def recv(self, *_: object) -> bytes:
            raise OSError(errno.ETIMEDOUT, "Connection timed out")

    monkeypatch.setattr(transports, "connected", lambda _: Dead())
    with running(open_source(settings("lci90", source="tcp://:4001"), Heard().take)) as source:
        until(lambda: source.fault, "it is reported")
    assert source.fault == "Connection timed out"


@pytest.mark.parametrize(
    ("words", "kind", "name", "number"),
    [
        ("udp://239.192.0.2:60002", "udp", "239.192.0.2", 60002),
        ("udp://:6224", "udp", "", 6224),
        ("tcp://[::1]:4001", "tcp", "::1", 4001),
        ("tcp-server://0.0.0.0:4001", "tcp-server", "0.0.0.0", 4001),
        ("serial:/dev/ttyUSB0@9600", "serial", "/dev/ttyUSB0", 9600),
        ("winch.log", "file", "winch.log", 0),
    ],
)
def test_addresses(words: str, kind: str, name: str, number: int) -> None:
    assert read_address(words) == Address(kind, name, number)


@pytest.mark.parametrize(
    ("words", "fault"),
    [
        ("udp://host", "no address"),
        ("udp://host:0", "it must be 1 to 65535"),
        ("http://host:80", "no address"),
        ("serial:/dev/ttyUSB0", "no address"),
        ("", "no address"),
    ],
)
def test_an_address_that_cannot_be_is_refused(words: str, fault: str) -> None:
    with pytest.raises(InputError, match=fault):
        read_address(words)


def test_a_refused_address_is_answered_by_all_kinds() -> None:
    with pytest.raises(InputError) as refused:
        read_address("http://host:80")
    for kind in ("udp", "tcp", "tcp-server", "modbus"):
        assert f" {kind}://HOST:PORT" in str(refused.value)


def test_a_way_in_is_no_way_out() -> None:
    with pytest.raises(InputError, match="a way out"):
        open_source(settings("tss1", source="tcp-server://:4001"), Heard().take)
    with pytest.raises(InputError, match="give tcp-server"):
        open_sink("tcp://127.0.0.1:4001")
    with pytest.raises(InputError, match="no such file"):
        open_source(settings("tss1", source="/no/such/file"), Heard().take)
    sink = UdpSink(Address("udp", "127.0.0.1", free_port()))
    with closing(sink):
        sink.send(b"nobody listens")
