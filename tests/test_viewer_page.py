"""The viewer's page in a headless Chromium; without one, only the tests of `test_viewer.py` run."""

import os
import re
import time

import chromium
import numpy as np
import pytest

import palpate
from palpate.results.frames import FrameSeries
from palpate.viewer import Viewer, Wishes
from palpate.viewer.export import export_film
from palpate.viewer.live import LivePlayer
from palpate.viewer.protocol import decode
from palpate.viewer.recorded import RecordedPlayer
from palpate.viewer.recording import Recording

SIZE = (640, 420)

pytestmark = pytest.mark.skipif(
    chromium.find() is None and not os.environ.get("CI"), reason="no chromium on this machine"
)


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    # Small, since the processor draws; wide enough for the panel.
    browser = chromium.Chromium(tmp_path_factory.mktemp("profile"), SIZE)
    yield browser
    browser.close()


@pytest.fixture(scope="module")
def served():
    simulation = palpate.Simulation("small")
    with Viewer(lambda: LivePlayer(simulation), port=0, title="small") as viewer:
        yield viewer


@pytest.fixture(scope="module")
def opened(browser, served):
    page = browser.open(served.url)
    page.wait("globalThis.palpate?.received > 2")
    yield page
    assert [url for url in page.requests if not url.startswith(served.url)] == []
    page.close()


@pytest.fixture
def page(opened):
    """The page after 0.5 s of simulated time, when the bodies have touched; paused."""
    opened.run("palpate.send({ type: 'play', on: false }), palpate.send({ type: 'reset' })")
    opened.wait("palpate.state.playing === false && palpate.last.header.time === 0")
    opened.run("palpate.send({ type: 'step', count: 30 })")
    opened.wait("palpate.last.header.time > 0.499")
    yield opened
    assert opened.problems == []


def picture(page, path):
    """The page as pixels (rows, columns, 3)."""
    from matplotlib.image import imread

    page.screenshot(path)
    return imread(path)[:, :, :3]


def place_on_screen(page, body):
    """Where the middle of a body's nodes is drawn."""
    return page.run(
        f"""(() => {{
          const {{ stage }} = palpate;
          const body = stage.bodies[{body}];
          const {{ array }} = body.geometry.attributes.position;
          const sum = stage.camera.position.clone().set(0, 0, 0), at = sum.clone();
          for (let i = 0; i < array.length; i += 3) sum.add(at.fromArray(array, i));
          sum.multiplyScalar(3 / array.length);
          stage.world.localToWorld(sum).project(stage.camera);
          return [(sum.x + 1) / 2 * innerWidth, (1 - sum.y) / 2 * innerHeight];
        }})()"""
    )


def test_bodies_are_seen_and_move_until_paused(page, tmp_path):
    page.key("r")
    page.wait("palpate.last.header.time === 0 && !palpate.stage.dirty")
    before = picture(page, tmp_path / "before.png")
    # Red, yellow and blue: the colours of the model.
    middle = before[60:-60, 100:-100]
    for channel, other in ((0, 2), (2, 0)):
        assert (middle[:, :, channel] > middle[:, :, other] + 0.25).mean() > 0.005
    page.key(" ")
    page.wait("palpate.last.header.time > 0.5")
    page.key(" ")
    page.wait("palpate.state.playing === false")
    after = picture(page, tmp_path / "after.png")
    assert np.abs(after - before)[60:-60, 100:-100].max() > 0.3
    time.sleep(0.2)
    stopped = page.run("palpate.last.header.time")
    time.sleep(0.3)
    assert page.run("palpate.last.header.time") == stopped
    page.key("ArrowRight")
    page.wait(f"palpate.last.header.time > {stopped}")
    assert page.run("document.querySelector('#transport .time').textContent").endswith("s")


