"""Web server of the console: one page, one WebSocket, nothing from elsewhere.

It runs in a thread of its own. Requests must name this machine (Host) and a WebSocket must come
from the page itself (Origin), which keeps other web sites and DNS rebinding out; the content
security policy allows no inline script or style, and nothing from elsewhere. The files are held in
memory, each read and compressed once: a browser keeps what it has and asks whether its tag still
holds, so that a reload sends no file.
"""

from __future__ import annotations

import asyncio
import contextlib
import gzip
import hashlib
import ipaddress
import json
import logging
import re
import socket
import sys
import threading
import time
from collections.abc import AsyncIterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from rope_twin.console.control import RequestHandler
from rope_twin.console.pages import Page, Pages, Source
from rope_twin.console.requests import Log
from rope_twin.errors import InputError

LOOPBACK, PORT = "127.0.0.1", 8420
MAX_PAGES = 60
MAX_MESSAGE_BYTES = 4096  # of a message from a page
PING_S, PONG_S = 1.0, 2.0  # between pings, and until a page without an answer is lost
HEADERS = {
    "Content-Security-Policy": "default-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'; object-src 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-cache",
}
FOLDER = Path(__file__).with_name("page")
_TYPES = {
    ".html": "text/html; charset=utf-8", ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8", ".svg": "image/svg+xml", ".woff": "font/woff",
    ".txt": "text/plain; charset=utf-8",
}  # fmt: skip
_COMPRESSED = (".html", ".js", ".css", ".svg", ".txt")  # a WOFF font is compressed already
_POLICY_VIOLATION, _TRY_LATER = 1008, 1013  # close codes of RFC 6455


@dataclass(frozen=True)
class PageFile:
    """One file and the headers that go with it."""

    content: bytes
    compressed: bytes  # empty: it is sent as it is
    media_type: str
    tag: str

    def answer(self, request: Mapping[str, str]) -> tuple[int, bytes, dict[str, str]]:
        """Return status, body and headers for the headers of a request (names in lower case)."""
        headers = {"ETag": self.tag, "Vary": "Accept-Encoding"}
        if self.tag in [tag.strip() for tag in request.get("if-none-match", "").split(",")]:
            return 304, b"", headers
        headers["Content-Type"] = self.media_type
        if self.compressed and "gzip" in request.get("accept-encoding", ""):
            return 200, self.compressed, headers | {"Content-Encoding": "gzip"}
        return 200, self.content, headers


def _file(path: Path) -> PageFile:
    content = path.read_bytes()
    compressed = gzip.compress(content, mtime=0) if path.suffix in _COMPRESSED else b""
    tag = f'"{hashlib.sha256(content).hexdigest()[:16]}"'
    return PageFile(content, compressed, _TYPES[path.suffix], tag)


def read_address(address: str) -> tuple[str, int]:
    """Return host and port of an address such as 0.0.0.0:8420, 8500 or [::1]:8420.

    Raises:
        InputError: it is none.
    """
    match = re.fullmatch(r"(?:(\[[0-9A-Fa-f:]+\]|[\w.-]+):)?(\d{1,5})", address)
    if match and int(match[2]) < 65536:
        return (match[1] or LOOPBACK).strip("[]"), int(match[2])
    remedy = f"give HOST:PORT, such as {LOOPBACK}:{PORT}, or a port"
    raise InputError(f"console address {address}", "not an address", remedy)


def announce(address: str, token: str = "") -> None:
    """Print the address, and the token that allows control, on standard error."""
    line = f"console: {address}" + (f"  (token for control: {token})" if token else "")
    sys.stderr.write(f"{line}\n")
    sys.stderr.flush()


def is_own_host(host: str, own: set[str]) -> bool:
    """Return whether a Host header names this machine, not a name that may point anywhere."""
    with contextlib.suppress(ValueError):
        name = (urlsplit(f"//{host}").hostname or "").lower()
        if name in own:
            return True
        ipaddress.ip_address(name)
        return True
    return False


