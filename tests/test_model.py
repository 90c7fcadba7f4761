"""Models: from text and from Python."""

import dataclasses

import numpy as np
import pytest
from conftest import CUBE_NODES, CUBE_TETRAHEDRA

import palpate

PAPER = """\
BRANCH{
  ME{ trans 0,0,0  rot 1,0,0,0  scale 1,1,1 }
  TREE{
    ME{ trans 2,0,0  rot 1,0,0,0  scale 1,1,2 }
    PE 1
    NE kidney.seg
  }
  TREE{
    ME{ trans 0,-2.5,-1.4  rot 1,0,0,0  scale 1,1,2 }
    PE 2
    NE aorta.seg
  }
}
"""

LIFT = np.array([0.0, 0.0, 5.0])


@pytest.fixture
def write_model(tmp_path, cube):
    palpate.write_mesh(tmp_path / "kidney.seg", cube)
    palpate.write_mesh(tmp_path / "aorta.seg", cube)

    def write(text):
        path = tmp_path / "model.bml"
        path.write_text(text)
        return path

    return write


def test_the_papers_sample_loads(write_model):
    model = palpate.read_model(write_model(PAPER))
    kidney, aorta = model.bodies
    assert (kidney.name, aorta.name) == ("kidney", "aorta")
    assert (kidney.processor, aorta.processor) == (1, 2)
    assert np.allclose(kidney.mesh.nodes, CUBE_NODES * [1, 1, 2] + [2, 0, 0])
    assert np.allclose(aorta.mesh.nodes, CUBE_NODES * [1, 1, 2] + [0, -2.5, -1.4])
    assert kidney.rigid is None
    assert kidney.material == palpate.Material()
    assert model.tree.kind == "CE"
    assert [child.body for child in model.tree.children] == [0, 1]


def test_text_round_trips(write_model):
    model = palpate.read_model(write_model(PAPER))
    again = palpate.read_model(write_model(model.to_text()))
    assert again.to_text() == model.to_text()
    assert [body.mesh for body in again.bodies] == [body.mesh for body in model.bodies]


def test_every_parameter_of_a_material_goes_by_its_name(write_model):
    numbers = {each.name: each.default for each in dataclasses.fields(palpate.Material)}
    numbers = {name: value for name, value in numbers.items() if isinstance(value, float)}
    assert len(numbers) >= 9
    numbers = {name: 0.01 * (place + 1) for place, name in enumerate(numbers)}
    text = " ".join(f"{name} {value}" for name, value in numbers.items())
    model = palpate.read_model(
        write_model(f"TREE {{ NE kidney.seg  MT {{ law corotated {text} }} }}")
    )
    (body,) = model.bodies
    assert body.material == palpate.Material(law="corotated", **numbers)
    assert palpate.Model([body]).bodies[0].material == body.material
    assert palpate.read_model(write_model("TREE { NE kidney.seg }")).bodies[0].material == (
        palpate.Material()
    )


def test_extensions_arrive_in_python(write_model):
    model = palpate.read_model(
        write_model("""
        gravity 0,0,-1
        TREE left {
          NE kidney.seg
          MT { young 1e4 poisson 0.3 density 900 damping 0.02 mass_damping 0.5 }
          CN { friction 0.4 distance 0.01 stiffness 1e6 self off }
          FX { box -1,-1,-1 2,2,0.5 }
          VE { color 0.1,0.2,0.3 opacity 0.5 }
          IV 1,2,3
          RG { at 0 trans 0,0,0  at 1 trans 0,0,0.5 rot axis 0,0,1 angle 90 }
        }
    """)
    )
    (body,) = model.bodies
    assert model.gravity == (0.0, 0.0, -1.0)
    assert body.name == "left"
    assert body.material == palpate.Material("linear", 1e4, 0.3, 900.0, 0.02, 0.5)
    assert body.contact == palpate.Contact(0.4, 0.01, 1e6, False)
    assert body.fixed_nodes.tolist() == [0, 2, 4, 6]
    assert body.color == (0.1, 0.2, 0.3)
    assert body.opacity == 0.5
    assert body.initial_velocity == (1.0, 2.0, 3.0)
    assert [key.time for key in body.rigid] == [0.0, 1.0]
    assert np.allclose(body.rigid[1].rotation, [np.sqrt(0.5), 0, 0, np.sqrt(0.5)])