def test_what_is_shown_can_be_chosen(page, tmp_path):
    for key in ("c", "t", "w", "b"):
        page.key(key)
    page.wait("palpate.last.arrays.contact_points?.length > 30")
    page.wait("palpate.overlay.needles.count > 10 && palpate.overlay.boxes.visible")
    assert page.run("palpate.overlay.boxCount") == 4
    for _ in range(3):
        page.key("]")
    page.wait("palpate.last.arrays['boxes/3']?.length > 6 * 4 * 4")
    page.wait("palpate.overlay.boxCount === palpate.last.arrays['boxes/3'].length / 6")
    page.wait("/3: [0-9]+ boxes/.test(document.getElementById('panel').textContent)")
    page.run("document.querySelector('[aria-label=\"Show lower\"]').click(), palpate.set({})")
    page.wait("palpate.overlay.boxCount < palpate.last.arrays['boxes/3'].length / 6")
    page.run("document.querySelector('[aria-label=\"Show lower\"]').click()")
    page.run("palpate.set({ wireframe: false, field: 'stress' })")
    page.wait("palpate.last.arrays['field/stress'] && palpate.high > 10")
    assert re.search(
        "von Mises.*≥ [0-9.]+ k?Pa", page.run("document.getElementById('legend').textContent")
    )
    page.run("palpate.set({ range: 0.1 })")
    page.run("palpate.set({ field: 'deformation' })")
    assert page.run("palpate.view.range") == 1
    page.wait("!document.getElementById('legend').hidden && palpate.high > 0")
    assert "mm" in page.run("document.getElementById('legend').textContent")
    painted = picture(page, tmp_path / "painted.png")
    page.run("palpate.set({ field: null })")
    page.wait("document.getElementById('legend').hidden")
    assert np.abs(picture(page, tmp_path / "plain.png") - painted).max() > 0.3


def test_a_picture_is_saved(page):
    size = page.run("palpate.stage.picture().then((each) => each.size)")
    assert size > 5000
    type_ = page.run("palpate.stage.picture().then((each) => each.type)")
    assert type_ == "image/png"


def test_settings_of_a_body_reach_the_simulation(page):
    page.run("document.querySelector('.body .who').click()")
    page.run(
        """(() => {
          const input = document.querySelector('.body [aria-label="Stiffness"]');
          input.value = 25000;
          input.dispatchEvent(new Event("change"));
        })()"""
    )
    page.wait("palpate.state.bodies[0].material.young === 25000")
    page.wait("document.querySelector('.body [aria-label=\"Stiffness\"]').value === '25000'")


def test_creases_are_sharp_and_the_rest_is_smooth(page, make_box):
    def split(mesh):
        """How many corners each node becomes."""
        return page.run(
            f"""import("palpate/bodies").then(({{ split }}) => {{
              const {{ origin, index }} = split({mesh.nodes.ravel().tolist()},
                                                {mesh.triangles.ravel().tolist()});
              const same = index.every((corner, i) =>
                origin[corner] === {mesh.triangles.ravel().tolist()}[i]);
              return [same, Array.from(origin)];
            }})"""
        )

    same, origin = split(make_box((2, 2, 2)))
    # 8 corners of three faces, 12 edges' middles of two, 6 faces' middles of one.
    assert same
    assert sorted(np.unique(origin, return_counts=True)[1]) == [1] * 6 + [2] * 12 + [3] * 8
    ball = palpate.read_model("small").bodies[0].mesh
    same, origin = split(
        palpate.Mesh(
            ball.nodes[ball.surface_nodes],
            triangles=np.searchsorted(ball.surface_nodes, ball.triangles),
        )
    )
    assert same
    assert len(origin) == len(ball.surface_nodes)


def test_it_says_when_it_falls_behind_real_time(page):
    chips = "document.getElementById('chips')"
    page.run("palpate.send({ type: 'speed', value: 1 }), palpate.send({ type: 'play', on: true })")
    page.wait(f"/real time$/.test({chips}.textContent)")
    # Thousands of times real time: no machine keeps up with that.
    page.run("palpate.send({ type: 'speed', value: 1000 })")
    page.wait(f"{chips}.querySelector('.warn')?.textContent.endsWith('behind')")
    assert "cannot keep up" in page.run(f"{chips}.querySelector('.warn').title")
    page.run("palpate.send({ type: 'speed', value: 1 })")


