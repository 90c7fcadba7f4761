"""What a session plays: the interface of a running simulation and of a recording."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

from palpate.viewer.protocol import Command


@dataclass(frozen=True)
class Wishes:
    """What the pages want to see in each frame, beside the positions."""

    fields: frozenset[str] = frozenset()
    levels: frozenset[int] = frozenset()
    contacts: bool = False
    touching: bool = False

    def joined(self, other: Wishes) -> Wishes:
        """What serves both."""
        return Wishes(
            self.fields | other.fields,
            self.levels | other.levels,
            self.contacts or other.contacts,
            self.touching or other.touching,
        )


@dataclass(frozen=True)
class Outcome:
    """What a command changed, and what the user is told about it."""

    scene: bool = False
    frame: bool = False
    state: bool = False
    pause: bool = False
    notice: str | None = None


class Player(ABC):
    """Something that moves on in steps and can be shown. Used by one thread at a time."""

    #: ``live`` or ``recording``.
    mode: str
    #: Whether it moves on by itself now; whoever plays it says so before each command.
    is_playing = False

    @property
    @abstractmethod
    def interval(self) -> float:
        """Seconds that pass in one step."""

    @property
    @abstractmethod
    def time(self) -> float:
        """The time that is shown [s]."""

    @property
    @abstractmethod
    def at_end(self) -> bool:
        """Whether there is nothing after this."""

    @abstractmethod
    def hello(self) -> dict[str, Any]:
        """Title, features and the like for the page."""

    @abstractmethod
    def scene(self) -> bytes:
        """The scene message of the present topology."""

    @abstractmethod
    def state(self) -> dict[str, Any]:
        """What the controls show."""

    @abstractmethod
    def advance(self) -> Outcome:
        """Move on by one step; what changed in it beside positions."""

    @abstractmethod
    def frame(self, number: int, wishes: Wishes, numbers: dict[str, Any]) -> bytes:
        """The frame message of the present moment."""

    @abstractmethod
    def changed(self) -> bool:
        """Whether the topology is another one than in the last scene message."""

    @abstractmethod
    def obey(self, command: Command, client: int) -> Outcome:
        """Carry out a command that is not the session's own."""

    def leave(self, client: int) -> None:
        """Let go of what a page held."""
        del client
