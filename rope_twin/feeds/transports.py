"""Ways in and out: UDP and multicast, TCP, serial lines, files, and a server for several readers.

A source runs in a thread of its own and hands over bytes with their time of arrival. A connection
that fails is tried again every second; `fault` says what is wrong meanwhile.
"""

from __future__ import annotations

import ipaddress
import queue
import re
import socket
import struct
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rope_twin.errors import InputError
from rope_twin.feeds.configuration import EM3000, FeedSettings
from rope_twin.feeds.configuration import OPCUA as OPCUA_FORMAT
from rope_twin.feeds.readings import DAY_NS, iso_time_ns
from rope_twin.feeds.telegrams import EM3000_BYTES

Take = Callable[[bytes, int, bool], None]  # bytes, time of arrival [ns], whether they are whole

_POLL_S = 0.2  # until a stop request is noticed
_RETRY_S = 1.0
_BYTES = 65536
# A link whose other end has vanished without a word fails after 11 s of silence.
_KEEP_ALIVE = {"TCP_KEEPIDLE": 5, "TCP_KEEPINTVL": 2, "TCP_KEEPCNT": 3}
_SECOND_NS = 1_000_000_000
UDP, TCP, TCP_SERVER, SERIAL, FILE = "udp", "tcp", "tcp-server", "serial", "file"
MODBUS, OPCUA = "modbus", "opc.tcp"
ADDRESSES = (
    "FILE, udp://HOST:PORT, tcp://HOST:PORT, tcp-server://HOST:PORT, modbus://HOST:PORT, "
    "opc.tcp://HOST:PORT/PATH or serial:DEVICE@BAUD"
)
# kinds of address of the formats that are polled, and their form
_POLLED = {
    MODBUS: {MODBUS: "modbus://HOST:PORT", SERIAL: "serial:DEVICE@BAUD"},
    OPCUA_FORMAT: {OPCUA: "opc.tcp://HOST:PORT/PATH"},
}
_HOST = r"(\[[0-9a-fA-F:.]+\]|[^:/\[\]]*):(\d{1,5})"
_NETWORK = re.compile(rf"(udp|tcp|tcp-server|modbus)://{_HOST}/?|(opc\.tcp)://{_HOST}(/\S*)?")
_SERIAL = re.compile(r"serial:(?://)?([^@]+)@(\d{2,7})")
_LOGGED = re.compile(rb"(\d{4}-\d\d-\d\d[T ]\d\d:\d\d:\d\d(?:\.\d{1,9})?Z?)[ \t,]+")
_INSIDE = re.compile(rb"\d{4}-\d\d-\d\d[T ]\d\d:\d\d:\d\d(?:\.\d{1,9})?")


@dataclass(frozen=True)
class Address:
    """Kind of a transport and its end: host or path, and port or baud rate."""

    kind: str
    name: str
    number: int = 0
    endpoint: str = ""  # opc.tcp: path on the host

    def __str__(self) -> str:
        if self.kind == FILE:
            return self.name
        if self.kind == SERIAL:
            return f"serial:{self.name}@{self.number}"
        return f"{self.kind}://{self.name}:{self.number}{self.endpoint}"


def read_address(words: str) -> Address:
    """Return the address in words such as `udp://239.192.0.2:60002`.

    Raises:
        InputError: it is none, or a port that cannot be.
    """
    if match := _NETWORK.fullmatch(words):
        kind, host, digits = match.groups()[:3] if match[1] else match.groups()[3:6]
        port = int(digits)
        if not 1 <= port <= 65535:
            raise InputError(words, f"port {port}", "it must be 1 to 65535")
        return Address(kind, host.strip("[]"), port, match[7] or "")
    if match := _SERIAL.fullmatch(words):
        return Address(SERIAL, match[1], int(match[2]))
    if "://" in words or words.startswith("serial:") or not words.strip():
        raise InputError(f"source '{words}'", "it is no address", f"give {ADDRESSES}")
    return Address(FILE, words)


