"""The thread that steps: plays at the asked speed, obeys commands, publishes messages."""

from __future__ import annotations

import threading
import time
import traceback
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

from palpate.errors import ModelError, PalpateError
from palpate.viewer.player import Outcome, Player, Wishes
from palpate.viewer.protocol import PROTOCOL, Command, encode, finite

#: Frames per second that are published while playing.
FRAME_RATE = 60.0
#: Commands that wait at most; later ones are refused, so that a broken page cannot fill the memory.
_QUEUE = 2000
#: Steps that the rates are the mean of.
_RECENT = 60
#: Seconds between two looks at a file that could not be read.
_LOOK = 0.5
#: Seconds that playing may lie behind before the debt is forgiven.
_PATIENCE = 0.1

Publish = Callable[[str, bytes], None]


class Session:
    """Plays what ``open_player`` returns; ``publish`` gets each message and its type.

    ``open_player`` runs in the session's thread, again on the command ``reload``; what it raises is
    shown as a problem, and it is tried again when the file ``watch`` changes.
    """

    def __init__(
        self,
        open_player: Callable[[], Player],
        publish: Publish,
        *,
        title: str = "",
        play: bool = True,
        watch: Path | None = None,
    ) -> None:
        self._open = open_player
        self._watch = watch
        self._seen: int | None = None
        self._publish = publish
        self._title = title
        self._playing = play
        self._speed: float | None = 1.0
        self._player: Player | None = None
        self._commands: deque[tuple[int, Command]] = deque()
        self._wishes: dict[int, Wishes] = {}
        self._wake = threading.Condition()
        self._stopping = False
        self._thread: threading.Thread | None = None
        self._number = 0
        self._steps_left = 0
        self._due = 0.0
        self._shown = 0.0
        self._stale = False
        self._costs: deque[tuple[float, float, float]] = deque(maxlen=_RECENT)

    def start(self) -> None:
        """Open the player and play, in a thread of its own."""
        self._thread = threading.Thread(target=self._run, name="palpate-session", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End after the step under way."""
        with self._wake:
            self._stopping = True
            self._wake.notify()
        if self._thread is not None:
            self._thread.join()

    def submit(self, client: int, command: Command) -> bool:
        """Hand over a command; False when too many wait. From any thread."""
        with self._wake:
            if len(self._commands) >= _QUEUE:
                return False
            # Only the last place of a dragged grip or tool counts.
            if self._commands and command["type"] in ("drag", "tool", "seek"):
                last_client, last = self._commands[-1]
                same = last["type"] == command["type"] and last.get("grip") == command.get("grip")
                if same and last_client == client:
                    self._commands.pop()
            self._commands.append((client, command))
            self._wake.notify()
        return True

    def leave(self, client: int) -> None:
        """A page is gone."""
        self._insist(client, "leave")

    def refresh(self) -> None:
        """Show the present state, which something else than this session has changed."""
        self._insist(0, "refresh")

    def _insist(self, client: int, kind: str) -> None:
        with self._wake:
            self._commands.append((client, {"type": kind}))
            self._wake.notify()

    def pump(self, clock: Callable[[], float] = time.perf_counter) -> float | None:
        """Do what is due now; seconds until there is more, None when only a command brings it."""
        if self._player is None and not self._commands:
            return None
        while self._commands:
            client, command = self._commands.popleft()
            self._obey(client, command)
        if self._player is None:
            return None
        now = clock()
        if self._playing or self._steps_left:
            if self._steps_left == 0 and self._speed is not None and now < self._due:
                return self._due - now
            self._advance(clock, now)
        if self._stale:
            self._send_frame(clock())
        return 0.0 if self._playing or self._steps_left else None

    def open(self) -> None:
        """Open the player and publish hello, scene, state and the first frame."""
        self._player = None
        self._seen = self._changed_file()
        try:
            self._player = self._open()
        except Exception as error:
            self._problem("This model cannot be shown", error)
            return
        self._costs.clear()
        self._send_hello()
        self._send_scene()
        self._send_state()
        self._send_frame(0.0)
        self._due = 0.0

    def _run(self) -> None:
        self._send_waiting()
        self.open()
        wait: float | None = 0.0
        while True:
            with self._wake:
                if not self._commands and not self._stopping and wait != 0.0:
                    self._wake.wait(_LOOK if self._player is None else wait)
                if self._stopping:
                    return
            try:
                if self._player is None and self._changed_file() != self._seen:
                    self.open()
                wait = self.pump()
            except Exception as error:  # a fault of ours must not leave a page that hangs
                traceback.print_exc()
                self._stop_playing()
                self._problem("The viewer has a fault", error)
                wait = None

    def _changed_file(self) -> int | None:
        """When the watched file was written."""
        try:
            return None if self._watch is None else self._watch.stat().st_mtime_ns
        except OSError:
            return None

    def _advance(self, clock: Callable[[], float], now: float) -> None:
        player = self._player
        assert player is not None
        try:
            outcome = player.advance()
        except PalpateError as error:
            self._stop_playing()
            self._problem("The simulation cannot go on", error)
            return
        after = clock()
        self._costs.append((after, after - now, player.interval))
        if self._steps_left:
            self._steps_left -= 1
            self._due = 0.0
        elif self._speed is not None:
            due = self._due or now  # 0: it starts now
            self._due = max(due + player.interval / self._speed, after - _PATIENCE)
        if player.at_end:
            self._stop_playing()
        if player.changed() and not outcome.scene:
            self._send_scene()
        self._tell(outcome)
        self._stale = True
        if after - self._shown >= 0.9 / FRAME_RATE or not self._playing:
            self._send_frame(after)

    def _stop_playing(self) -> None:
        self._playing = False
        self._steps_left = 0
        self._send_state()

    def _obey(self, client: int, command: Command) -> None:
        kind = command["type"]
        if kind == "reload":
            self._send_waiting()
            self.open()
        elif kind == "leave":
            self._wishes.pop(client, None)
            if self._player is not None:
                self._player.leave(client)
        elif kind == "show":
            field, level = command["field"], command["level"]
            self._wishes[client] = Wishes(
                frozenset([] if field is None else [field]),
                frozenset([] if level is None else [level]),
                command["contacts"],
                command["touching"],
            )
            self._stale = True
        elif kind == "refresh":
            self._stale = True
        elif self._player is None:
            return
        elif kind == "play":
            if command["on"] and self._player.at_end:
                self._apply(self._player, {"type": "reset"}, client)
            self._playing = command["on"]
            self._due = 0.0
            self._costs.clear()
            self._send_state()
            self._stale = True
        elif kind == "step":
            self._playing = False
            self._steps_left = command["count"]
            self._send_state()
        elif kind == "speed":
            self._speed = command["value"]
            self._due = 0.0
            self._costs.clear()
            self._send_state()
        else:
            self._apply(self._player, command, client)

    def _apply(self, player: Player, command: Command, client: int) -> None:
        player.is_playing = self._playing or self._steps_left > 0
        try:
            outcome = player.obey(command, client)
        except (PalpateError, ValueError, IndexError) as error:
            outcome = Outcome(notice=str(error), state=True)
        if outcome.pause:
            self._playing = False
        self._tell(outcome)
        self._stale = self._stale or outcome.frame or outcome.scene

    def _tell(self, outcome: Outcome) -> None:
        if outcome.scene:
            self._send_scene()
        if outcome.state or outcome.scene or outcome.pause:
            self._send_state()
        if outcome.notice:
            self._publish("notice", encode("notice", {"text": outcome.notice}))

    def _send_waiting(self) -> None:
        header = {"protocol": PROTOCOL, "mode": "loading", "title": self._title, "features": []}
        self._publish("hello", encode("hello", header))

    def _send_hello(self) -> None:
        assert self._player is not None
        hello = {"protocol": PROTOCOL, "mode": self._player.mode, **self._player.hello()}
        hello["title"] = self._title or hello.get("title", "")
        self._publish("hello", encode("hello", finite(hello)))

    def _send_scene(self) -> None:
        assert self._player is not None
        self._publish("scene", self._player.scene())

    def _send_state(self) -> None:
        if self._player is None:
            return
        state = {"playing": self._playing, "speed": self._speed, **self._player.state()}
        self._publish("state", encode("state", finite(state)))

    def _send_frame(self, now: float) -> None:
        player = self._player
        if player is None:
            return
        wishes = Wishes()
        for each in self._wishes.values():
            wishes = wishes.joined(each)
        self._number += 1
        self._publish("frame", player.frame(self._number, wishes, self._rates()))
        self._shown = now
        self._stale = False

    def _rates(self) -> dict[str, Any]:
        """Steps per second as played and as possible, and simulated over real time."""
        if len(self._costs) < 2:
            return {}
        count = len(self._costs) - 1
        span = self._costs[-1][0] - self._costs[0][0]
        simulated = sum(each[2] for each in self._costs) - self._costs[0][2]
        busy = sum(each[1] for each in self._costs) - self._costs[0][1]
        return {
            "steps_per_second": count / max(span, 1e-9),
            "possible_steps_per_second": count / max(busy, 1e-9),
            "real_time": simulated / max(span, 1e-9),
        }

    def _problem(self, title: str, error: Exception) -> None:
        text = str(error)
        if not isinstance(error, (PalpateError, OSError, ValueError)):
            text = "".join(traceback.format_exception(error))
        elif isinstance(error, OSError) and error.filename is not None:
            text = f"error: {error.filename}: {error.strerror}"
        elif not isinstance(error, ModelError):
            text = f"error: {text}"
        self._publish("problem", encode("problem", {"title": title, "text": text}))
