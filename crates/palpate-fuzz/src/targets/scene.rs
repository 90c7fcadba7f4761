//! Calls of the detection, interleaved, by every method: each answer is that of the double loop, and a
//! refused call changes nothing.

use std::path::Path;
use std::sync::Arc;

use palpate::contact::{
    IntersectionOptions, Intersections, Method, ProximityOptions, Scene, SceneOptions,
};
use palpate::cutting::{Blade, BladeError, CutOptions};
use palpate::geometry::{Point, vec3};
use palpate::{Mesh, MeshData, SceneCuts};

use super::shapes::{box_of, plate};
use super::{Target, ensure};
use crate::choices::Choices;
use crate::shown::Shown;

/// Calls of [`Scene`].
pub(crate) struct SceneCalls;

/// More tetrahedra than this in a body are not cut again.
const LARGE: usize = 120;

impl Target for SceneCalls {
    fn name(&self) -> &'static str {
        "scene"
    }

    fn seeds(&self) -> Vec<Vec<u8>> {
        let mut random = palpate_testing::Random(0);
        (0..20).map(|_| (0..400).map(|_| random.bits() as u8).collect()).collect()
    }

    /// Each of the methods keeps the longest of its lists: where everything is near, all pairs of a cut scene.
    fn warranted_memory(&self, _input: usize) -> usize {
        128 * 1024 * 1024
    }

    fn try_input(&self, input: &[u8], _scratch: &Path) -> Result<String, String> {
        let mut choices = Choices::new(input);
        let meshes: Vec<_> = (0..=choices.below(4)).map(|_| Arc::new(mesh(&mut choices))).collect();
        let mut scenes = Scenes::new(&meshes, &mut choices)?;
        let mut outcome = format!("{} bodies", meshes.len());
        for _ in 0..12 {
            if choices.is_empty() {
                break;
            }
            outcome += &scenes.call(&mut choices)?;
        }
        scenes.compare(&mut choices)?;
        Ok(outcome)
    }
}

/// One of several kinds of mesh, often degenerate; never none.
pub(crate) fn mesh(choices: &mut Choices) -> Mesh {
    let origin = choices.small_point();
    let base = match choices.below(6) {
        0 => box_of([1, 1, 1], 0.5, origin),
        1 => box_of([2, 1, 2], 0.25, origin),
        2 => box_of([3, 2, 2], 0.25, origin),
        3 => plate(0.5, origin[2]),
        kind => {
            let nodes: Vec<Point> = (0..4 + choices.below(8)).map(|_| choices.point()).collect();
            let count = nodes.len();
            let mut node = || choices.below(count) as u32;
            let data = if kind == 4 {
                let tetrahedra = (0..6).map(|_| std::array::from_fn(|_| node())).collect();
                MeshData { nodes, tetrahedra, ..MeshData::default() }
            } else {
                let triangles = (0..8).map(|_| std::array::from_fn(|_| node())).collect();
                MeshData { nodes, triangles, ..MeshData::default() }
            };
            let repaired = Mesh::repaired(data.clone());
            repaired.map_or_else(|_| box_of([1, 1, 1], 1.0, origin), |(mesh, _)| mesh)
        }
    };
    let nodes = moved(base.nodes(), choices);
    base.with_nodes(nodes).unwrap_or(base)
}

/// Other places for nodes: shifted, crumpled, flattened, scaled, or with a number at an edge.
pub(crate) fn moved(nodes: &[Point], choices: &mut Choices) -> Vec<Point> {
    let mut nodes = nodes.to_vec();
    let each = |nodes: &mut Vec<Point>, change: &mut dyn FnMut(&mut Point)| {
        nodes.iter_mut().for_each(change);
    };
    match choices.below(10) {
        0 => {}
        1 => {
            let shift = choices.point();
            each(&mut nodes, &mut |p| (0..3).for_each(|axis| p[axis] += shift[axis]));
        }
        2 => each(&mut nodes, &mut |p| *p = choices.small_point()),
        3 => {
            let axis = choices.below(3);
            let height = choices.small();
            each(&mut nodes, &mut |p| p[axis] = height);
        }
        4 => {
            let factor = choices.number();
            each(&mut nodes, &mut |p| *p = p.map(|x| x * factor));
        }
        5 => {
            let node = choices.below(nodes.len());
            nodes[node] = choices.point();
        }
        6 => {
            let (from, to) = (choices.below(nodes.len()), choices.below(nodes.len()));
            nodes[to] = nodes[from];
        }
        7 => {
            let factor = 10_f64.powi(choices.below(256) as i32 - 128);
            each(&mut nodes, &mut |p| *p = p.map(|x| x * factor));
        }
        8 => {
            let far = 10_f64.powi(choices.below(20) as i32);
            each(&mut nodes, &mut |p| p[0] += far);
        }
        _ => each(&mut nodes, &mut |p| {
            for x in p {
                *x += choices.small() / 8.0;
            }
        }),
    }
    nodes
}

