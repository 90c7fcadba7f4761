"""Benchmarks, in tiny runs: what they measure, write and compare."""

import csv
import json
import sys

import numpy as np
import pytest
from typer.testing import CliRunner

import palpate
from palpate.bench import compare, machine, measure, motion, paper, scaling
from palpate.bench.fit import TERMS, fit_cost_model, fit_line
from palpate.bench.peers import native
from palpate.bench.peers.contender import Answer, Contender, Query, Setting, distinct
from palpate.bench.refine import refine, subdivision
from palpate.bench.tune import tune
from palpate.cli import app
from palpate.results.measures import signed_volumes

TINY = ("--frames", "2", "--repeats", "1", "--json")


def run(*arguments, status=0):
    result = CliRunner().invoke(app, [str(each) for each in arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == status, result.output
    return result.stdout


@pytest.fixture(scope="module")
def small():
    return palpate.read_model("small")


def rows(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def increasing(spread):
    return spread == sorted(spread) and spread[0] > 0


def test_paper_writes_every_leaf_size_stage_and_plot(tmp_path):
    sizes = (1, 4, 16, 64)
    options = [word for size in sizes for word in ("-K", size)]
    told = json.loads(run("bench", "paper", "small", *options, *TINY, "-o", tmp_path))
    results = json.loads((tmp_path / "results.json").read_text())
    assert results["command"] == "bench paper"
    assert results["machine"]["cpu"]
    assert results["options"] == {"leaf_sizes": list(sizes), "frames": 2, "repeats": 1}
    (case,) = results["cases"]
    assert [row["leaf_size"] for row in case["rows"]] == list(sizes)
    nodes = [row["nodes"] for row in case["rows"]]
    assert nodes == sorted(nodes, reverse=True)
    # A tree down to single elements has 2 S - 1 nodes per body.
    model = palpate.read_model("small")
    elements = [len(body.mesh.tetrahedra) or len(body.mesh.triangles) for body in model.bodies]
    assert nodes[0] == sum(2 * count - 1 for count in elements)
    for row in case["rows"]:
        for stage in ("update", "traversal", "polygons", "total", "wall"):
            assert increasing(row["times"][stage]), (row["leaf_size"], stage)
        assert row["counts"]["box_tests"] >= row["counts"]["pair_tests"]
    assert case["rows"][0]["missed"] == 0
    best = min(case["rows"], key=lambda row: row["times"]["total"][1])
    assert case["best_leaf_size"] == told["cases"][0]["best_leaf_size"] == best["leaf_size"]
    assert {(fit["stage"], fit["term"]) for fit in case["fits"]} == set(TERMS)
    table = rows(tmp_path / "paper.csv")
    assert [int(row["K"]) for row in table] == list(sizes)
    assert [float(row["total_median"]) for row in table] == [
        row["times"]["total"][1] for row in case["rows"]
    ]
    report = (tmp_path / "report.md").read_text()
    assert "P = 68,878" in report
    assert "K = 1" in report
    for name in ("stages.png", "totals.png", "tests.png"):
        assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")
        assert name in report


def test_the_printed_node_counts_are_those_of_the_leaf_sizes_we_name():
    first, second = paper.PRINTED["paper1"], paper.PRINTED["paper2"]
    # Four bodies at K = 1: the sum of 2 S - 1.
    assert second.nodes == 2 * second.tetrahedra - 4
    assert second.leaf_size_of_nodes == 1
    assert first.nodes > 2 * first.tetrahedra / first.leaf_size - 2


def test_paper_counts_pairs_missed_within_large_leaves(make_box):
    # A bar bent into more than a ring, all in one leaf: the paper's rule sees nothing.
    bar = make_box((24, 1, 1), size=(0.6, 0.02, 0.02))
    angle = 1.15 * 2 * np.pi * bar.nodes[:, 0] / 0.6
    radius = 0.09 - bar.nodes[:, 1]
    ring = np.stack([radius * np.sin(angle), -radius * np.cos(angle), bar.nodes[:, 2]], axis=1)
    model = palpate.Model([palpate.Body(bar.with_nodes(ring), name="ring")])
    case = paper.measure_case("ring", model, (1, 1000), 2, 1, lambda: None)
    found = case.rows[0].counts["pairs"]
    assert case.rows[0].missed == 0
    assert found > 0
    assert case.rows[1].counts["pairs"] == 0
    assert case.rows[1].missed == found * 2


def test_scaling_measures_every_size_and_names_what_it_leaves_out(tmp_path):
    run("bench", "scaling", "small", "-n", 1, "-n", 2, *TINY, "--bearable", 0.05, "-o", tmp_path)
    results = json.loads((tmp_path / "results.json").read_text())
    first = [each for each in results["measurements"] if each["divisions"] == 1]
    second = [each for each in results["measurements"] if each["divisions"] == 2]
    names = {each["contender"] for each in second}
    assert {"wide, 1 thread", "wide, 2 threads", "paper, 1 thread", scaling.FLOOR} <= names
    # The three soft bodies have four triangles for one; the tray, a surface, stays as it is.
    tray = 2700
    assert second[0]["triangles"] - tray == 4 * (first[0]["triangles"] - tray)
    assert all(increasing(each["times"]["wall"]) for each in results["measurements"])
    for query in (scaling.INTERSECTIONS, scaling.PROXIMITY, scaling.PROXIMITY_BY_EDGE):
        pairs = {
            each["pairs"]
            for each in second
            if each["query"] == query and each["contender"] != scaling.FLOOR
        }
        assert len(pairs) == 1, f"every method finds as many pairs: {query}"
    assert any("all-pairs" in each for each in results["left_out"])
    assert results["parallel_gain"] > 0
    assert len(rows(tmp_path / "scaling.csv")) == len(results["measurements"])
    assert (tmp_path / "scaling.png").exists()


def test_growth_per_decade_of_linear_time_is_one():
    def at(triangles, power):
        wall = triangles**power * 1e-9
        spread = {"wall": [wall] * 3}
        return scaling.Measurement("m", 1, 0, triangles, "c", "q", spread, 0.0)

    linear = scaling.growth_per_decade([at(1000, 1), at(50_000, 1)])
    quadratic = scaling.growth_per_decade([at(1000, 2), at(100_000, 2)])
    assert linear["m", "q", "c"] == pytest.approx(1)
    assert quadratic["m", "q", "c"] == pytest.approx(10)


def test_peers_compares_answers_and_names_what_is_missing(tmp_path, monkeypatch):
    # Neither importable nor buildable here, whatever is installed.
    for name in ("ipctk", "coal", "fcl", "igl", "igl.copyleft.cgal", "trimesh"):
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.setattr(native, "PROGRAM", tmp_path / "nowhere")
    told = json.loads(run("bench", "peers", "small", *TINY, "-o", tmp_path))
    assert set(told["missing"]) == set(compare.PEERS) - {"palpate"}
    assert told["missing"]["coal"] == "pip install coal"
    assert len(told["outcomes"]) == 6
    assert {each["query"] for each in told["outcomes"]} == {"intersections", "proximity"}
    assert all(each["answer"].startswith("identical") for each in told["outcomes"])
    report = (tmp_path / "report.md").read_text()
    assert all(name in report for name in told["missing"])
    assert len(rows(tmp_path / "peers.csv")) == 6
    assert json.loads((tmp_path / "results.json").read_text())["missing"] == told["missing"]
    assert (tmp_path / "peers.png").exists()


def test_peers_refuses_an_unknown_library(tmp_path):
    run("bench", "peers", "small", "--peer", "nobody", "-o", tmp_path, status=2)
    assert not list(tmp_path.iterdir())


def test_a_wrong_answer_is_told(small):
    setting = Setting("small", small, 2)
    truth = setting.true_pairs
    count = sum(map(len, truth))
    assert count > 2

    def contender(answer, found):
        return Contender("c", Query.INTERSECTIONS, answer, "", lambda: {}, found)

    right = contender(Answer.PAIRS, lambda frame: truth[frame])
    assert setting.check(right) == f"identical ({count} pairs)"
    short = contender(Answer.PAIRS, lambda frame: truth[frame][1:])
    assert setting.check(short).startswith("misses ")
    more = contender(Answer.PAIRS, lambda frame: distinct(np.concatenate([truth[frame], [[0, 1]]])))
    assert setting.check(more) == f"misses 0 and invents 2 of {count}"
    wide = contender(
        Answer.CANDIDATES, lambda frame: distinct(np.concatenate([truth[frame], [[0, 1]]]))
    )
    assert "contain every pair" in setting.check(wide)
    narrow = contender(Answer.CANDIDATES, lambda frame: truth[frame][1:])
    assert "miss " in setting.check(narrow)


def test_closest_features_are_those_that_bear_weight(small):
    setting = Setting("small", small, 2)
    scene = palpate.Scene(small)
    checked = 0
    for frame, features in enumerate(setting.near_features):
        scene.update(setting.frames[frame])
        near = scene.proximity(setting.distance)
        expected = set()
        for bodies, nodes, weights in zip(near.bodies, near.nodes, near.weights, strict=True):
            sides = []
            for body, sign in zip(bodies, (1, -1), strict=True):
                mine = sorted(nodes[sign * weights > 0] + setting.node_offsets[body], reverse=True)
                sides.append((*mine, -1, -1, -1)[:3])
            expected.add((*min(sides), *max(sides)))
        assert set(map(tuple, features.tolist())) == expected
        checked += len(expected)
    assert checked > 0


def test_tune_ranks_every_choice(small):
    told = json.loads(run("tune", "small", "--frames", 2, "--repeats", 1, "--json"))
    medians = [each["median"] for each in told["choices"]]
    assert medians == sorted(medians)
    assert told["best"] == told["choices"][0]
    choices, default = tune(small, methods=["paper"], leaf_sizes=(1, 8), frames=2, repeats=2)
    assert {(each.leaf_size, each.split) for each in choices} == {
        (size, split) for size in (1, 8) for split in ("middle", "count")
    }
    assert default.median > 0
    arguments = eval(f"dict({choices[0].arguments()})")
    assert palpate.Scene(small, **arguments).intersections() is not None


def test_the_cost_model_recovers_its_coefficients():
    nodes, triangles = np.geomspace(100, 60_000, 12), 12_000
    factors = dict(zip(TERMS, (2e-9, 3e-10, 4e-6, 5e-9), strict=True))
    for (stage, term), factor in factors.items():
        x = TERMS[stage, term](nodes, triangles)
        fit = fit_line(stage, term, x, factor * x + 1e-5)
        assert fit.factor == pytest.approx(factor)
        assert fit.constant == pytest.approx(1e-5)
        assert fit.r_squared == pytest.approx(1)
        assert fit.error < 1e-9
        np.testing.assert_allclose(fit.at(x), factor * x + 1e-5)
    falling = dict.fromkeys(("update", "traversal", "polygons"), 1 / nodes)
    fits = fit_cost_model(nodes, triangles, falling)
    assert all(fit.factor >= 0 and fit.constant >= 0 for fit in fits)
    with pytest.raises(ValueError, match="three leaf sizes"):
        fit_line("update", "P", [1, 1], [1, 1])


def test_measure_takes_turns_and_drops_the_first_round():
    calls = []

    def contender(name):
        def one_pass():
            calls.append(name)
            return {"wall": [float(len(calls)), 1.0]}

        return one_pass

    times = measure.measure({name: contender(name) for name in "abc"}, 2)
    assert "".join(calls) == "abcbcacab"
    assert times["a"]["wall"].tolist() == [[6.0, 1.0], [8.0, 1.0]]


def test_spread_takes_quantiles_frame_by_frame():
    times = np.array([[1.0, 10.0], [2.0, 20.0], [3.0, 30.0]])
    assert measure.spread(times) == measure.Spread(median=11.0, low=8.25, high=13.75)


@pytest.mark.parametrize("divisions", [2, 3])
def test_refined_tetrahedra_fill_the_same_space(make_box, divisions):
    mesh = make_box((2, 1, 1))
    fine = refine(mesh, divisions)
    assert len(fine.tetrahedra) == divisions**3 * len(mesh.tetrahedra)
    assert len(fine.triangles) == divisions**2 * len(mesh.triangles), "faces fit together"
    grid = (2 * divisions + 1) * (divisions + 1) ** 2
    assert len(fine.nodes) == grid, "no point stands twice"
    volumes = signed_volumes(fine.nodes, fine.tetrahedra)
    np.testing.assert_allclose(volumes.sum(), mesh.volume)
    children = volumes.reshape(-1, divisions**3)
    np.testing.assert_allclose(children, children[:, :1] * np.ones(divisions**3))


def test_refinement_leaves_surfaces_and_one_part_alone(make_box):
    mesh = make_box((1, 1, 1))
    surface = palpate.Mesh(mesh.nodes, triangles=mesh.triangles)
    assert refine(surface, 3) is surface
    assert refine(mesh, 1) is mesh


def test_children_of_a_tetrahedron_are_distinct():
    points, children = subdivision(3)
    assert (points.sum(axis=1) == 3).all()
    assert len(np.unique(points, axis=0)) == len(points) == 20
    assert len(np.unique(np.sort(children, axis=1), axis=0)) == 27


def test_the_motion_is_smooth_periodic_and_the_same_on_finer_meshes(small):
    fields = motion.fields(small)
    meshes = [body.mesh for body in small.bodies]
    frames = motion.record(fields, meshes, 32)
    fine = motion.record(fields, [refine(mesh, 2) for mesh in meshes], 32)
    steps = []
    for frame, finer, after in zip(frames, fine, frames[1:] + frames[:1], strict=True):
        for field, coarse, points, later in zip(fields, frame, finer, after, strict=True):
            assert np.isin(np.round(coarse, 12), np.round(points, 12)).all()
            if field.rigid:
                assert (coarse == later).all()
            else:
                steps.append(np.linalg.norm(later - coarse, axis=1).max() / field.length)
    assert 0 < max(steps) < 0.35
    again = motion.record(motion.fields(small), meshes, 32)
    assert all(
        (a == b).all()
        for f, g in zip(frames, again, strict=True)
        for a, b in zip(f, g, strict=True)
    )


@pytest.mark.parametrize("name", ["paper1", "paper2"])
def test_the_bodies_of_the_papers_cases_touch_each_other_and_themselves_and_leave(name):
    model = palpate.read_model(name)
    scene = palpate.Scene(model)
    frames = motion.record(motion.fields(model), scene.meshes, 12)
    inter, own = [], []
    for frame in frames:
        scene.update(frame)
        bodies = scene.intersections().bodies
        same = bodies[:, 0] == bodies[:, 1]
        own.append(int(same.sum()))
        inter.append(int((~same).sum()))
    assert min(own) == 0
    assert max(own) > 20
    assert max(inter) > 2 * min(inter)


def test_the_machine_is_named_without_its_host():
    import socket

    told = machine.describe()
    assert machine.slug({"cpu": "AMD EPYC", "cpu_family_model": ["26", "2"]}) == (
        "amd-epyc-family-26-model-2"
    )
    assert machine.slug({"cpu": "Intel(R) Core(TM) i7-9700", "cpu_family_model": None}) == (
        "intel-r-core-tm-i7-9700"
    )
    assert told["cores"] >= 1
    assert socket.gethostname() not in json.dumps(told)
    assert str(told["cores"]) in machine.sentence(told)


def test_realtime_measures_each_law_and_situation(tmp_path):
    few = ("--landing", 6, "--rest", 2, "--pulled", 3, "--loop", 0.3)
    laws = ("--law", "linear", "--law", "as written")
    run("bench", "realtime", "small", *laws, "--threads", 1, *few, "-o", tmp_path)
    results = json.loads((tmp_path / "results.json").read_text())
    assert [each["law"] for each in results["outcomes"]] == ["linear", "as written"]
    for each in results["outcomes"]:
        names = [(situation["name"], situation["frames"]) for situation in each["situations"]]
        assert names == [("landing", 6), ("at rest", 2), ("pulled", 3)]
        for situation in each["situations"]:
            assert 0 < situation["median"] <= situation["p90"] <= situation["worst"]
            assert 0 < sum(situation["stages"].values()) <= 1.05 * situation["mean"]
        assert each["inverted"] == 0
        assert 0 < each["factor_bytes"] < each["peak_memory"]
        assert each["floor"] > 0
        loop = each["loop"]
        assert 0 < loop["median"] <= loop["p99"] <= loop["worst"]
        assert loop["ticks"] > 20
        assert loop["steps"] > 0
        assert loop["contacts"] > 0
        assert loop["force"] > 0
    assert len(rows(tmp_path / "realtime.csv")) == 6
    assert "Tool loop" in (tmp_path / "report.md").read_text()
    assert "| small |" in (tmp_path / "report.md").read_text()


def test_a_law_that_does_not_exist_is_named(tmp_path):
    arguments = ["bench", "realtime", "small", "--law", "rubber", "-o", str(tmp_path)]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 1
    assert 'law "rubber" is not known; it must be one of linear, corotated' in result.output


def test_cutting_measures_a_long_cut(tmp_path):
    run("bench", "cutting", "small", "--body", "lower", "--frames", 6, "-o", tmp_path)
    results = json.loads((tmp_path / "results.json").read_text())
    assert results["frames"] == 6
    assert results["opened"] > 0
    assert results["tetrahedra"][1] > results["tetrahedra"][0]
    assert 0 < results["opened_live"] <= results["opened"]
    live = results["while_cutting_live"]
    assert set(live) == {"opening", "step", "frame"}
    for spread in [results["usual"], *results["while_cutting"].values(), *live.values()]:
        assert 0 <= spread["median"] <= spread["p99"] <= spread["worst"]
    assert set(results["kept_and_new"]) == {"wide", "paper"}
    assert all(min(both) > 0 for both in results["kept_and_new"].values())
    assert len(rows(tmp_path / "cutting.csv")) == 6
    report = (tmp_path / "report.md").read_text()
    assert "| at once: frame |" in report
    assert "| live: frame |" in report