def test_a_model_error_has_its_place(write_model):
    path = write_model("TREE {\n  PEE 1\n  NE kidney.seg\n}\n")
    with pytest.raises(palpate.ModelError) as caught:
        palpate.read_model(path)
    error = caught.value
    assert (error.path, error.line, error.column) == (str(path), 2, 3)
    assert "PEE" in str(error)
    assert "^" in str(error)
    assert "PE" in error.diagnostics[0].hint


def test_a_missing_mesh_is_an_error_at_its_name(write_model):
    path = write_model("TREE {\n  NE liver.seg\n}\n")
    with pytest.raises(palpate.ModelError, match=r"liver\.seg") as caught:
        palpate.read_model(path)
    assert (caught.value.line, caught.value.column) == (2, 6)


def test_ne_reads_formats_that_only_python_knows(write_model, tmp_path, cube):
    pytest.importorskip("meshio")
    palpate.write_mesh(tmp_path / "cube.vtu", cube)
    model = palpate.read_model(write_model("TREE { NE cube.vtu }"))
    assert np.array_equal(model.bodies[0].mesh.tetrahedra, cube.tetrahedra)


def test_a_missing_model_lists_the_bundled_ones(tmp_path):
    with pytest.raises(FileNotFoundError, match="case1"):
        palpate.read_model(tmp_path / "nothing.bml")


@pytest.mark.parametrize("name", ["small", "case1", "case2"])
def test_bundled_models_load(name):
    model = palpate.read_model(name)
    assert len(model.bodies) >= 2
    assert all(body.mesh.volume > 0 or body.rigid is not None for body in model.bodies)
    assert "NE " in model.to_text()


def test_a_model_from_arrays(cube):
    floor = palpate.Mesh(
        [[-5, -5, -1], [5, -5, -1], [5, 5, -1], [-5, 5, -1]], triangles=[[0, 1, 2], [0, 2, 3]]
    )
    model = palpate.Model(
        [cube, palpate.Body(floor, name="floor", rigid=()), cube], gravity=(0, 0, -2)
    )
    assert [body.name for body in model.bodies] == ["body_1", "floor", "body_3"]
    assert model.bodies[1].rigid == ()
    with pytest.raises(ValueError, match="made from arrays"):
        model.to_text()


def test_names_are_made_unique(cube):
    bodies = [palpate.Body(cube), cube, palpate.Body(cube), palpate.Body(cube, name="body_2")]
    names = ["body", "body_2", "body_3", "body_2_2"]
    assert [body.name for body in palpate.Model(bodies).bodies] == names
    assert list(palpate.Scene(bodies).names) == names
    assert palpate.Simulation(bodies).model.body_index("body_3") == 2
    assert bodies[2].name == "body"


@pytest.mark.parametrize(
    ("body", "text"),
    [
        ({"material": palpate.Material(poisson=0.5)}, "poisson"),
        ({"material": palpate.Material(young=-1.0)}, "young"),
        ({"material": palpate.Material(density=float("nan"))}, "density"),
        ({"material": palpate.Material(law="rubber")}, "rubber"),
        ({"contact": palpate.Contact(friction=-1.0)}, "friction"),
        ({"contact": palpate.Contact(distance=0.0)}, "distance"),
        ({"fixed_nodes": [8]}, "fixed"),
        ({"fixed_nodes": [-1]}, "fixed_nodes"),
        ({"opacity": 2.0}, "opacity"),
        ({"rigid": [palpate.RigidKey(1.0), palpate.RigidKey(1.0)]}, "time"),
        ({"initial_velocity": (0, 0)}, "initial_velocity"),
    ],
)
def test_bad_bodies_are_refused_by_name(cube, body, text):
    with pytest.raises(ValueError, match=text):
        palpate.Model([palpate.Body(cube, name="left", **body)])


def test_cube_in_fixture_is_what_the_tests_say(cube):
    assert np.array_equal(cube.tetrahedra, CUBE_TETRAHEDRA)


