"""The commands that only look: check, tree, detect, convert, format; help, errors, exit status."""

import json
import os
import subprocess
import sys

import meshio
import numpy as np
import pytest
from typer.testing import CliRunner

import palpate
from palpate.cli import app
from palpate.cli.format import has_comments

COMMANDS = ("check", "tree", "detect", "simulate", "mesh", "convert", "format")


def run(*arguments, status=0):
    """Runs a command in this process; returns (stdout, stderr)."""
    result = CliRunner().invoke(app, [str(each) for each in arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == status, result.output
    return result.stdout, result.stderr


def run_json(*arguments, status=0):
    out, _ = run(*arguments, "--json", status=status)
    return json.loads(out)


def flat(text):
    """A table's text with runs of blanks made one, and thousands not set apart."""
    return " ".join(text.replace(",", "").split())


@pytest.fixture
def two_boxes(tmp_path, make_box):
    """A model of two boxes of which the second is turned and reaches into the first."""
    palpate.write_mesh(tmp_path / "one.seg", make_box((2, 2, 2), size=0.1))
    path = tmp_path / "two.bml"
    path.write_text(
        "// two boxes\n"
        "BRANCH{ TREE{ PE 3 NE one.seg MT{ young 7000 } FX{ box -1,-1,-1 1,1,0 } }\n"
        "TREE [b]{ ME{ trans 0.09,0.2,0 rot axis 0,0,1 angle 270 scale 1,1,2 } NE one.seg } }\n"
    )
    return path


@pytest.fixture
def broken(tmp_path):
    path = tmp_path / "broken.bml"
    path.write_text("BRANCH{\n  TREE{ PEE 1 NE missing.seg }\n}\n")
    return path


@pytest.mark.parametrize("command", COMMANDS)
def test_help_shows_an_example(command):
    out, _ = run(command, "--help")
    assert f"palpate {command}" in " ".join(out.split())
    assert "--json" in out


def test_help_names_the_extras():
    assert "pip install 'palpate[mesh]'" in " ".join(run("mesh", "--help")[0].split())


def test_help_names_every_command_and_version_prints_it():
    out, _ = run("--help")
    assert all(command in out for command in COMMANDS)
    assert run("--version")[0] == f"palpate {palpate.__version__}\n"
    module = [sys.executable, "-m", "palpate", "--version"]
    told = subprocess.run(module, capture_output=True, text=True, check=True).stdout
    assert told == f"palpate {palpate.__version__}\n"


def test_check_json_describes_every_body(two_boxes):
    report = run_json("check", two_boxes)
    first, second = report["bodies"]
    model = palpate.read_model(two_boxes)
    assert [each["name"] for each in report["bodies"]] == ["one", "[b]"]
    assert first["nodes"] == 27
    assert first["tetrahedra"] == 48
    assert first["triangles"] == 48
    assert first["fixed_nodes"] == 9
    assert first["processor"] == 3
    assert second["processor"] is None
    assert first["material"]["young"] == 7000
    assert first["volume"] == pytest.approx(1e-3)
    assert second["volume"] == pytest.approx(2e-3)
    placement = second["placement"]
    assert placement["translation"] == pytest.approx([0.09, 0.2, 0])
    turned = np.array(placement["rotation_axis"]) * placement["rotation_angle_degrees"]
    assert turned == pytest.approx([0, 0, -90])
    assert placement["scale"] == pytest.approx([1, 1, 2])
    assert first["placement"]["rotation_angle_degrees"] == 0
    for each, body in zip(report["bodies"], model.bodies, strict=True):
        assert each["bounds"][0] == body.mesh.nodes.min(axis=0).tolist()
        assert each["bounds"][1] == body.mesh.nodes.max(axis=0).tolist()
        assert 0 < each["quality"]["min"] <= each["quality"]["median"] <= 1
    found = palpate.Scene(model).intersections()
    assert report["overlaps"] == [{"body_a": "one", "body_b": "[b]", "pairs": len(found)}]


def test_check_tells_the_same_in_words(two_boxes):
    out, err = run("check", two_boxes)
    text = flat(out)
    assert "[b] 27 48 48 2000 cm³" in text
    assert "90° about 00-1" in text
    found = palpate.Scene(str(two_boxes)).intersections()
    assert f"one [b] {len(found)}" in text
    assert "\x1b" not in out
    assert err == ""


def test_check_takes_a_mesh_and_mends_it_only_if_asked(tmp_path, cube):
    path = tmp_path / "turned.vtk"
    swapped = cube.tetrahedra[:, [1, 0, 2, 3]]
    meshio.write(path, meshio.Mesh(cube.nodes, [("tetra", swapped)]), binary=True)
    _, err = run("check", path, status=1)
    assert "turned.vtk" in err
    report = run_json("check", path, "--repair")
    assert report["bodies"][0]["name"] == "turned"
    assert report["bodies"][0]["volume"] == pytest.approx(1)
    assert any("re-orient" in note or "invert" in note for note in report["notes"])


def test_a_broken_model_is_shown_with_line_and_caret(broken):
    out, err = run("check", broken, status=1)
    assert out == ""
    assert f"{broken}:2:" in err
    assert "^^^" in err
    assert "did you mean PE?" in err
    assert "Traceback" not in err
    error = run_json("check", broken, status=1)["error"]
    assert error["kind"] == "ModelError"
    assert error["diagnostics"][0]["line"] == 2
    assert error["diagnostics"][0]["column"] == 9


def test_a_model_that_is_not_there(tmp_path):
    for command in ("check", "tree", "detect", "simulate"):
        out, err = run(command, tmp_path / "none.bml", status=1)
        assert out == ""
        assert "none.bml" in err
        assert "small" in err  # the bundled ones are named


@pytest.mark.parametrize(
    "arguments",
    [
        (),
        ("check",),
        ("nonsense", "small"),
        ("tree", "small", "--leaf-size", "0"),
        ("tree", "small", "--split", "left"),
        ("detect", "small", "--method", "guess"),
        ("detect", "small", "--output", "pairs.txt"),
        ("simulate",),
        ("simulate", "small", "--duration", "long"),
        ("simulate", "small", "--time-step", "1/0"),
        ("simulate", "small", "--time-step", "-1"),
        ("simulate", "--resume", "c.palpate", "--time-step", "1/60"),
        ("format", "small", "--stdout", "--json"),
    ],
)
def test_wrong_usage_is_status_2(arguments, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run(*arguments, status=2)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("leaf_size", [1, 4])
@pytest.mark.parametrize("split", ["middle", "count"])
def test_tree_numbers_hang_together(two_boxes, leaf_size, split):
    report = run_json("tree", two_boxes, "--leaf-size", leaf_size, "--split", split)
    assert report["tree"] == {
        "kind": "CE",
        "children": [
            {"kind": "NE", "body": "one", "processor": 3},
            {"kind": "NE", "body": "[b]", "processor": None},
        ],
    }
    for stats in report["bodies"]:
        assert stats["elements"] == 48
        assert stats["expected_nodes"] == pytest.approx(2 * 48 / leaf_size - 1)
        assert stats["nodes"] == 2 * stats["leaves"] - 1
        fill = stats["leaf_fill"]
        assert len(fill) == leaf_size + 1
        assert sum(fill) == stats["leaves"]
        assert sum(size * count for size, count in enumerate(fill)) == 48


def test_tree_draws_the_joins(two_boxes):
    out, _ = run("tree", two_boxes, "-K", 1)
    assert out.splitlines()[:3] == ["CE", "├── NE one  PE 3", "└── NE [b]  PE auto"]
    assert "one 48 48 95 95 1.000 48" in flat(out)


@pytest.mark.parametrize("method", ["paper", "all-pairs", "hash"])
def test_detect_writes_the_pairs(two_boxes, tmp_path, method):
    expected = palpate.Scene(str(two_boxes), method="all-pairs").intersections().pairs
    assert len(expected) > 0
    arguments = ("detect", two_boxes, "--method", method, "--repeat", 3, "--output")
    report = run_json(*arguments, tmp_path / "pairs.npy")
    assert np.array_equal(np.load(tmp_path / "pairs.npy"), expected)
    assert report["pairs"] == len(expected)
    assert sum(each["pairs"] for each in report["body_pairs"]) == len(expected)
    assert report["fraction_tested"] == report["pair_tests"] / report["all_pairs"]
    for spread in report["times"].values():
        assert 0 <= spread["min"] <= spread["median"] <= spread["max"]
    run(*arguments, tmp_path / "pairs.csv")
    lines = (tmp_path / "pairs.csv").read_text().splitlines()
    assert lines[0] == "body_a,triangle_a,body_b,triangle_b"
    assert [list(map(int, line.split(","))) for line in lines[1:]] == expected.tolist()


def test_detect_without_self_contact_tests_less(two_boxes):
    whole = run_json("detect", two_boxes, "--repeat", 1)
    less = run_json("detect", two_boxes, "--repeat", 1, "--no-self")
    assert less["pairs"] == whole["pairs"]  # no box meets itself
    assert less["pair_tests"] < whole["pair_tests"]
    out, _ = run("detect", two_boxes, "--repeat", 1)
    assert f"one [b] {whole['pairs']}" in flat(out)


def test_convert_there_and_back(tmp_path, make_box):
    mesh = make_box((2, 1, 1), size=0.3)
    palpate.write_mesh(tmp_path / "a.seg", mesh)
    report = run_json("convert", tmp_path / "a.seg", tmp_path / "b.vtu")
    assert report["tetrahedra"] == 12
    assert report["notes"] == []
    run("convert", tmp_path / "b.vtu", tmp_path / "c.seg")
    assert palpate.read_mesh(tmp_path / "c.seg") == mesh
    out, _ = run("convert", tmp_path / "a.seg", tmp_path / "a.stl")
    assert "tetrahedra left out" in out
    surface = palpate.read_mesh(tmp_path / "a.stl")
    assert len(surface.triangles) == len(mesh.triangles)


def test_what_meshio_prints_stays_out_of_the_results(tmp_path, cube):
    palpate.write_mesh(tmp_path / "a.seg", cube)
    run("convert", tmp_path / "a.seg", tmp_path / "a.msh")
    out, _ = run("convert", tmp_path / "a.msh", tmp_path / "b.seg")
    assert out == f"{tmp_path / 'b.seg'}: 8 nodes, 5 tetrahedra, 12 surface triangles, 1 m³\n"
    out, _ = run("check", tmp_path / "a.msh", "--json")
    assert out.startswith("{")


def test_convert_of_an_unknown_format_leaves_nothing(tmp_path, cube):
    palpate.write_mesh(tmp_path / "a.seg", cube)
    out, err = run("convert", tmp_path / "a.seg", tmp_path / "a.nonsense", status=1)
    assert out == ""
    assert "a.nonsense" in err
    assert [each.name for each in tmp_path.iterdir()] == ["a.seg"]


def test_format_keeps_the_model_and_guards_comments(two_boxes):
    before = palpate.read_model(two_boxes)
    text = two_boxes.read_text()
    run("format", two_boxes, "--check", status=1)
    _, err = run("format", two_boxes, status=1)
    assert "comments" in err
    assert two_boxes.read_text() == text
    printed, _ = run("format", two_boxes, "--stdout")
    assert two_boxes.read_text() == text
    assert run_json("format", two_boxes, "--force")["rewritten"]
    assert two_boxes.read_text() == printed
    run("format", two_boxes, "--check")
    assert not run_json("format", two_boxes)["rewritten"]
    after = palpate.read_model(two_boxes)
    assert after.to_text() == before.to_text()
    for one, other in zip(before.bodies, after.bodies, strict=True):
        assert one.mesh == other.mesh


def test_format_leaves_bundled_models_alone(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    printed, _ = run("format", "small", "--stdout")
    _, err = run("format", "small", "--force", status=1)
    assert "bundled" in err
    assert printed.startswith("BRANCH")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("TREE{ NE a.seg }", False),
        ("TREE{ NE a.seg } // end", True),
        ('TREE{ NE "http://a.seg" }', False),
        ('TREE{ NE "say ""//"" here" }', False),
        ('TREE{ NE "a.seg" // "quoted"\n}', True),
    ],
)
def test_comments_are_told_from_quotes(text, expected):
    assert has_comments(text) is expected


def test_as_a_program_it_is_plain_in_a_pipe(broken):
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    arguments = [sys.executable, "-m", "palpate.cli"]
    good = subprocess.run(
        [*arguments, "check", "small"], capture_output=True, env=environment, check=False
    )
    assert good.returncode == 0, good.stderr
    assert b"\x1b" not in good.stdout
    assert b"tray" in good.stdout
    bad = subprocess.run([*arguments, "check", str(broken)], capture_output=True, check=False)
    assert bad.returncode == 1
    assert bad.stdout == b""
    assert b"Traceback" not in bad.stderr
    assert b"did you mean PE?" in bad.stderr


def test_help_does_not_import_what_only_pictures_and_files_need():
    code = (
        "import sys; sys.argv = ['palpate', '--help']\n"
        "from palpate.cli import main\n"
        "try: main()\n"
        "finally: assert not {'matplotlib', 'meshio', 'scipy'} & set(sys.modules)\n"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, check=False)
    assert result.returncode == 0, result.stderr
