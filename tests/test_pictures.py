"""Pictures: the rasteriser against a plain loop, the camera, light, and the files."""

import builtins

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from palpate import pictures
from palpate.pictures import files as picture_files
from palpate.pictures.camera import view_axes
from palpate.pictures.raster import rasterize
from palpate.pictures.shadow import surroundings_shade


def nearest_triangles(points, triangles, size):
    """Twin of `rasterize`: for each pixel the nearest triangle and its height, or -1."""
    columns, rows = size
    owner = np.full((rows, columns), -1)
    height = np.full((rows, columns), -np.inf)
    for index, (a, b, c) in enumerate(points[triangles]):
        area = (b - a)[0] * (c - a)[1] - (b - a)[1] * (c - a)[0]
        if area == 0:
            continue
        for row in range(rows):
            for column in range(columns):
                at = np.array([column + 0.5, row + 0.5]) - a[:2]
                beta = (at[0] * (c - a)[1] - at[1] * (c - a)[0]) / area
                gamma = ((b - a)[0] * at[1] - (b - a)[1] * at[0]) / area
                depth = a[2] + beta * (b - a)[2] + gamma * (c - a)[2]
                inside = beta >= 0 and gamma >= 0 and beta + gamma <= 1
                if inside and depth >= height[row, column]:
                    owner[row, column], height[row, column] = index, depth
    return owner, height


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 12))
def test_rasterizer_equals_the_plain_loop(seed, count):
    rng = np.random.default_rng(seed)
    size = (17, 13)
    # Partly outside of the picture; irrational positions, so that no pixel lies on an edge.
    points = rng.uniform((-6, -6, -5), (23, 19, 5), (3 * count, 3))
    triangles = np.arange(3 * count).reshape(-1, 3)
    triangles[0, 2] = triangles[0, 0]  # a degenerate one covers nothing
    seen = rasterize(points, triangles, size)
    owner, height = nearest_triangles(points, triangles, size)
    found = np.full(size[0] * size[1], -1)
    found[seen.pixels] = seen.triangles
    assert np.array_equal(found.reshape(size[1], size[0]), owner)
    assert np.allclose(seen.depths, height.reshape(-1)[seen.pixels], atol=1e-4)
    corners = points[triangles[seen.triangles]]
    at = np.einsum("kcx,kc->kx", corners, seen.weights)
    row, column = np.divmod(seen.pixels, size[0])
    assert np.allclose(at[:, 0], column + 0.5, atol=1e-3)
    assert np.allclose(at[:, 1], row + 0.5, atol=1e-3)


def test_chunks_do_not_change_the_result(monkeypatch):
    rng = np.random.default_rng(3)
    points = rng.uniform((0, 0, 0), (40, 30, 9), (90, 3))
    triangles = np.arange(90).reshape(-1, 3)
    whole = rasterize(points, triangles, (40, 30))
    monkeypatch.setattr("palpate.pictures.raster._CHUNK", 64)
    parts = rasterize(points, triangles, (40, 30))
    assert np.array_equal(whole.pixels, parts.pixels)
    assert np.array_equal(whole.triangles, parts.triangles)
    assert np.array_equal(whole.weights, parts.weights)


def test_nothing_in_the_picture():
    seen = rasterize(np.full((3, 3), -5.0), np.array([[0, 1, 2]]), (8, 8))
    assert len(seen.pixels) == 0
    assert seen.weights.shape == (0, 3)