def make_app(pages: Pages, desk: RequestHandler, log: Log, hosts: set[str] | None = None) -> Any:
    """Return the ASGI application; hosts: further names of this machine.

    Raises:
        InputError: Starlette is not installed.
    """
    try:
        from starlette.applications import Starlette
        from starlette.middleware import Middleware
        from starlette.responses import JSONResponse, PlainTextResponse, Response
        from starlette.routing import Route, WebSocketRoute
    except ImportError as error:
        raise _not_installed(error) from error
    own_names = {"localhost", socket.gethostname().lower()} | {name.lower() for name in hosts or ()}

    class Guard:
        """Middleware that checks the Host and adds HEADERS to every response."""

        def __init__(self, app: Any) -> None:
            self.app = app

        async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
            if scope["type"] not in ("http", "websocket"):
                await self.app(scope, receive, send)
                return
            headers = {key.decode("latin-1"): value.decode("latin-1")
                       for key, value in scope["headers"]}  # fmt: skip
            host = headers.get("host", "")
            if not is_own_host(host, own_names):
                await _refuse(scope, receive, send, f"'{host}' is not a name of this console")
                return
            origin = urlsplit(headers.get("origin", "")).netloc
            if scope["type"] == "websocket" and origin.lower() != host.lower():
                await _refuse(scope, receive, send, "only the console's own page may connect")
                return

            async def send_with_headers(message: Any) -> None:
                if message["type"] == "http.response.start":
                    message["headers"] = [
                        *message["headers"],
                        *((name.lower().encode(), value.encode())
                          for name, value in HEADERS.items()),
                    ]  # fmt: skip
                await send(message)

            await self.app(scope, receive, send_with_headers)

    async def _refuse(scope: Any, receive: Any, send: Any, reason: str) -> None:
        if scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": _POLICY_VIOLATION, "reason": reason})
        else:
            await PlainTextResponse(reason, status_code=403)(scope, receive, send)

    files = {
        path.relative_to(FOLDER).as_posix(): _file(path)
        for path in FOLDER.rglob("*")
        if path.suffix in _TYPES
    }

    async def file(request: Any) -> Any:
        page_file = files.get(request.path_params.get("name", "index.html"))
        if page_file is None:
            return PlainTextResponse("no such file", status_code=404)
        status, body, headers = page_file.answer(request.headers)
        return Response(body, status, headers)

    async def health(request: Any) -> Any:
        return JSONResponse({"pages": len(pages.pages), "time_s": pages.readings.time_s,
                             "lost": sum(page.lost for page in pages.pages.values())})  # fmt: skip

    async def export(request: Any) -> Any:
        make = {"trend": log.trend_csv, "casts": log.casts_csv, "markers": log.markers_csv}
        name = request.path_params["name"]
        if name not in make:
            return PlainTextResponse("no such table", status_code=404)
        headers = {"Content-Disposition": f'attachment; filename="{name}.csv"'}
        return PlainTextResponse(make[name](), media_type="text/csv", headers=headers)

    async def connect(websocket: Any) -> None:
        await websocket.accept()
        if len(pages.pages) >= MAX_PAGES:
            await websocket.close(_TRY_LATER, f"{MAX_PAGES} pages are open already")
            return
        address = websocket.client.host if websocket.client else "unknown"
        page = pages.connect(address)
        sending = asyncio.create_task(_send(websocket, page))
        try:
            await _receive(websocket, page, desk)
        finally:
            sending.cancel()
            desk.leave(page)
            pages.disconnect(page)

    @contextlib.asynccontextmanager
    async def lifespan(app: Any) -> AsyncIterator[None]:
        ticking = asyncio.create_task(pages.run())
        yield
        ticking.cancel()

    routes = [
        Route("/", file),
        Route("/health", health),
        Route("/export/{name}.csv", export),
        WebSocketRoute("/live", connect),
        Route("/page/{name:path}", file),
    ]
    return Starlette(routes=routes, middleware=[Middleware(Guard)], lifespan=lifespan)


