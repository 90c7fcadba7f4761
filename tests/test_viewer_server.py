"""The viewer's server against strangers."""

import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

import palpate
from palpate.viewer import Viewer, ViewerError
from palpate.viewer.live import LivePlayer
from palpate.viewer.page import page_files
from palpate.viewer.protocol import decode


@pytest.fixture(scope="module")
def served():
    simulation = palpate.Simulation("small")
    with Viewer(lambda: LivePlayer(simulation), port=0, title="small") as viewer:
        yield viewer


def talk(viewer, **options):
    return connect(viewer.url.replace("http", "ws") + "socket", **options)


def read(page, kind, seconds=10):
    """The next message of a type; frames are confirmed as a page does."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        header, arrays = decode(page.recv(timeout=seconds))
        if header["type"] == "frame":
            page.send(json.dumps({"type": "ack", "number": header["number"]}))
        if header["type"] == kind:
            return header, arrays
    raise AssertionError(f"no {kind}")


def read_all(page, seconds, see=str):
    """Every message, without confirming any, until the connection ends or nothing comes."""
    while True:
        see(decode(page.recv(timeout=seconds))[0]["type"])


def fetch(viewer, path="", **headers):
    return urllib.request.urlopen(urllib.request.Request(viewer.url + path, headers=headers))


def test_one_may_step_it_oneself():
    simulation = palpate.Simulation("small")
    with (
        simulation.view(port=0, browser=False, play=False, block=False) as viewer,
        talk(viewer) as page,
    ):
        assert read(page, "frame")[0]["time"] == 0
        simulation.step(3)
        viewer.update()
        assert read(page, "frame")[0]["time"] == pytest.approx(0.05)


def test_a_fault_of_ours_is_shown(make_box, capsys):
    class Faulty(LivePlayer):
        def advance(self):
            raise RuntimeError("a bug")

    player = Faulty(palpate.Simulation([make_box((1, 1, 1))]))
    with Viewer(lambda: player, port=0) as viewer, talk(viewer) as page:
        assert "a bug" in read(page, "problem")[0]["text"]
        page.send(json.dumps({"type": "show", "field": None, "contacts": True, "touching": True}))
        read(page, "frame")
    assert "a bug" in capsys.readouterr().err


def test_it_serves_the_page_and_nothing_else(served):
    for name in ("", "main.js", "style.css", "three.module.min.js", "icon.svg"):
        with fetch(served, name) as answer:
            assert answer.status == 200
            assert "default-src 'none'" in answer.headers["Content-Security-Policy"]
            assert len(answer.read()) == int(answer.headers["Content-Length"])
    for name in ("../live.py", "__init__.py", "%2e%2e/live.py", "nothing"):
        with pytest.raises(urllib.error.HTTPError) as caught:
            fetch(served, name)
        assert caught.value.code == 404
        caught.value.close()


def test_the_page_asks_nobody_else():
    for path, file in page_files().items():
        if path != "/three.module.min.js":
            text = file.content.decode()
            assert "https://" not in text.replace('https:" ?', "")
            assert text.count("http://") == text.count("http://www.w3.org/2000/svg")


def test_foreign_pages_are_refused(served):
    for headers in ({"Origin": "http://evil.example"}, {"Host": "evil.example"}):
        with pytest.raises(urllib.error.HTTPError) as caught:
            fetch(served, **headers)
        assert caught.value.code == 403
        caught.value.close()
    with pytest.raises(InvalidStatus) as refused:
        talk(served, origin="http://evil.example")
    assert refused.value.response.status_code == 403
    with talk(served, origin=served.url.rstrip("/")) as page:
        assert read(page, "hello")[0]["title"] == "small"


def test_two_pages_see_the_same_and_one_may_leave(served):
    with talk(served) as first:
        read(first, "frame")
        with talk(served) as second:
            read(second, "frame")
            second.send(json.dumps({"type": "play", "on": False}))
            while read(first, "state")[0]["playing"]:
                pass
            second.send(json.dumps({"type": "step", "count": 1}))
            (one, seen), (two, other) = read(first, "frame"), read(second, "frame")
            while one["number"] != two["number"]:
                if one["number"] < two["number"]:
                    one, seen = read(first, "frame")
                else:
                    two, other = read(second, "frame")
            assert np.array_equal(seen["positions"], other["positions"])
        first.send(json.dumps({"type": "play", "on": True}))
        before = read(first, "frame")[0]["time"]
        assert read(first, "frame")[0]["time"] > before


def test_garbage_and_broken_connections_do_no_harm(served):
    with talk(served) as page:
        page.send("nonsense")
        assert "not understood" in read(page, "notice")[0]["text"]
        page.send(b"\x00\xff" * 100)
        assert "not understood" in read(page, "notice")[0]["text"]
    host, port = served.url.removeprefix("http://").rstrip("/").split(":")
    for junk in (b"", b"\x16\x03\x01\x00", b"GET / HTTP/1.1\r\n", b"POST / HTTP/1.1\r\n\r\n"):
        with socket.create_connection((host, int(port))) as raw:
            raw.sendall(junk)
    with talk(served) as page:
        read(page, "frame")
        page.socket.shutdown(socket.SHUT_RDWR)  # without a goodbye
    with talk(served) as page:
        read(page, "frame")
        page.send("x" * (1 << 21))  # larger than any command
        with pytest.raises(ConnectionClosed, match="1009"):
            read_all(page, 5)
    with talk(served) as page:
        read(page, "frame")
    deadline = time.monotonic() + 5
    while served.page_count and time.monotonic() < deadline:
        time.sleep(0.02)
    assert served.page_count == 0


def test_a_page_that_does_not_confirm_gets_no_more_frames(served):
    with talk(served) as lazy, talk(served) as other:
        other.send(json.dumps({"type": "play", "on": True}))
        for _ in range(10):
            read(other, "frame")
        kinds = []
        with pytest.raises(TimeoutError):
            read_all(lazy, 0.3, kinds.append)
        assert kinds.count("frame") <= 2


def test_a_taken_port_is_not_the_end(served):
    taken = int(served.url.rsplit(":", 1)[1].rstrip("/"))
    with Viewer(lambda: LivePlayer(palpate.Simulation("small")), port=taken) as other:
        assert other.url != served.url
        with talk(other) as page:
            read(page, "frame")
    with pytest.raises(ViewerError, match=r"203\.0\.113\.1"):
        Viewer(lambda: LivePlayer(palpate.Simulation("small")), host="203.0.113.1", port=0)


def test_the_command_serves_until_ctrl_c(tmp_path):
    path = tmp_path / "model.bml"
    path.write_text("BRANCH {\n  TREE { NE nothing.seg }\n}\n")
    command = [sys.executable, "-m", "palpate.cli", "view", str(path), "--no-browser"]
    with subprocess.Popen([*command, "--port", "0"], stdout=subprocess.PIPE, text=True) as process:
        try:
            line = process.stdout.readline()
            url = re.search(r"http://127\.0\.0\.1:\d+/", line).group()
            with urllib.request.urlopen(url) as answer:
                assert answer.status == 200
            with connect(url.replace("http", "ws") + "socket") as page:
                assert "nothing.seg" in read(page, "problem")[0]["text"]
            process.send_signal(signal.SIGINT)
            assert process.wait(20) == 0
        finally:
            process.kill()


def test_where_the_page_is_and_that_no_browser_was_found_are_told(tmp_path):
    # A thread that sends stdout to stderr, as reading a mesh does, must not catch the address.
    start = (
        "import contextlib, sys, palpate.cli.view, palpate.viewer.session as session\n"
        "from palpate.cli import main\n"
        "redirected = contextlib.redirect_stdout(sys.stderr)\n"
        "session.Session.start = lambda self: redirected.__enter__()\n"
        "main()"
    )
    command = [sys.executable, "-c", start, "view", "small", "--port", "0"]
    # Neither a program of that name nor a screen.
    bare = {name: value for name, value in os.environ.items() if "DISPLAY" not in name}
    bare |= {"PATH": str(tmp_path), "BROWSER": "none-of-that-name"}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen(command, **pipes, text=True, env=bare) as process:
        try:
            assert "no browser was found here" in process.stderr.readline()
            process.send_signal(signal.SIGINT)
            assert process.wait(20) == 0
            assert process.stdout.read().startswith("small at http://127.0.0.1:")
            assert process.stderr.read() == ""
        finally:
            process.kill()