class Source(ABC):
    """Thread that reads bytes until it is closed or its source has ended."""

    def __init__(self, address: Address, take: Take) -> None:
        self._address, self._take = address, take
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="feed source", daemon=True)
        self.fault = ""  # why nothing can be read at present
        self.ended = False

    @property
    def closing(self) -> bool:
        """Return whether a stop was requested."""
        return self._stop.is_set()

    def start(self) -> None:
        """Begin to read."""
        self._thread.start()

    def close(self) -> None:
        """Stop and wait for the thread; may be called twice."""
        self._stop.set()
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join(5.0)

    def _run(self) -> None:
        while not self._stop.is_set():
            try:
                self._read()
            except OSError as error:
                self.fault = error.strerror or str(error)
                self._stop.wait(_RETRY_S)
            if self.ended:
                return

    def _begin_stream(self) -> None:
        """End what the last connection has left of a line: it does not go on in this one."""
        self._take(b"", time.time_ns(), True)

    @abstractmethod
    def _read(self) -> None:
        """Read until the connection ends or a stop is requested. Raises OSError."""

    def _receive(self, link: socket.socket, are_whole: bool) -> None:
        """Read from an open link; are_whole: datagrams, else a stream. Raises OSError."""
        self.fault = ""
        link.settimeout(_POLL_S)
        while not self._stop.is_set():
            try:
                data = link.recv(_BYTES)
            except TimeoutError as error:
                if error.errno is not None and not are_whole:  # of the link, not of the poll
                    raise
                continue
            if not data and not are_whole:
                raise OSError(None, "the server has closed the connection")
            self._take(data, time.time_ns(), are_whole)


def hand_over(pieces: queue.Queue[Any], piece: Any, source: Source) -> bool:
    """Put a piece into a queue; return whether it is there. Only a file waits for room."""
    while not source.closing:
        try:
            pieces.put(piece, timeout=_POLL_S if isinstance(source, FileSource) else 0.0)
            return True
        except queue.Full:
            if not isinstance(source, FileSource):
                return False
    return False


class UdpSource(Source):
    """Datagrams of a port; of a multicast address the group is joined."""

    def _read(self) -> None:
        with _bound(self._address) as link:
            self._receive(link, are_whole=True)


def _bound(address: Address) -> socket.socket:
    host = address.name or "0.0.0.0"
    link = socket.socket(_family(host), socket.SOCK_DGRAM)
    try:
        if is_multicast(host):  # other programs may be members; datagrams to a host have one reader
            link.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        link.bind((host, address.number))
        if is_multicast(host):
            group = socket.inet_aton(host) + socket.inet_aton("0.0.0.0")
            link.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, group)
    except OSError:
        link.close()
        raise
    return link


def is_multicast(host: str) -> bool:
    """Return whether a host is an IPv4 multicast address."""
    try:
        return ipaddress.IPv4Address(host).is_multicast
    except ValueError:
        return False


class TcpSource(Source):
    """Stream of a TCP server."""

    def _read(self) -> None:
        with connected(self._address) as link:
            self._begin_stream()
            self._receive(link, are_whole=False)


def connected(address: Address) -> socket.socket:
    """Return a link to a TCP server that is probed while it is silent. Raises OSError."""
    end = address.name or "127.0.0.1", address.number
    link = socket.create_connection(end, timeout=_RETRY_S)
    link.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for name, value in _KEEP_ALIVE.items():
        if hasattr(socket, name):  # not on every system
            link.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)
    return link


class SerialSource(Source):
    """Bytes of a serial line, 8 data bits, no parity, one stop bit."""

    def _read(self) -> None:
        with open_serial(self._address) as line:
            self._begin_stream()
            self.fault = ""
            while not self._stop.is_set():
                data = line.read(1)
                if data:
                    arrival_ns = time.time_ns()
                    self._take(data + line.read(line.in_waiting), arrival_ns, False)


def open_serial(address: Address) -> Any:
    """Return an open serial line. Raises OSError."""
    import serial  # only where one is used

    try:
        return serial.Serial(address.name, address.number, timeout=_POLL_S)
    except ValueError as error:  # a baud rate that the device does not have
        raise OSError(None, str(error)) from error