def test_materials_of_regions_and_fibres(tmp_path, cube):
    count = len(cube.tetrahedra)
    along, across = np.tile([0.0, 0.0, 2.0], (count, 1)), np.tile([1.0, 0.0, 0.0], (count, 1))
    mesh = palpate.Mesh(
        cube.nodes,
        cube.tetrahedra,
        regions=np.arange(count) % 2,
        fibres=np.stack([along, across], axis=1),
    )
    assert np.array_equal(mesh.fibres[:, 1], across)
    assert cube.fibres is None
    for name in ("artery.seg", "artery.vtk", "artery.vtu"):
        palpate.write_mesh(tmp_path / name, mesh)
        assert palpate.read_mesh(tmp_path / name) == mesh
    wall = palpate.Material(law="hgo", k1=3000.0, fibre_2=(0.0, 1.0, 0.0))
    body = palpate.Body(
        mesh, name="artery", material=palpate.Material(law="neo-hookean"), regions={1: wall}
    )
    model = palpate.Model([body])
    assert model.bodies[0].regions == {1: wall}
    report = palpate.Simulation(model).step(3)
    assert report.newton_iterations >= 3
    with pytest.raises(ValueError, match="no region 7"):
        palpate.Model([palpate.Body(mesh, material=wall, regions={7: wall})])
    with pytest.raises(ValueError, match="no fibre direction"):
        palpate.Model([palpate.Body(cube, material=palpate.Material(law="hgo"))])
    with pytest.raises(ValueError, match="fibres"):
        palpate.Mesh(cube.nodes, cube.tetrahedra, fibres=np.zeros((count, 4, 3)))
    (tmp_path / "case.bml").write_text(
        "TREE{ NE artery.vtk  MT{ law neo-hookean }  MT region 1 { law hgo  k1 3000 } }"
    )
    read = palpate.read_model(tmp_path / "case.bml").bodies[0]
    assert read.regions == {1: palpate.Material(law="hgo", k1=3000.0)}
    assert read.mesh == mesh


def test_attachments_tie_bodies() -> None:
    box = palpate.read_model("small").bodies[0].mesh
    low, high = box.nodes.min(axis=0), box.nodes.max(axis=0)
    lift = np.array([0, 0, high[2] - low[2] + 1e-4])
    above = palpate.Mesh(box.nodes + lift, box.tetrahedra)
    bodies = [palpate.Body(box, name="low"), palpate.Body(above, name="up")]
    ties = [palpate.Attachment("up", "low", within=2e-3, stiffness=1e6)]
    model = palpate.Model(bodies, attachments=ties)
    (found,) = model.attachments
    assert (found.first, found.second, found.stiffness) == ("up", "low", 1e6)
    assert found.nodes is not None
    assert len(found.nodes) > 0
    assert (above.nodes[found.nodes][:, 2] < low[2] + lift[2] + 2e-3).all()
    palpate.Simulation(model).step(2)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        (("up", "low", 1e-9), ValueError, r"attachments\[0\]: no node of `up` is within 1e-9 m"),
        (("up", "up"), ValueError, "a body cannot be attached to itself"),
        (("up", "liver"), ValueError, "no body is named 'liver'"),
        (("up", "low", -1.0), ValueError, "within must be greater than 0, found -1"),
        (("up", "low", np.nan), ValueError, r"attachments\[0\]: within: expected a finite number"),
        (("up", 7), IndexError, "index 7 is out of range"),
    ],
)
def test_bad_attachments(arguments: tuple, error: type[Exception], message: str) -> None:
    box = palpate.read_model("small").bodies[0].mesh
    far = palpate.Mesh(box.nodes + LIFT, box.tetrahedra)
    bodies = [palpate.Body(box, name="low"), palpate.Body(far, name="up")]
    with pytest.raises(error, match=message):
        palpate.Model(bodies, attachments=[palpate.Attachment(*arguments)])
    with pytest.raises(TypeError, match=r"attachments\[0\]: expected a palpate.Attachment"):
        palpate.Model(bodies, attachments=[("up", "low")])  # type: ignore[list-item]