async def _send(websocket: Any, page: Page) -> None:
    """Send frames as the page takes them; while it does not, its queue drops the oldest."""
    with contextlib.suppress(Exception):  # the page has gone: `_receive` ends too
        while True:
            await websocket.send_text(await page.frames())


async def _receive(websocket: Any, page: Page, desk: RequestHandler) -> None:
    """Hand what the page sends to the desk until it disconnects."""
    while (message := await websocket.receive())["type"] != "websocket.disconnect":
        content = _content(message.get("text") or "")
        if content is None:
            await websocket.close(_POLICY_VIOLATION, "not a message of this page")
            return
        desk.take(page, content)


def _content(text: str) -> dict[str, Any] | None:
    """Return the object in a message of a page; None: it is none, or could not be sent to others.

    JSON can spell half a character, which no frame can carry: all pages would fall silent with it.
    """
    if len(text) > MAX_MESSAGE_BYTES:
        return None
    try:
        content = json.loads(text)
        json.dumps(content, ensure_ascii=False, allow_nan=False).encode()
    except (ValueError, RecursionError):
        return None
    return content if isinstance(content, dict) else None


class Server:
    """The web server in its own thread."""

    def __init__(
        self, pages: Pages, desk: RequestHandler, log: Log, host: str = LOOPBACK, port: int = PORT
    ) -> None:
        """Bind the address; `start` serves it.

        Raises:
            InputError: the address cannot be used, or the extra `console` is not installed.
        """
        app = make_app(pages, desk, log, {host})
        try:
            import uvicorn
            import websockets  # noqa: F401  # uvicorn refuses WebSockets without it
        except ImportError as error:
            raise _not_installed(error) from error
        self._socket = _bound(host, port)
        self.host, self.port = host, int(self._socket.getsockname()[1])
        self._pages = pages
        config = uvicorn.Config(
            app, log_level="warning", access_log=False, ws="websockets-sansio", lifespan="on",
            ws_max_size=MAX_MESSAGE_BYTES * 4, ws_per_message_deflate=False,
            ws_ping_interval=PING_S, ws_ping_timeout=PONG_S, timeout_graceful_shutdown=1,
            server_header=False,
        )  # fmt: skip
        logging.getLogger("uvicorn.error").addFilter(_say_not_utf8)
        self._server = uvicorn.Server(config)
        self._thread: threading.Thread | None = None
        self.processor_s = 0.0  # CPU time of the server's thread, once it has ended

    @property
    def source(self) -> Source:
        """Return the source of its pages."""
        return self._pages.source

    @property
    def address(self) -> str:
        """Return the address for a browser."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        if self.host in ("0.0.0.0", "::"):
            host = socket.gethostname()
        return f"http://{host}:{self.port}/"

    def start(self) -> None:
        """Serve from now on."""
        self._thread = threading.Thread(target=self._run, name="console", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop serving; may be called twice."""
        self._server.should_exit = True
        if self._thread is not None:
            self._thread.join(5.0)
            self._thread = None
        self._socket.close()
        self._pages.source.close()

    def _run(self) -> None:
        asyncio.run(self._server.serve([self._socket]))
        self.processor_s = time.thread_time()


def _say_not_utf8(record: logging.LogRecord) -> bool:
    """Word a page's text that is not UTF-8 in one line, where uvicorn logs a traceback."""
    if record.exc_info and isinstance(record.exc_info[1], UnicodeDecodeError):
        record.msg = "a page sent text that is not UTF-8; its connection is closed"
        record.levelno, record.levelname, record.exc_info = logging.WARNING, "WARNING", None
    return True


def _bound(host: str, port: int) -> socket.socket:
    try:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        bound = socket.socket(family, socket.SOCK_STREAM)
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        bound.bind((host, port))
        bound.listen(128)
    except OSError as error:
        problem = f"the address cannot be used ({error.strerror or error})"
        raise InputError(f"console {host}:{port}", problem, "name another one") from error
    return bound


def _not_installed(error: ImportError) -> InputError:
    remedy = "install it with `pip install 'rope_twin[console]'`"
    return InputError("console", f"{error.name} is not installed", remedy)