@pytest.mark.parametrize("up", [(0, 0, 1), (0, 1, 0), (1, 0, 0), (1, 2, -3)])
def test_axes_are_orthonormal_and_up_is_up(up):
    for azimuth in (0.0, 50.0, 200.0):
        axes = view_axes(up, azimuth=azimuth, elevation=20.0)
        assert np.allclose(axes @ axes.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(axes) == pytest.approx(1)
        direction = axes @ (np.array(up) / np.linalg.norm(up))
        assert direction[0] == pytest.approx(0, abs=1e-12)
        assert direction[1] == pytest.approx(np.cos(np.radians(20)))


@pytest.mark.parametrize("aspect", [None, 1.0, 16 / 9])
def test_frame_shows_every_moment_with_a_margin(aspect):
    rng = np.random.default_rng(0)
    moments = [rng.normal(size=(50, 3)) * (3, 1, 0.5) + (i, 0, 100) for i in range(3)]
    camera = pictures.frame(moments, aspect=aspect)
    size = camera.size(640)
    if aspect is not None:
        assert camera.width / camera.height == pytest.approx(aspect)
    for moment in moments:
        seen = camera.project(moment, size)[:, :2]
        assert (seen > 0.05 * min(size)).all()
        assert (seen < np.array(size) - 0.05 * min(size)).all()


def test_frame_follows_the_context_a_little_only():
    body = np.random.default_rng(1).uniform(-1, 1, (100, 3))
    alone = pictures.frame([body])
    ground = np.array([[x, y, -1.0] for x in (-500, 500) for y in (-500, 500)])
    wide = pictures.frame([body], context=[ground])
    assert alone.width < wide.width < 2 * alone.width
    with pytest.raises(ValueError, match="at least one point"):
        pictures.frame([])


def ball(center, radius=1.0, **look):
    """A shape from an octahedron whose faces were split three times."""
    points = [np.array(p, float) for p in np.concatenate([np.eye(3), -np.eye(3)])]
    faces = [(0, 1, 2), (1, 3, 2), (3, 4, 2), (4, 0, 2)]
    faces += [(b, a, 5) for a, b, _ in faces]
    for _ in range(3):
        split, middle = [], {}

        def between(a, b, middle=middle):
            key = (min(a, b), max(a, b))
            if key not in middle:
                mean = points[a] + points[b]
                points.append(mean / np.linalg.norm(mean))
                middle[key] = len(points) - 1
            return middle[key]

        for a, b, c in faces:
            d, e, f = between(a, b), between(b, c), between(c, a)
            split += [(a, d, f), (d, b, e), (f, e, c), (d, e, f)]
        faces = split
    nodes = np.array(points) * radius + center
    return pictures.Shape(nodes, np.array(faces), look.pop("color", (0.8, 0.2, 0.2)), **look)


def middle_color(shapes, camera, size=(96, 96)):
    image = pictures.render(shapes, camera, size=size)
    assert image.shape == (size[1], size[0], 3)
    return image[size[1] // 2, size[0] // 2].astype(int)


def test_the_nearer_body_is_seen():
    red, blue = ball((0, 0, 0)), ball((0, 0, 0), 0.5, color=(0.2, 0.2, 0.9))
    camera = pictures.frame([red.positions], aspect=1.0)
    nearer = pictures.Shape(
        blue.positions + 2 * camera.axes[2], blue.triangles, blue.color, opacity=1.0
    )
    front = middle_color([red, nearer], camera)
    assert front[2] > front[0]
    hidden = middle_color([red, blue], camera)
    assert hidden[0] > hidden[2]
    assert np.array_equal(middle_color([nearer, red], camera), front)


def test_rigid_and_clear_bodies_let_through():
    red = ball((0, 0, 0))
    camera = pictures.frame([red.positions], aspect=1.0)
    alone = middle_color([red], camera)
    cover = ball(2 * camera.axes[2], 0.5, color=(0.7, 0.7, 0.7), rigid=True)
    veiled = middle_color([red, cover], camera)
    assert veiled[0] > veiled[2] + 40  # still red
    assert not np.array_equal(veiled, alone)
    glass = ball(2 * camera.axes[2], 0.5, color=(0.2, 0.2, 0.9), opacity=0.4)
    through = middle_color([red, glass], camera)
    assert alone[2] < through[2]
    assert through[0] < alone[0]


def test_marked_nodes_change_colour():
    plain = ball((0, 0, 0))
    camera = pictures.frame([plain.positions], aspect=1.0)
    marked = ball((0, 0, 0), highlights=np.ones(len(plain.positions)))
    before, after = middle_color([plain], camera), middle_color([marked], camera)
    assert after[1] > before[1] + 60  # yellow has more green than red has


def test_wires_are_seen_before_and_faintly_behind_a_body():
    red = ball((0, 0, 0))
    camera = pictures.Camera(np.eye(3), (0.0, 0.0), 4.0, 4.0)
    size = (80, 80)
    plain = pictures.render([red], camera, size=size).astype(int)

    def drawn(height):
        """A line across the picture at a height towards the eye, one that ends, one outside."""
        ends = [
            [[-3, 0.02, height], [3, 0.02, height]],
            [[0, 1.5, 0], [0, 1.52, 0]],
            [[9, 9, 0]] * 2,
        ]
        lines = [pictures.Wires(np.array(ends, dtype=float), (0.0, 0.0, 1.0))]
        shown = pictures.render([red], camera, size=size, wires=lines).astype(int)
        return np.abs(shown - plain).max(axis=2)

    before, behind = drawn(2.0), drawn(-2.0)
    rows, columns = np.nonzero(before)
    assert set(rows.tolist()) <= {8, 9, 10, 39, 40}
    assert set(columns[rows >= 39].tolist()) == set(range(80))
    assert set(columns[rows <= 10].tolist()) <= {39, 40}
    middle = slice(30, 50)
    assert before[39:41, middle].max(axis=0).min() > 3 * behind[39:41, middle].max() > 0
    assert np.array_equal(before[39:41, :5], behind[39:41, :5])  # beside the ball nothing hides


def test_wires_of_boxes_are_their_twelve_edges():
    boxes = np.array([[[0, 0, 0], [1, 2, 3]], [[5, 5, 5], [5, 6, 7]]], dtype=float)
    ends = pictures.box_wires(boxes, (0, 0, 0)).ends
    assert ends.shape == (24, 2, 3)
    for box, edges in zip(boxes, ends.reshape(2, 12, 2, 3), strict=True):
        corners = {tuple(x[i] for x, i in zip(box.T, c, strict=True)) for c in np.ndindex(2, 2, 2)}
        assert {tuple(corner) for edge in edges for corner in edge} == corners
        assert ((edges[:, 0] != edges[:, 1]).sum(axis=1) <= 1).all()
        assert len({tuple(sorted(map(tuple, edge))) for edge in edges[:, :]}) >= 7


def test_faces_of_cuts_are_paler():
    plain = ball((0, 0, 0))
    camera = pictures.frame([plain.positions], aspect=1.0)
    raw = ball((0, 0, 0), inside=np.ones(len(plain.triangles), dtype=np.uint8))
    whole = ball((0, 0, 0), inside=np.zeros(len(plain.triangles), dtype=np.uint8))
    before, after = middle_color([plain], camera), middle_color([raw], camera)
    assert (after[1:] > before[1:] + 30).all()
    assert np.array_equal(middle_color([whole], camera), before)


def test_other_sizes_do_not_distort():
    red = ball((0, 0, 0))
    camera = pictures.frame([red.positions], aspect=1.0)
    default = pictures.render([red], camera, samples=1)
    assert default.shape == (1280, 1280, 3)
    wide = pictures.render([red], camera, size=(192, 96), samples=1).astype(int)
    red_pixels = wide[:, :, 0] - wide[:, :, 2] > 40
    columns, rows = np.ptp(np.nonzero(red_pixels)[1]), np.ptp(np.nonzero(red_pixels)[0])
    assert abs(columns - rows) <= 2


def test_a_tilted_plane_has_no_crease_and_a_corner_has():
    camera = pictures.Camera(np.eye(3), (0.0, 0.0), 1.0, 1.0)
    columns = np.linspace(0, 1, 128, dtype=np.float32)
    plane = np.repeat(1.2 * columns[None, :], 128, axis=0)
    shade = surroundings_shade(plane.reshape(-1), camera, (128, 128), 1, (0, 0, 1))
    assert np.allclose(shade.reshape(128, 128)[20:-20, 20:-20], 1)
    valley = np.repeat(1.2 * np.abs(columns - 0.5)[None, :], 128, axis=0)
    shade = surroundings_shade(valley.reshape(-1), camera, (128, 128), 1, (0, 0, 1))
    across = shade.reshape(128, 128)[64]
    assert across[64] < 0.8 < across[30]


def test_facets_of_a_smooth_surface_have_no_creases():
    camera = pictures.Camera(np.eye(3), (0.0, 0.0), 1.0, 1.0)
    columns = np.linspace(0, 1, 128, dtype=np.float32)
    facets = np.repeat(0.05 * np.abs(columns - 0.5)[None, :], 128, axis=0)
    shade = surroundings_shade(facets.reshape(-1), camera, (128, 128), 1, (0, 0, 1))
    assert np.allclose(shade.reshape(128, 128)[20:-20, 20:-20], 1)


def test_a_body_casts_a_shadow_away_from_the_light():
    camera = pictures.Camera(np.eye(3), (0.0, 0.0), 1.0, 1.0)
    depth = np.zeros((128, 128), dtype=np.float32)
    depth[60:68, 60:68] = 0.1
    shade = surroundings_shade(depth.reshape(-1), camera, (128, 128), 1, (-1, 0, 1))
    shade = shade.reshape(128, 128)
    assert shade[64, 74] < 0.9  # to the right: the light comes from the left
    assert shade[64, 20] == pytest.approx(1)


def test_files_are_complete_pngs(tmp_path):
    image = np.full((60, 80, 3), 200, dtype=np.uint8)
    camera = pictures.Camera(np.eye(3), (0.0, 0.0), 0.4, 0.3)
    path = tmp_path / "strip.png"
    pictures.save_picture(path, [image] * 3, ["a", "b", "c"], camera=camera, title="three")
    data = path.read_bytes()
    assert data.startswith(b"\x89PNG")
    columns, rows = (int.from_bytes(data[at : at + 4], "big") for at in (16, 20))
    assert (columns, rows) == (3 * 80 + 2 * 8, 60)
    assert [each.name for each in tmp_path.iterdir()] == ["strip.png"]


def test_without_matplotlib(tmp_path, monkeypatch):
    assert pictures.available()
    original = builtins.__import__

    def refuse(name, *args, **kwargs):
        if name.startswith("matplotlib"):
            raise ImportError(name)
        return original(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", refuse)
    assert not pictures.available()
    image = np.zeros((8, 8, 3), dtype=np.uint8)
    with pytest.raises(pictures.PictureError, match=r"pip install 'palpate\[plot\]'"):
        pictures.save_picture(tmp_path / "x.png", [image], ["x"])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("length", "nice", "text"),
    [(0.07, 0.05, "5 cm"), (0.1, 0.1, "10 cm"), (1.9, 1.0, "1 m"), (0.0021, 0.002, "2 mm")],
)
def test_scale_bar(length, nice, text):
    assert picture_files.nice_length(length) == pytest.approx(nice)
    assert picture_files.length_text(picture_files.nice_length(length)) == text