def test_the_camera_turns_with_the_mouse(page):
    page.run("palpate.setMode('look')")
    page.run("globalThis.before = palpate.stage.camera.position.clone()")
    page.mouse("mousePressed", 400, 70)
    for step in range(5):
        page.mouse("mouseMoved", 400 + 20 * step, 70)
    page.mouse("mouseReleased", 480, 70)
    page.wait("palpate.stage.camera.position.distanceTo(before) > 0.2")


def test_tissue_is_dragged(page):
    page.run("palpate.setMode('pull')")
    page.key(" ")
    x, y = place_on_screen(page, 2)
    page.mouse("mousePressed", x, y)
    for step in range(1, 9):
        page.mouse("mouseMoved", x, y - 12 * step)
        time.sleep(0.03)
    page.wait("palpate.last.header.pulls.length === 1")
    page.wait("palpate.last.header.pulls[0].force[2] > 0.02")
    page.wait("/N$/.test(document.querySelector('#labels .label')?.textContent)")
    page.mouse("mouseReleased", x, y - 96)
    page.wait("palpate.last.header.pulls.length === 0")


def test_tissue_is_pushed(page):
    page.run("palpate.setMode('push')")
    page.key(" ")
    x, y = place_on_screen(page, 2)
    page.mouse("mousePressed", x, y)
    page.wait("Math.hypot(...(palpate.last.header.tool?.force ?? [0])) > 0.01")
    page.mouse("mouseReleased", x, y)
    page.wait("palpate.last.header.tool === null")


def test_tissue_is_cut_and_mended(page):
    page.key("4")
    assert page.run("palpate.mode") == "cut"
    triangles = page.run("palpate.stage.triangleCount")
    x, y = place_on_screen(page, 2)
    page.mouse("mousePressed", x - 110, y)
    for step in range(12):
        page.mouse("mouseMoved", x - 110 + 20 * step, y + step)
    page.wait("document.querySelector('#stroke polyline').points.length > 3")
    page.mouse("mouseReleased", x + 110, y + 11)
    page.wait("palpate.state.undo === 1")
    assert page.run("document.querySelector('#stroke polyline').points.length") == 0
    page.wait(f"palpate.stage.triangleCount > {triangles}")
    page.wait("/cm² cut/.test(document.getElementById('toasts').textContent)")
    page.wait("palpate.last.header.version === palpate.version")
    page.wait("palpate.stage.bodies[2].inside?.some((each) => each === 1)")
    page.key("z")
    page.wait(f"palpate.state.undo === 0 && palpate.stage.triangleCount === {triangles}")


def test_a_stroke_while_it_plays_opens_without_a_stall(page):
    page.key("4")
    triangles = page.run("palpate.stage.triangleCount")
    x, y = place_on_screen(page, 2)
    page.mouse("mousePressed", x - 110, y)
    for step in range(12):
        page.mouse("mouseMoved", x - 110 + 20 * step, y + step)
    # Only now, since on a busy machine the bodies would be elsewhere before the stroke is drawn.
    page.key(" ")
    page.wait("palpate.state.playing === true")
    page.mouse("mouseReleased", x + 110, y + 11)
    # Notices stay for seconds only.
    page.wait("/cm² cut.*beside the steps/.test(document.getElementById('toasts').textContent)")
    page.wait(f"palpate.stage.triangleCount > {triangles}")
    assert page.run("palpate.state.playing") is True
    page.wait("palpate.last.header.version === palpate.version")
    page.wait("palpate.state.undo === 1")
    page.key("z")
    page.wait(f"palpate.state.undo === 0 && palpate.stage.triangleCount === {triangles}")
    page.key(" ")
    page.wait("palpate.state.playing === false")


def test_two_pages_and_a_lost_server(browser, page, served):
    other = browser.open(served.url)
    other.wait("globalThis.palpate?.received > 0")
    other.run("palpate.send({ type: 'play', on: false })")
    page.wait("palpate.state.playing === false")
    other.close()
    page.run("palpate.send({ type: 'play', on: true })")
    page.wait("palpate.state.playing === true")
    page.run("palpate.source.socket.close()")
    page.wait("palpate.broken")
    page.wait("!palpate.broken && palpate.source.socket.readyState === 1")
    count = page.run("palpate.received")
    page.wait(f"palpate.received > {count}")