/// The same scene by every method; the double loop first.
struct Scenes {
    by_method: Vec<Scene>,
    cuts: SceneCuts,
    /// The last blade.
    last: Option<Blade>,
}

impl Scenes {
    fn new(meshes: &[Arc<Mesh>], choices: &mut Choices) -> Result<Self, String> {
        let leaf_size = 1 + choices.below(12);
        let split = if choices.flag() {
            palpate::contact::Split::Middle
        } else {
            palpate::contact::Split::Count
        };
        let threads = if choices.below(16) == 0 { 3 } else { 1 };
        let methods = [Method::AllPairs, Method::Paper, Method::Hash, Method::Wide];
        let make = |method| {
            let options = SceneOptions { leaf_size, split, method, threads };
            Scene::new(meshes.to_vec(), None, options).map_err(|error| error.to_string())
        };
        let by_method = methods.into_iter().map(make).collect::<Result<_, _>>()?;
        Ok(Self { by_method, cuts: SceneCuts::default(), last: None })
    }

    /// The same call of each; its answers must be the same.
    fn all<T: PartialEq + std::fmt::Debug>(
        &mut self,
        what: &str,
        mut call: impl FnMut(&mut Scene) -> T,
    ) -> Result<T, String> {
        let mut answers =
            self.by_method.iter_mut().map(|scene| (scene.options().method, call(scene)));
        let (_, expected) = answers.next().ok_or("no scene")?;
        for (method, answer) in answers {
            ensure(answer == expected, || {
                format!("{what} by {method:?}: {answer:?}, by the double loop {expected:?}")
            })?;
        }
        Ok(expected)
    }

    fn call(&mut self, choices: &mut Choices) -> Result<String, String> {
        let count = self.by_method[0].body_count();
        let body = choices.below(count + 1);
        match choices.below(14) {
            0..=3 => {
                let scene = &self.by_method[0];
                let mut positions: Vec<Vec<Point>> =
                    (0..count).map(|body| scene.mesh(body).nodes().to_vec()).collect();
                for of_body in &mut positions {
                    *of_body = moved(of_body, choices);
                }
                if choices.below(32) == 0 {
                    positions[body % count].pop();
                }
                let slices: Vec<&[Point]> = positions.iter().map(Vec::as_slice).collect();
                let before: Vec<Vec<Point>> =
                    (0..count).map(|body| scene.positions(body).to_vec()).collect();
                let done = self.all("update", |scene| {
                    scene.update(&slices).map(drop).map_err(|error| error.to_string())
                });
                // Errors with NaN are compared as text, as NaN is not equal to itself.
                let done = done?;
                for scene in &self.by_method {
                    let expected = if done.is_ok() { &positions } else { &before };
                    for (body, expected) in expected.iter().enumerate() {
                        ensure(scene.positions(body) == expected.as_slice(), || {
                            format!("update, {done:?}: body {body} is elsewhere")
                        })?;
                    }
                }
                if done.is_ok() {
                    self.compare(choices)?;
                }
                Ok(done.err().unwrap_or(" update".into()))
            }
            4 => {
                let new = Arc::new(mesh(choices));
                self.all("add", |scene| scene.add(Arc::clone(&new)))?;
                Ok(" add".into())
            }
            5 => {
                if count == 1 {
                    return Ok(String::new());
                }
                let removed = self.all("remove", |scene| {
                    scene.remove(body).map(drop).map_err(|error| error.to_string())
                })?;
                Ok(removed.err().unwrap_or(" remove".into()))
            }
            6 => {
                let new = Arc::new(mesh(choices));
                let replaced = self.all("replace", |scene| {
                    scene.replace(body, Arc::clone(&new)).map(drop).map_err(|e| e.to_string())
                })?;
                Ok(replaced.err().unwrap_or(" replace".into()))
            }
            7 => {
                let (other, ignored) = (choices.below(count + 1), choices.flag());
                let done = self.all("ignore", |scene| {
                    scene.ignore(body, other, ignored).map_err(|error| error.to_string())
                })?;
                Ok(done.err().unwrap_or(" ignore".into()))
            }
            8 => {
                let triangles =
                    if body < count { self.by_method[0].mesh(body).triangles().len() } else { 2 };
                let groups: Vec<u32> = (0..triangles).map(|_| choices.below(4) as u32).collect();
                let done = self.all("set_groups", |scene| {
                    scene.set_groups(body, &groups).map_err(|error| error.to_string())
                })?;
                Ok(done.err().unwrap_or(" groups".into()))
            }
            _ => self.cut(body.min(count - 1), choices),
        }
    }