class FileSource(Source):
    """Lines of a file at the pace of their times, or as fast as possible where speed is 0.

    A line begins with the time of a logger, or has one inside. Stamps keep the spacing of the file
    at every speed: they begin at `start_ns`, or are those of the file where it is None. Lines
    before the first time are left out. A jump of more than a day is no time unless the next time
    confirms it; such a hole is not waited for.
    """

    def __init__(
        self, path: Path, take: Take, speed: float, start_ns: int | None, rate_hz: float = 0.0,
        binary: bool = False,
    ) -> None:  # fmt: skip
        super().__init__(Address(FILE, str(path)), take)
        self._path, self._speed, self._start_ns = path, speed, start_ns
        self._period_ns = round(_SECOND_NS / rate_hz) if rate_hz else 0
        self._binary = binary
        where, problem = f"source '{path}'", ""
        if not path.is_file():
            raise InputError(where, "there is no such file", f"give {ADDRESSES}")
        if not rate_hz and binary:
            problem = "records of this format have no time"
        elif not rate_hz and not _has_time(path):
            problem = "no line of it has a time"
        if problem:
            raise InputError(where, problem, "set replay_rate_hz")

    def _read(self) -> None:
        try:
            self._replay()
        finally:
            self.ended = True  # not read again from its beginning

    def _replay(self) -> None:
        began_s = time.monotonic()
        for line, time_ns, since_ns in self._timed():
            if self._speed > 0.0:
                due_s = began_s + since_ns * 1e-9 / self._speed - time.monotonic()
                if self._stop.wait(min(max(0.0, due_s), threading.TIMEOUT_MAX)):
                    return
            stamp_ns = time_ns if self._start_ns is None else self._start_ns + since_ns
            self._take(line, stamp_ns, not self._binary)

    def _timed(self) -> Iterator[tuple[bytes, int, int]]:
        """Yield each line with its time and the time since the first one [ns]."""
        first_ns: int | None = None
        jumped_ns: int | None = None
        time_ns = DAY_NS  # of lines without a time, so that a delay can be subtracted
        with self._path.open("rb") as file:
            while not self._stop.is_set():
                line = file.read(EM3000_BYTES) if self._binary else file.readline(4096)
                if not line:
                    return
                if self._period_ns:
                    time_ns += 0 if first_ns is None else self._period_ns
                    first_ns = first_ns or time_ns
                else:
                    own_ns, line = _logged(line)
                    if own_ns is not None and first_ns is None:
                        first_ns = time_ns = own_ns
                    elif own_ns is not None and abs(own_ns - time_ns) <= DAY_NS:
                        time_ns, jumped_ns = own_ns, None
                    elif own_ns is not None and first_ns is not None:
                        if jumped_ns is not None and abs(own_ns - jumped_ns) <= DAY_NS:
                            first_ns += own_ns - time_ns
                            time_ns, jumped_ns = own_ns, None
                        else:
                            jumped_ns = own_ns
                if first_ns is not None:
                    yield line, time_ns, time_ns - first_ns


def _has_time(path: Path) -> bool:
    """Return whether a line of a file has a time. Raises InputError: it cannot be read."""
    try:
        with path.open("rb") as file:
            lines = iter(lambda: file.readline(4096), b"")
            return any(_logged(line)[0] is not None for line in lines)
    except OSError as error:
        what, remedy = error.strerror or str(error), "name a file that can be read"
        raise InputError(f"source '{path}'", what, remedy) from error


def _logged(line: bytes) -> tuple[int | None, bytes]:
    """Return the time of a line, of the logger or of the instrument, and the line without it."""
    if match := _LOGGED.match(line):
        return iso_time_ns(match[1].decode("ascii")), line[match.end() :]
    inside = _INSIDE.search(line)
    return (iso_time_ns(inside[0].decode("ascii")) if inside else None), line


def open_source(
    settings: FeedSettings, take: Take, speed: float = 1.0, start_ns: int | None = None
) -> Source:
    """Return the source of a feed, not yet started; speed and start count for files only.

    Raises:
        InputError: the address or the file cannot be used.
    """
    address = read_address(settings.source)
    kinds = _POLLED.get(settings.format, {})
    if (kinds and address.kind not in kinds) or (not kinds and address.kind in (MODBUS, OPCUA)):
        form = settings.format if kinds else {MODBUS: MODBUS, OPCUA: OPCUA_FORMAT}[address.kind]
        remedy = f"the format {form} takes {' or '.join(_POLLED[form].values())}"
        raise InputError(settings.source, f"format {settings.format}", remedy)
    if settings.format == MODBUS:
        from rope_twin.feeds.plc import ModbusSource  # which needs an extra

        return ModbusSource(address, take, settings)
    if address.kind == OPCUA:
        from rope_twin.feeds.plc import OpcUaSource  # which needs an extra

        return OpcUaSource(address, take, settings)
    links: dict[str, Callable[[Address, Take], Source]] = {
        UDP: UdpSource, TCP: TcpSource, SERIAL: SerialSource
    }  # fmt: skip
    if address.kind in links:
        return links[address.kind](address, take)
    if address.kind == FILE:
        binary, rate_hz = settings.format == EM3000, settings.replay_rate_hz
        return FileSource(Path(address.name), take, speed, start_ns, rate_hz, binary)
    remedy = f"give {ADDRESSES.replace(', tcp-server://HOST:PORT', '')}"
    raise InputError(settings.source, "a server is a way out, not in", remedy)


