"""What people start: `view` with a browser, `NullViewer` without."""

from __future__ import annotations

import contextlib
import json
import threading
import webbrowser
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy.typing as npt

from palpate.errors import PalpateError
from palpate.viewer.live import LivePlayer
from palpate.viewer.player import Player
from palpate.viewer.protocol import Command, decode, parse_command
from palpate.viewer.server import Server
from palpate.viewer.session import Session

if TYPE_CHECKING:
    from types import TracebackType

    from palpate.simulation import Simulation

#: Where the page is found unless the port is taken.
DEFAULT_PORT = 8642


class ViewerError(PalpateError):
    """The viewer cannot start."""


class Viewer:
    """A session and the server that shows it.

    Parameters
    ----------
    open_player : callable
        Makes what is played, in the session's thread; again when a page asks to reload.
    host, port
        Where to listen; another port is taken when this one is taken, see `url`.
    title : str
        Name at the top of the page.
    play : bool
        Whether it plays at once.
    watch : Path, optional
        The model's file: while it has errors, it is read again when it changes.

    Raises
    ------
    ViewerError
        When ``host`` is not an address of this machine.
    """

    def __init__(
        self,
        open_player: Callable[[], Player],
        *,
        host: str = "127.0.0.1",
        port: int = DEFAULT_PORT,
        title: str = "",
        play: bool = True,
        watch: Path | None = None,
    ) -> None:
        self._server = Server(host, port)
        self._session = Session(
            open_player, self._server.publish, title=title, play=play, watch=watch
        )
        self._closed = threading.Event()
        try:
            self._server.start(self._session)
        except OSError as error:
            raise ViewerError(f"cannot listen on {host}: {error.strerror or error}") from None
        self._session.start()

    @property
    def url(self) -> str:
        """What to open in a browser."""
        return self._server.url

    @property
    def page_count(self) -> int:
        """Browsers that look on now."""
        return self._server.page_count

    def open_browser(self) -> bool:
        """Open the page in the user's browser; False where there is none."""
        try:
            return webbrowser.open(self.url)
        except webbrowser.Error:
            return False

    def update(self) -> None:
        """Show the present state of a simulation that you step yourself (``play=False``)."""
        self._session.refresh()

    def wait(self) -> None:
        """Wait for `close` or Ctrl-C."""
        while not self._closed.wait(0.5):  # short, so that Ctrl-C is answered on every platform
            pass

    def close(self) -> None:
        """Stop playing and serving."""
        self._closed.set()
        self._session.stop()
        self._server.stop()

    def __enter__(self) -> Viewer:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


class NullViewer:
    """A session without a server: what a page would be sent is kept, what it would say is called.

    Examples
    --------
    >>> import palpate
    >>> from palpate.viewer import NullViewer
    >>> viewer = NullViewer(palpate.Simulation("small"))
    >>> viewer.send({"type": "step", "count": 3})
    >>> round(viewer.header("frame")["time"] * 60)
    3
    """

    def __init__(
        self, source: Simulation | Player | Callable[[], Player], *, play: bool = False
    ) -> None:

        def opener() -> Player:
            if isinstance(source, Player):
                return source
            return source() if callable(source) else LivePlayer(source)

        self._messages: dict[str, bytes] = {}
        self.sent: list[str] = []
        self._session = Session(opener, self._keep, play=play)
        self._now = 0.0
        self._session.open()

    def send(self, command: Command, client: int = 1) -> None:
        """Say something as a page would, and let the session do what it asks for."""
        self._session.submit(client, parse_command(json.dumps(command)))
        while self._session.pump(self._clock) == 0.0:
            pass

    def run(self, seconds: float) -> None:
        """Play for a time on a clock that only passes here."""
        end = self._now + seconds
        while self._now < end:
            wait = self._session.pump(self._clock)
            self._now += 1e-3 if not wait else min(wait, end - self._now) + 1e-6

    def leave(self, client: int = 1) -> None:
        """Close a page."""
        self._session.leave(client)
        self._session.pump(self._clock)

    def header(self, kind: str) -> dict[str, Any]:
        """Header of the last message of a type."""
        return decode(self._messages[kind])[0]

    def arrays(self, kind: str) -> dict[str, npt.NDArray[Any]]:
        """Arrays of the last message of a type."""
        return decode(self._messages[kind])[1]

    def _keep(self, kind: str, message: bytes) -> None:
        self._messages[kind] = message
        self.sent.append(kind)

    def _clock(self) -> float:
        return self._now


def view(
    simulation: Simulation,
    *,
    host: str = "127.0.0.1",
    port: int = DEFAULT_PORT,
    browser: bool = True,
    play: bool = True,
    block: bool = True,
    title: str = "",
) -> Viewer:
    """Show a simulation in the browser; see `palpate.Simulation.view`."""
    viewer = Viewer(lambda: LivePlayer(simulation), host=host, port=port, title=title, play=play)
    if browser:
        viewer.open_browser()
    if block:
        print(f"at {viewer.url} (Ctrl-C ends it)")
        with viewer, contextlib.suppress(KeyboardInterrupt):
            viewer.wait()
    return viewer
