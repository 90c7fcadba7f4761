"""Still pictures of a scene: `frame` a camera, `render` shapes, `save_picture` as PNG."""

from palpate.pictures.camera import Camera, frame
from palpate.pictures.files import PictureError, available, save_picture
from palpate.pictures.render import HIGHLIGHT, PALETTE, RIGID, Image, Shape, render
from palpate.pictures.wires import Wires, box_wires

__all__ = [
    "HIGHLIGHT",
    "PALETTE",
    "RIGID",
    "Camera",
    "Image",
    "PictureError",
    "Shape",
    "Wires",
    "available",
    "box_wires",
    "frame",
    "render",
    "save_picture",
]