class Sink(ABC):
    """Way out for lines."""

    @abstractmethod
    def send(self, data: bytes) -> None:
        """Send a line; one that cannot be delivered now is dropped."""

    @abstractmethod
    def close(self) -> None:
        """Release what is held; may be called twice."""


class UdpSink(Sink):
    """Datagrams to a host or a multicast group, a line each."""

    def __init__(self, address: Address) -> None:
        host = address.name or "127.0.0.1"
        self._link = socket.socket(_family(host), socket.SOCK_DGRAM)
        if is_multicast(host):
            self._link.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, struct.pack("b", 1))
        self._end = host, address.number

    def send(self, data: bytes) -> None:
        """Send a line as a datagram."""
        try:
            self._link.sendto(data, self._end)
        except OSError:
            return  # nobody listens: the next one may arrive

    def close(self) -> None:
        """Close the socket."""
        self._link.close()


class SerialSink(Sink):
    """A serial line or pseudo-terminal."""

    def __init__(self, address: Address) -> None:
        try:
            self._line = open_serial(address)
            self._line.write_timeout = _POLL_S
        except OSError as error:
            problem = error.strerror or str(error)
            raise InputError(str(address), problem, "name a serial device") from error

    def send(self, data: bytes) -> None:
        """Write a line; dropped while nobody reads."""
        try:
            self._line.write(data)
        except OSError:  # includes the time-out of pyserial
            return

    def close(self) -> None:
        """Close the device."""
        self._line.close()


class TcpServer(Sink):
    """Server that sends every line to all of its readers; one that is too slow is disconnected."""

    def __init__(self, address: Address) -> None:
        end = address.name or "127.0.0.1", address.number
        try:
            self._server = socket.create_server(end, family=_family(end[0]))
        except OSError as error:
            problem = error.strerror or str(error)
            raise InputError(str(address), problem, "name a free port") from error
        self._server.settimeout(_POLL_S)
        self.port: int = self._server.getsockname()[1]
        self._readers: list[socket.socket] = []
        self._lock, self._stop = threading.Lock(), threading.Event()
        self._thread = threading.Thread(target=self._accept, name="feed server", daemon=True)
        self._thread.start()

    @property
    def readers(self) -> int:
        """Return the number of connected readers."""
        with self._lock:
            return len(self._readers)

    def _accept(self) -> None:
        while not self._stop.is_set():
            try:
                reader, _ = self._server.accept()
            except TimeoutError:
                continue
            except OSError:
                return
            reader.setblocking(False)
            with self._lock:
                self._readers.append(reader)

    def send(self, data: bytes) -> None:
        """Send a line to every reader."""
        with self._lock:
            for reader in list(self._readers):
                try:
                    sent = reader.send(data)
                except OSError:
                    sent = -1
                if sent != len(data):
                    self._readers.remove(reader)
                    reader.close()

    def close(self) -> None:
        """Disconnect all readers."""
        self._stop.set()
        self._server.close()
        self._thread.join(2.0)
        with self._lock:
            for reader in self._readers:
                reader.close()
            self._readers.clear()


def _family(host: str) -> socket.AddressFamily:
    return socket.AF_INET6 if ":" in host else socket.AF_INET


class FileSink(Sink):
    """File that lines are appended to."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("ab")

    def send(self, data: bytes) -> None:
        """Write a line."""
        self._file.write(data)

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def open_sink(words: str) -> Sink:
    """Return the way out of an address. Raises InputError: the address cannot be used."""
    address = read_address(words)
    sinks: dict[str, Callable[[Address], Sink]] = {
        UDP: UdpSink, TCP_SERVER: TcpServer, SERIAL: SerialSink,
        FILE: lambda address: FileSink(Path(address.name)),
    }  # fmt: skip
    if address.kind in sinks:
        return sinks[address.kind](address)
    raise InputError(words, "lines are not sent to a server", "give tcp-server://HOST:PORT")
