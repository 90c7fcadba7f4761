"""The page's files: as the server gives them, and as one file that needs none."""

from __future__ import annotations

import base64
import hashlib
import re
from dataclasses import dataclass
from pathlib import Path

_FOLDER = Path(__file__).parent
_KINDS = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".svg": "image/svg+xml",
}


@dataclass(frozen=True)
class PageFile:
    """What the server answers: the content, its type, and what it may load."""

    content: bytes
    kind: str
    policy: str


def page_files() -> dict[str, PageFile]:
    """The files by the path of their address."""
    index = (_FOLDER / "index.html").read_text("utf-8")
    # The browser runs the page's own modules and the one inline script, the map of their names.
    hashes = " ".join(
        "'sha256-" + base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() + "'"
        for script in re.findall(r"<script[^>]*>([^<]+)</script>", index)
    )
    policy = (
        f"default-src 'none'; script-src 'self' {hashes}; style-src 'self' 'unsafe-inline'; "
        "img-src 'self' data: blob:; connect-src 'self'; base-uri 'none'; form-action 'none'; "
        "frame-ancestors 'self'"
    )
    files = {
        f"/{path.name}": PageFile(path.read_bytes(), _KINDS[path.suffix], policy)
        for path in _FOLDER.iterdir()
        if path.suffix in _KINDS
    }
    files["/"] = files["/index.html"]
    return files


def single_page(recording: bytes, title: str) -> str:
    """The whole page in one HTML file that plays a recording without a server."""
    index = (_FOLDER / "index.html").read_text("utf-8")
    modules = {
        path.stem if path.name != "three.module.min.js" else "three": path
        for path in sorted(_FOLDER.glob("*.js"))
    }
    imports = ",\n".join(
        f'"{_specifier(name)}": "data:text/javascript;base64,{_base64(path.read_bytes())}"'
        for name, path in modules.items()
    )
    style = (_FOLDER / "style.css").read_text("utf-8")
    icon = f"data:image/svg+xml;base64,{_base64((_FOLDER / 'icon.svg').read_bytes())}"
    replacements = {
        r'<script type="importmap">.*?</script>': (
            f'<script type="importmap">{{"imports": {{\n{imports}\n}}}}</script>'
        ),
        r'<link rel="stylesheet"[^>]*>': f"<style>\n{style}</style>",
        r'<link rel="icon"[^>]*>': f'<link rel="icon" href="{icon}">',
        r"<title>.*?</title>": f"<title>{_escaped(title)}</title>",
        r'<script type="module"[^>]*></script>': (
            f'<script type="text/plain" id="recording">{_base64(recording)}</script>\n'
            '<script type="module">import "palpate/main";</script>'
        ),
    }
    for pattern, text in replacements.items():
        index, count = re.subn(pattern, text.replace("\\", r"\\"), index, flags=re.DOTALL)
        if count != 1:
            raise AssertionError(f"index.html: {count} places match {pattern}")
    return index


def _specifier(name: str) -> str:
    return name if name == "three" else f"palpate/{name}"


def _base64(content: bytes) -> str:
    return base64.b64encode(content).decode("ascii")


def _escaped(text: str) -> str:
    return text.replace("&", "&amp;").replace("<", "&lt;")
