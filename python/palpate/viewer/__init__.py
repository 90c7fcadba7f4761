"""The viewer: a local server and a page that shows a simulation and lets one touch it."""

from palpate.viewer.player import Player, Wishes
from palpate.viewer.viewer import NullViewer, Viewer, ViewerError, view

__all__ = ["NullViewer", "Player", "Viewer", "ViewerError", "Wishes", "view"]
