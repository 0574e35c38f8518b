"""The web server: its headers, who may connect, and a page over a real WebSocket."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import pytest
from console_rig import ConsoleRig
from starlette.testclient import TestClient
from starlette.websockets import WebSocketDisconnect
from websockets.exceptions import ConnectionClosedError
from websockets.sync.client import connect
from websockets.typing import Origin

from rope_twin.console.server import FOLDER, Server, is_own_host, make_app, read_address
from rope_twin.errors import InputError

HOST = "127.0.0.1:8420"
PAGE = {"host": HOST, "origin": f"http://{HOST}"}


@pytest.fixture
def client() -> Iterator[TestClient]:
    rig = ConsoleRig()
    with TestClient(make_app(rig.pages, rig.desk, rig.log), base_url=f"http://{HOST}") as made:
        yield made


def test_everything_comes_with_a_strict_policy(client: TestClient) -> None:
    for path in ("/", "/page/console.js", "/page/console.css", "/health", "/export/casts.csv"):
        answer = client.get(path)
        assert answer.status_code == 200, path
        policy = answer.headers["content-security-policy"]
        assert "default-src 'self'" in policy
        assert "unsafe" not in policy
        assert answer.headers["x-content-type-options"] == "nosniff"


def test_a_file_is_sent_compressed_and_not_again(client: TestClient) -> None:
    whole = (FOLDER / "console.js").read_bytes()
    first = client.get("/page/console.js", headers={"accept-encoding": "gzip"})
    assert first.headers["content-encoding"] == "gzip"
    assert first.content == whole  # the client has unpacked it
    assert int(first.headers["content-length"]) < len(whole) / 2
    plain = client.get("/page/console.js", headers={"accept-encoding": "identity"})
    assert "content-encoding" not in plain.headers
    assert plain.content == whole
    again = client.get("/page/console.js", headers={"if-none-match": first.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")
    assert client.get("/page/licences/uPlot.txt").status_code == 200
    assert client.get("/page/../server.py").status_code == 404


def test_the_page_has_no_inline_script_or_style() -> None:
    text = (FOLDER / "index.html").read_text()
    assert "<style" not in text
    assert " style=" not in text
    assert text.count("<script") == text.count('<script type="module" src="/page/')
    assert not any(f" on{name}=" in text for name in ("click", "load", "error", "input"))


def test_another_host_is_refused(client: TestClient) -> None:
    assert client.get("/", headers={"host": "elsewhere.example"}).status_code == 403


@pytest.mark.parametrize(
    ("host", "own"),
    [("127.0.0.1:8420", True), ("localhost", True), ("[::1]:8420", True), ("10.1.2.3:80", True),
     ("elsewhere.example", False), ("", False), ("127.0.0.1.elsewhere.example", False)],
)  # fmt: skip
def test_a_name_that_may_point_anywhere_is_not_ours(host: str, own: bool) -> None:
    assert is_own_host(host, {"localhost"}) is own


@pytest.mark.parametrize(
    "origin", ["http://elsewhere.example", "null", "http://127.0.0.1:9999", ""]
)
def test_a_page_of_another_origin_cannot_connect(client: TestClient, origin: str) -> None:
    with (
        pytest.raises(WebSocketDisconnect),
        client.websocket_connect("/live", headers={"host": HOST, "origin": origin}),
    ):
        pass


def test_a_page_gets_rows_and_answers(client: TestClient) -> None:
    with client.websocket_connect("/live", headers=PAGE) as socket:
        kinds: list[str] = []
        socket.send_text(json.dumps({"do": "take_seat", "id": 5}))
        answer: dict[str, Any] = {}
        for _ in range(50):
            for frame in json.loads(socket.receive_text()):
                kinds.append(frame["type"])
                answer = frame if frame["type"] == "reply" else answer
            if answer and kinds.count("row") > 2:
                break
        assert kinds[0] == "hello"
        assert answer["id"] == 5
        assert not answer["ok"]
        assert "token" in answer["words"]


HALF_A_CHARACTER = '{"do": "mark", "id": 1, "text": "x\\ud800"}'
NO_MESSAGES = {
    "empty": "", "no JSON": "no json", "list": "[]", "number": "7", "bytes": b"\xff\xfe",
    "long": '{"a": "' + 5000 * "x" + '"}', "nested": 4000 * "[", "NaN": '{"id": NaN}',
    "infinite": '{"id": 1e999}', "half a character": HALF_A_CHARACTER,
    "half a token": '{"do": "sign_in", "token": "\\udfff"}',
}  # fmt: skip


@pytest.mark.parametrize("kind", NO_MESSAGES)
def test_what_is_no_message_of_a_page_ends_the_connection(client: TestClient, kind: str) -> None:
    sent = NO_MESSAGES[kind]
    with client.websocket_connect("/live", headers=PAGE) as socket:
        socket.send_bytes(sent) if isinstance(sent, bytes) else socket.send_text(sent)
        with pytest.raises(WebSocketDisconnect) as ended:
            read_to_the_end(socket)
    assert ended.value.code == 1008, "in words, by no error of the server"


def test_half_a_character_does_not_silence_the_other_pages(client: TestClient) -> None:
    """JSON may spell it, a frame cannot carry it; a marker goes to every page."""
    with client.websocket_connect("/live", headers=PAGE) as bad:
        bad.send_text(HALF_A_CHARACTER)
        with pytest.raises(WebSocketDisconnect):
            read_to_the_end(bad)
    with client.websocket_connect("/live", headers=PAGE) as page:
        page.send_text(json.dumps({"do": "mark", "id": 2, "text": "over the side"}))
        assert json.loads(page.receive_text())[0]["type"] == "hello"
    assert client.get("/export/markers.csv").status_code == 200


def read_to_the_end(socket: Any) -> None:
    """Read until the connection ends."""
    for _ in range(100):
        socket.receive_text()


def test_addresses() -> None:
    assert read_address("8500") == ("127.0.0.1", 8500)
    assert read_address("0.0.0.0:81") == ("0.0.0.0", 81)
    assert read_address("[::1]:8420") == ("::1", 8420)
    for words in ("host:port", "127.0.0.1:99999", ""):
        with pytest.raises(InputError, match="HOST:PORT"):
            read_address(words)


def test_an_address_in_use_is_refused_in_words() -> None:
    rig = ConsoleRig()
    first = Server(rig.pages, rig.desk, rig.log, "127.0.0.1", 0)
    first.start()
    try:
        with pytest.raises(InputError, match="name another one"):
            Server(rig.pages, rig.desk, rig.log, "127.0.0.1", first.port)
    finally:
        first.close()


def test_text_that_is_not_utf8_closes_its_connection(capfd: pytest.CaptureFixture[str]) -> None:
    """The log has one line and no traceback; the next page is served."""
    rig = ConsoleRig()
    server = Server(rig.pages, rig.desk, rig.log, "127.0.0.1", 0)
    server.start()
    url, origin = f"ws{server.address[4:]}live", Origin(server.address[:-1])
    try:
        with connect(url, origin=origin) as wrong:
            wrong.send(b"\xff\xfe", text=True)
            with pytest.raises(ConnectionClosedError, match="1007"):
                list(wrong)  # what the server sent until it closed
        with connect(url, origin=origin) as right:
            assert json.loads(right.recv(5.0))[0]["type"] == "hello"
    finally:
        server.close()
    (line,) = capfd.readouterr().err.splitlines()
    assert "WARNING" in line
    assert line.endswith("a page sent text that is not UTF-8; its connection is closed")


def test_a_connection_without_answers_is_lost_within_seconds() -> None:
    rig = ConsoleRig()
    server = Server(rig.pages, rig.desk, rig.log, "127.0.0.1", 0)
    try:
        config = server._server.config
        assert float(config.ws_ping_interval or 0.0) + float(config.ws_ping_timeout or 0.0) <= 3.0
    finally:
        server._socket.close()
