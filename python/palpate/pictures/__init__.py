"""Still pictures of a scene: `frame` a camera, `render` shapes, `save_picture` as PNG."""

from palpate.pictures.camera import Camera, frame
from palpate.pictures.files import PictureError, available, save_picture
from palpate.pictures.render import HIGHLIGHT, PALETTE, RIGID, Image, Shape, render

__all__ = [
    "HIGHLIGHT",
    "PALETTE",
    "RIGID",
    "Camera",
    "Image",
    "PictureError",
    "Shape",
    "available",
    "frame",
    "render",
    "save_picture",
]