    fn cut(&mut self, body: usize, choices: &mut Choices) -> Result<String, String> {
        if self.by_method[0].mesh(body).tetrahedra().len() > LARGE {
            return Ok(String::new());
        }
        let blade = match self.blade(body, choices) {
            Ok(blade) => blade,
            Err(error) => return Ok(error.to_string()),
        };
        self.last = Some(blade.clone());
        let [first, others @ ..] = &mut self.by_method[..] else {
            return Err("no scene".into());
        };
        let done = match self.cuts.cut(first, &[body], &blade, &CutOptions::default()) {
            Ok(done) => done,
            Err(error) => return Ok(error.to_string()),
        };
        let Some((_, done)) = done.first() else {
            return Ok(" missed".into());
        };
        Mesh::new(done.change.mesh.as_ref().clone().into_data())
            .map_err(|error| format!("a cut mesh is none: {error}"))?;
        for scene in others {
            scene.change_body(body, &done.change).map_err(|error| error.to_string())?;
        }
        for scene in &self.by_method {
            let valid = scene.tree(body).validate(scene.mesh(body), scene.positions(body));
            valid.map_err(|error| format!("the tree after a cut: {error:?}"))?;
        }
        self.compare(choices)?;
        Ok(" cut".into())
    }

    /// A blade: anywhere, exactly through nodes, along a triangle of the surface, from edge to edge, or
    /// where the last one was.
    fn blade(&self, body: usize, choices: &mut Choices) -> Result<Blade, BladeError> {
        let scene = &self.by_method[0];
        let positions = scene.positions(body);
        let mut node = || positions[choices.below(positions.len())];
        let [a, b, c] = [node(), node(), node()];
        match (choices.below(6), &self.last) {
            (0, Some(last)) => Ok(last.clone()),
            (1 | 2, _) => {
                let normal = vec3::cross(vec3::sub(b, a), vec3::sub(c, a));
                Blade::plane(a, normal, choices.flag().then(|| choices.number()))
            }
            (3, _) => {
                let triangles = scene.mesh(body).triangles();
                let triangle = triangles[choices.below(triangles.len())];
                let points = triangle.map(|node| positions[node as usize]);
                Blade::new(&points, &[[0, 1, 2]])
            }
            (4, _) => {
                let shift = choices.small_point();
                let moved = |p: Point| vec3::add(p, shift);
                Blade::stroke(&[[a, b], [moved(a), moved(b)], [moved(moved(a)), c]])
            }
            _ => {
                let (point, normal) = (choices.point(), choices.point());
                Blade::plane(point, normal, choices.flag().then(|| choices.number()))
            }
        }
    }

    /// Every query, by every method.
    fn compare(&mut self, choices: &mut Choices) -> Result<(), String> {
        let options = IntersectionOptions {
            self_contact: choices.below(4) > 0,
            same_leaf: true,
            shared_nodes: choices.below(4) == 0,
        };
        let pairs = |found: &Intersections| found.pairs.clone();
        self.all("intersections", |scene| pairs(scene.intersections(&options)))?;
        self.all("contact nodes", |scene| scene.contact_nodes(&options).nodes.clone())?;
        let near =
            ProximityOptions { close_at_rest: choices.below(4) > 0, local_minima: choices.flag() };
        let distance = choices.number();
        let self_contact = choices.flag();
        // Answers hold floats that may be NaN where coordinates are huge.
        self.all("proximity", |scene| {
            let distance = |a: usize, b: usize| (self_contact || a != b).then_some(distance);
            Shown::new(&scene.proximity_with(&distance, &near).pairs)
        })?;
        self.all("penetration", |scene| {
            Shown::new(&scene.penetration(&|a, b| self_contact || a != b).nodes)
        })?;
        let points = [choices.point(), choices.small_point(), choices.small_point()];
        let directions = [choices.point(), choices.small_point(), choices.small_point()];
        let reach = choices.number();
        self.all("closest", |scene| Shown::new(&scene.closest(&points, None, reach)))?;
        self.all("contains", |scene| Shown::new(&scene.contains(&points, None)))?;
        self.all("cast", |scene| Shown::new(&scene.cast(&points, &directions, None, reach)))?;
        Ok(())
    }
}