def test_a_film_plays_without_a_server(browser, tmp_path):
    path = tmp_path / "film.html"
    player = LivePlayer(palpate.Simulation("small"))
    export_film(player, path, count=12, title="a film")
    page = browser.open(path.as_uri())
    page.wait("globalThis.palpate?.received > 0")
    assert page.run("document.title").startswith("a film")
    page.wait("palpate.last.header.frame === 12 && palpate.state.playing === false")
    shown = page.run("Array.from(palpate.positions.slice(0, 30))")
    expected = decode(player.frame(0, Wishes(), {}))[1]["positions"].reshape(-1)[:30]
    assert np.allclose(shown, expected, atol=1e-5)
    page.run("palpate.send({ type: 'seek', frame: 3 })")
    page.wait("palpate.last.header.frame === 3")
    page.run("palpate.set({ field: 'displacement' })")
    page.wait("!document.getElementById('legend').hidden")
    options = page.run("[...document.getElementById('field').options].map((each) => each.value)")
    assert options == ["", "displacement", "stress", "depth", "force"]
    wishes = Wishes(frozenset(["stress"]))
    before = LivePlayer(simulation := palpate.Simulation("small"))
    simulation.step(3)
    expected = decode(before.frame(0, wishes, {}))[1]["field/stress"]
    page.run("palpate.set({ field: 'stress' })")
    page.wait("/kPa|Pa/.test(document.getElementById('legend').textContent)")
    shown = page.run(
        "import('palpate/protocol').then((it) => Array.from(it.valuesOf(palpate.last, 'stress')))"
    )
    assert np.allclose(shown, expected, atol=expected.max() / 500)
    assert page.problems == []
    assert all(url.startswith(("file:", "data:", "blob:")) for url in page.requests)
    page.close()


def test_a_run_shows_its_boxes_and_the_faces_of_its_cuts(browser, tmp_path):
    simulation = palpate.Simulation("small")
    frames = FrameSeries(tmp_path, simulation)
    frames.add(simulation)
    simulation.cut(palpate.Blade.plane((0, 0, 0.03), (1, 0, 0)))
    simulation.step(3)
    frames.add(simulation)
    frames.finish()
    recording = Recording(tmp_path)
    with Viewer(lambda: RecordedPlayer(recording), port=0, play=False) as viewer:
        page = browser.open(viewer.url)
        page.wait("globalThis.palpate?.received > 0")
        assert page.run("palpate.stage.bodies.every((each) => each.inside === null)")
        page.run("palpate.send({ type: 'seek', frame: 1 })")
        page.wait("palpate.stage.bodies[0].inside?.some((each) => each === 1)")
        for _ in range(3):
            page.key("]")
        page.wait("palpate.overlay.boxCount === palpate.last.arrays['boxes/3']?.length / 6")
        page.wait("/3: [0-9]+ boxes/.test(document.getElementById('panel').textContent)")
        assert page.problems == []
        page.close()


def test_a_model_error_is_shown_as_in_the_terminal(browser, tmp_path):
    path = tmp_path / "broken.bml"
    path.write_text("BRANCH {\n  TREE { NE small.seg  MT{ yuong 5 } }\n}\n")
    with pytest.raises(palpate.ModelError) as caught:
        palpate.read_model(path)
    with Viewer(lambda: LivePlayer(palpate.Simulation(path)), port=0, watch=path) as viewer:
        page = browser.open(viewer.url)
        page.wait("globalThis.palpate && !document.getElementById('problem').hidden")
        assert page.run("document.querySelector('#problem pre').textContent") == str(caught.value)
        (tmp_path / "small.seg").write_bytes((palpate.model.MODELS / "small.seg").read_bytes())
        path.write_text("BRANCH {\n  TREE { NE small.seg  MT{ young 5000 } }\n}\n")
        page.wait("palpate.received > 1 && document.getElementById('problem').hidden")
        page.close()
