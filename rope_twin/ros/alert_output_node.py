"""Alert output node: alerts as sentences over UDP, and acknowledgements back.

Every change goes out as ALF at once, the list of all as ALC each LIST_S. A bridge answers with ACN,
which becomes a command on `alerts/command`; what cannot be done is refused with ARC. Replies are
taken on the loopback interface only: whoever may acknowledge on this machine is a matter of the
site, and a gateway beside this node decides it.
"""

from __future__ import annotations

import socket
from dataclasses import replace
from typing import Any

from rope_twin.alerts.alert_list import Alert, State
from rope_twin.alerts.sentences import COMMANDS, REQUEST, AlertCommand, alc, alf, arc, read_acn
from rope_twin.errors import InputError
from rope_twin.messages import encode_text
from rope_twin.messages.reports import decode_alerts
from rope_twin.ros.entry import SuiteNode, run_node
from rope_twin.ros.qos import listen, publish
from rope_twin.topics import ALERT_COMMAND, ALERTS, BY_NAME

LIST_S = 30.0
_POLL_S = 0.05
_SECOND_NS = 1_000_000_000
_DATAGRAM = 4096


class AlertOutputNode(SuiteNode):
    """Sends the alerts of a running suite to one address."""

    def __init__(self, host: str, port: int, replies: int = 0, **node_options: Any) -> None:
        """Send to a UDP address; replies: port on which ACN sentences are taken, 0: none."""
        super().__init__("alert_output", **node_options)
        self._host, self._port, self._replies = host, port, replies
        self._out: socket.socket | None = None
        self._back: socket.socket | None = None
        self._alerts: dict[str, Alert] = {}
        self._sequence = self._lists = 0
        self.sent = self.taken = self.refused = 0
        self._commands = publish(self, BY_NAME[ALERT_COMMAND])

    def begin(self) -> None:
        """Open the sockets and listen to the suite."""
        try:
            addresses = socket.getaddrinfo(self._host, self._port, type=socket.SOCK_DGRAM)
            family, kind, protocol, _, address = addresses[0]
            self._out = socket.socket(family, kind, protocol)
            self._out.connect(address)
            self._out.setblocking(False)
            if self._replies:
                self._back = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
                self._back.bind(("127.0.0.1", self._replies))
                self._back.setblocking(False)
        except OSError as error:
            where = f"udp {self._host}:{self._port}, replies {self._replies or 'none'}"
            what = str(error.strerror or error)
            raise InputError(where, what, "give a free port and a known host") from error
        listen(self, BY_NAME[ALERTS], self._take)
        self.every(LIST_S, self._send_list)
        if self._back is not None:
            self.every(_POLL_S, self._read_replies)

    def close(self) -> None:
        """Close the sockets; may be called twice."""
        for sock in (self._out, self._back):
            if sock is not None:
                sock.close()
        self._out = self._back = None

    def _take(self, data: bytes) -> None:
        stamp_ns, now_ns, alerts = decode_alerts(data)
        before = self._alerts
        shown = {alert.key: alert for alert in alerts if not alert.shelved(now_ns)}
        for key, one in shown.items():
            if key not in before or _state_of(before[key]) != _state_of(one):
                self._send_alert(one, stamp_ns - now_ns + one.changed_ns)
        for key in before.keys() - shown.keys():
            previous = before[key]
            if previous.state is not State.NORMAL:  # rectified or shelved: no display lists it now
                revision = previous.revision % 99 + 1
                over = replace(previous, state=State.NORMAL, revision=revision)
                self._send_alert(over, stamp_ns)
        self._alerts = shown

    def _send_alert(self, alert: Alert, utc_ns: int) -> None:
        for sentence in alf(alert, utc_ns, self._sequence):
            self._send(sentence)
        self._sequence = (self._sequence + 1) % 10

    def _send_list(self) -> None:
        for sentence in alc(list(self._alerts.values()), self._lists):
            self._send(sentence)
        self._lists = (self._lists + 1) % 100

    def _send(self, sentence: bytes) -> None:
        if self._out is None:
            return
        try:
            self._out.send(sentence)
            self.sent += 1
        except OSError as error:  # nobody listens there now; the next list has them all
            self.get_logger().warning(
                f"alert sentence not sent to {self._host}:{self._port}: {error.strerror}",
                throttle_duration_sec=LIST_S,
            )

    def _read_replies(self) -> None:
        while self._back is not None:
            try:
                data = self._back.recv(_DATAGRAM)
            except BlockingIOError:
                return
            for line in data.splitlines():
                self._answer(line)

    def _answer(self, line: bytes) -> None:
        try:
            command = read_acn(line)
        except InputError as error:
            self.refused += 1
            self.get_logger().warning(str(error), throttle_duration_sec=1.0)
            return
        if command is not None:
            self._obey(command)

    def _obey(self, command: AlertCommand) -> None:
        now_ns = self.get_clock().now().nanoseconds
        alert = self._alerts.get(command.key)
        if alert is None or not (command.letter == REQUEST or alert.waits):
            self.refused += 1
            self._send(arc(command, now_ns))
        elif command.letter == REQUEST:
            self.taken += 1
            self._send_alert(alert, now_ns)
        else:
            self.taken += 1
            self._commands.publish(encode_text(f"{COMMANDS[command.letter]} {command.key}"))


def _state_of(alert: Alert) -> tuple[Any, ...]:
    """Return what a change of is worth a sentence."""
    return alert.state, alert.priority, alert.revision, alert.escalation


def run_output(host: str, port: int, replies: int) -> int:
    """Run the node until it is stopped; return the exit code."""
    return run_node(lambda: AlertOutputNode(host, port, replies), ["alert_output"])
