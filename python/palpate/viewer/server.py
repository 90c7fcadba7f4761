"""The server: the page over HTTP, messages over WebSocket, in a thread with its own event loop.

It listens on loopback unless told otherwise, answers to its own page only (a request whose Origin
is another site's is refused, and so is one that reached loopback under a foreign name), and never
waits for a slow browser: each page has one place for the newest frame and confirms what it got.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import logging
import threading
from http import HTTPStatus
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

from websockets.asyncio.server import Server as WebSocketServer
from websockets.asyncio.server import ServerConnection, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from palpate.viewer.page import page_files
from palpate.viewer.protocol import ProtocolError, encode, parse_command

if TYPE_CHECKING:
    from palpate.viewer.session import Session

#: Largest message of a page: a long stroke of a cut.
_MAX_COMMAND = 1 << 20
#: Frames that are on their way to a page at most.
_IN_FLIGHT = 2
#: Messages beside frames that wait for a page at most; one that reads none is cut off.
_BACKLOG = 256
#: What strangers send to the port is no news for a terminal.
_LOG = logging.getLogger("palpate.viewer.server")
_LOG.addHandler(logging.NullHandler())
_LOOPBACK = ("127.0.0.1", "localhost", "::1")


class Server:
    """Serves one session to any number of pages."""

    def __init__(self, host: str, port: int) -> None:
        self._host = host
        self._port = port
        self._session: Session | None = None
        self._pages: set[_Page] = set()
        self._latest: dict[str, bytes] = {}
        self._names = itertools.count(1)
        self._loop = asyncio.new_event_loop()
        self._files = page_files()
        self._ready = threading.Event()
        self._end: asyncio.Event | None = None
        self._failure: OSError | None = None
        self._thread = threading.Thread(target=self._run, name="palpate-server", daemon=True)

    @property
    def port(self) -> int:
        """Where it listens; another than was asked for when that was taken."""
        return self._port

    @property
    def url(self) -> str:
        """What to open in a browser."""
        host = {"0.0.0.0": "127.0.0.1", "::": "[::1]", "::1": "[::1]"}.get(self._host, self._host)
        return f"http://{host}:{self._port}/"

    @property
    def page_count(self) -> int:
        """Browsers that look on now."""
        return len(self._pages)

    def start(self, session: Session) -> None:
        """Listen. Raises OSError when the host is not this machine's."""
        self._session = session
        self._thread.start()
        self._ready.wait()
        if self._failure is not None:
            self._thread.join()
            raise self._failure

    def stop(self) -> None:
        """Say goodbye to all pages and end."""
        if self._thread.is_alive():
            with contextlib.suppress(RuntimeError):  # it ended by itself meanwhile
                self._loop.call_soon_threadsafe(self._finish)
            self._thread.join()

    def publish(self, kind: str, message: bytes) -> None:
        """Send a message to all pages, and keep it for those to come. From any thread."""
        with contextlib.suppress(RuntimeError):  # the loop is closed: nobody is left to tell
            self._loop.call_soon_threadsafe(self._spread, kind, message)

    def _finish(self) -> None:
        if self._end is not None:
            self._end.set()

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(self._serve())
        except OSError as error:
            self._failure = error
        finally:
            self._ready.set()
            self._loop.close()

    async def _serve(self) -> None:
        self._end = asyncio.Event()
        try:
            server = await self._listen(self._port)
        except OSError:
            if self._port == 0:
                raise
            server = await self._listen(0)
        self._port = next(iter(server.sockets)).getsockname()[1]
        self._ready.set()
        async with server:
            await self._end.wait()

    async def _listen(self, port: int) -> WebSocketServer:
        server: WebSocketServer = await serve(
            self._talk,
            self._host,
            port,
            process_request=self._answer,
            compression=None,  # positions do not compress, and it would cost the solver's core
            max_size=_MAX_COMMAND,
            close_timeout=1,
            logger=_LOG,
        )
        return server

    def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """A file of the page, a refusal, or None: let the WebSocket begin."""
        if not self._may_ask(request.headers):
            return connection.respond(HTTPStatus.FORBIDDEN, "not from this page\n")
        path = urlsplit(request.path).path
        if path == "/socket":
            return None
        file = self._files.get(path)
        if file is None:
            return connection.respond(HTTPStatus.NOT_FOUND, "no such file\n")
        headers = Headers(
            {
                "Content-Type": file.kind,
                "Content-Length": str(len(file.content)),
                "Cache-Control": "no-cache",
                "X-Content-Type-Options": "nosniff",
                "Content-Security-Policy": file.policy,
                "Connection": "close",
            }
        )
        return Response(HTTPStatus.OK, "OK", headers, file.content)

    def _may_ask(self, headers: Headers) -> bool:
        hosts, origins = headers.get_all("Host"), headers.get_all("Origin")
        if len(hosts) != 1 or len(origins) > 1:
            return False
        if self._host in _LOOPBACK and urlsplit(f"//{hosts[0]}").hostname not in _LOOPBACK:
            return False
        return not origins or urlsplit(origins[0]).netloc == hosts[0]

    async def _talk(self, connection: ServerConnection) -> None:
        assert self._session is not None
        page = _Page(connection, next(self._names))
        for kind in ("hello", "scene", "state", "problem", "frame"):
            if kind in self._latest:
                page.put(kind, self._latest[kind])
        self._pages.add(page)
        sender = asyncio.create_task(page.send())
        try:
            async for message in connection:
                self._hear(page, message)
        except ConnectionClosed:
            pass
        finally:
            self._pages.discard(page)
            self._session.leave(page.name)
            sender.cancel()
            with contextlib.suppress(asyncio.CancelledError, ConnectionClosed):
                await sender

    def _hear(self, page: _Page, message: str | bytes) -> None:
        assert self._session is not None
        try:
            command = parse_command(message)
        except ProtocolError as error:
            page.put("notice", encode("notice", {"text": f"not understood: {error}"}))
            return
        if command["type"] == "ack":
            page.confirm()
        elif not self._session.submit(page.name, command):
            page.put("notice", encode("notice", {"text": "too many commands at once"}))

    def _spread(self, kind: str, message: bytes) -> None:
        if kind == "hello":  # all else belonged to what was shown before
            self._latest.clear()
        elif kind == "scene":
            self._latest.pop("problem", None)
            self._latest.pop("frame", None)
        if kind != "notice":
            self._latest[kind] = message
        for page in self._pages:
            page.put(kind, message)


class _Page:
    """One browser: what waits to be sent to it."""

    def __init__(self, connection: ServerConnection, name: int) -> None:
        self.name = name
        self._connection = connection
        self._waiting: list[bytes] = []
        self._frame: bytes | None = None
        self._credit = _IN_FLIGHT
        self._wake = asyncio.Event()

    def put(self, kind: str, message: bytes) -> None:
        """Send a message when it is its turn; a frame replaces the one before."""
        if kind == "frame":
            self._frame = message
        elif len(self._waiting) < _BACKLOG:
            self._waiting.append(message)
        self._wake.set()

    def confirm(self) -> None:
        """The page has got a frame."""
        self._credit = min(self._credit + 1, _IN_FLIGHT)
        self._wake.set()

    async def send(self) -> None:
        """Send until the connection ends."""
        with contextlib.suppress(ConnectionClosed):
            while True:
                await self._wake.wait()
                self._wake.clear()
                while self._waiting:
                    await self._connection.send(self._waiting.pop(0))
                if self._frame is not None and self._credit > 0:
                    message, self._frame = self._frame, None
                    self._credit -= 1
                    await self._connection.send(message)
                    self._wake.set()
