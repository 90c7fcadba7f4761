//! Steps that come to nothing: where it shows, and what is to blame.

use std::fmt;

use palpate_geometry::Point;
use palpate_geometry::tetrahedron::signed_volume;

use super::Dynamics;

/// What is told to go farther than so many times the size of its body in a step is to blame.
const FAR: f64 = 3.0;
/// A spring pulled over so many times the size of its body is beyond the numbers of the contact solver.
const BEYOND: f64 = 1e12;
/// A strict step must not leave a tetrahedron turned over to more than the first, or blown up to more than
/// the second of these times its volume at rest, and to more than the third times what it was before.
/// Squeezed flat, tissue turns elements over by less however small the steps, and recovers.
const TURNED_OVER: f64 = 1.0;
const BLOWN_UP: f64 = 10.0;
const AT_ONCE: f64 = 2.0;

/// Why a step failed. The state is that before it.
#[derive(Clone, Debug, PartialEq)]
pub struct Failure {
    /// Index of the body.
    pub body: usize,
    /// The node that is to blame, or else the first one that is lost.
    pub node: usize,
    /// The first tetrahedron of the node; `None` of a rigid body.
    pub tetrahedron: Option<usize>,
    /// What happened there.
    pub cause: Cause,
}

/// What happened where a step failed.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Cause {
    /// A drive moves the node so far in the step [m].
    Driven(f64),
    /// A spring pulls it over this distance [m].
    Pulled(f64),
    /// The external force on it [N] is more than the body can answer.
    Force(f64),
    /// It was so fast before the step [m/s].
    Speed(f64),
    /// The rigid body moves so far in the step [m].
    Tool(f64),
    /// The tetrahedron's volume, in parts of that at rest, before and after the step.
    BlownUp {
        /// Before the step.
        before: f64,
        /// After it.
        after: f64,
    },
    /// None of these: the forces found no balance.
    Unbalanced,
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "node {}", self.node)?;
        if let Some(tetrahedron) = self.tetrahedron {
            write!(f, " (tetrahedron {tetrahedron})")?;
        }
        write!(f, ": {}", self.cause)
    }
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Driven(distance) => {
                write!(f, "its drive moves it by {distance:.3e} m at once; move it step by step")
            }
            Self::Pulled(distance) => {
                write!(f, "a spring pulls it over {distance:.3e} m; bring its target nearer")
            }
            Self::Force(force) => {
                write!(f, "the external force on it is {force:.3e} N; make it smaller")
            }
            Self::Speed(speed) => write!(f, "it moved at {speed:.3e} m/s; make it slower"),
            Self::Tool(distance) => {
                write!(f, "this tool moves by {distance:.3e} m at once; move it step by step")
            }
            Self::BlownUp { before, after } => write!(
                f,
                "it went from {before:.2} to {after:.2} times its volume at rest; take smaller steps"
            ),
            Self::Unbalanced => write!(f, "the forces found no balance; take smaller steps"),
        }
    }
}

impl Dynamics {
    /// What is wrong with the state after the step, if anything.
    pub(super) fn find_failure(&self) -> Option<Failure> {
        let bodies = 0..self.body_count();
        let broken = bodies.clone().find_map(|index| {
            let node = self.body(index).first_broken_node()?;
            Some(self.failure(index, node))
        });
        let blown = || bodies.filter(|_| self.strict).find_map(|index| self.blown_up(index));
        broken.or_else(|| self.pulled_beyond()).or_else(blown)
    }

    fn failure(&self, index: usize, lost: usize) -> Failure {
        let blamed = self.blame(index).map(|(node, cause)| (index, node, cause));
        let blamed = blamed.or_else(|| self.blame_tools(index));
        let (body, node, cause) = blamed.unwrap_or((index, lost, Cause::Unbalanced));
        Failure { body, node, tetrahedron: self.tetrahedron_of(body, node), cause }
    }

    /// The first tetrahedron of a node.
    fn tetrahedron_of(&self, body: usize, node: usize) -> Option<usize> {
        let tetrahedra = self.surfaces[body].mesh().tetrahedra();
        tetrahedra.iter().position(|corners| corners.contains(&(node as u32)))
    }

    /// What a body that is lost was told to do beyond all reason, and at which node.
    fn blame(&self, index: usize) -> Option<(usize, Cause)> {
        let body = self.body(index);
        if body.rigid().is_some() {
            return None;
        }
        let size = self.size(index);
        let far = |&(_, distance): &(usize, f64)| distance > FAR * size;
        let dt = self.options.time_step;
        let driven = self.drives.all().iter().filter(|drive| drive.body as usize == index);
        let driven = driven.flat_map(|drive| drive.nodes.iter().zip(&drive.targets));
        let driven = driven.map(|(&node, target)| {
            (node as usize, self.part * distance(&body.positions[node as usize], target))
        });
        if let Some((node, distance)) = largest(driven).filter(far) {
            return Some((node, Cause::Driven(distance)));
        }
        if let Some((node, distance)) = self.farthest_pull(index).filter(far) {
            return Some((node, Cause::Pulled(distance)));
        }
        // A force that moves the whole body so far, let alone the node.
        let mass: f64 = body.elastic().map_or(0.0, |elastic| elastic.masses().iter().sum());
        let forces = body.forces.iter().map(length).enumerate();
        let forces = forces.map(|(node, force)| (node, dt * dt * force / mass));
        if let Some((node, moved)) = largest(forces).filter(far) {
            return Some((node, Cause::Force(moved * mass / (dt * dt))));
        }
        let speeds = body.velocities.iter().map(|v| dt * length(v)).enumerate();
        let (node, moved) = largest(speeds).filter(far)?;
        Some((node, Cause::Speed(moved / dt)))
    }

    /// The rigid body that moves farthest, if that is far for the body that is lost.
    fn blame_tools(&self, index: usize) -> Option<(usize, usize, Cause)> {
        let rigid = (0..self.body_count()).filter(|&other| self.body(other).rigid().is_some());
        let (tool, distance) = largest(rigid.map(|other| (other, self.farthest_move(other).1)))?;
        let far = distance > FAR * self.size(index);
        far.then(|| (tool, self.farthest_move(tool).0, Cause::Tool(distance)))
    }

    /// The node of a body that moves farthest in the step, and how far [m].
    fn farthest_move(&self, index: usize) -> (usize, f64) {
        let body = self.body(index);
        let pairs = body.positions.iter().zip(&body.expected_positions);
        largest(pairs.map(|(x, end)| distance(x, end)).enumerate()).unwrap_or((0, 0.0))
    }

    /// Length of the diagonal of the box around a body at rest [m].
    fn size(&self, index: usize) -> f64 {
        let bounds = self.surfaces[index].mesh().bounds();
        distance(&bounds.min, &bounds.max)
    }

    /// The node of a body that a spring pulls over the longest distance, and that [m].
    fn farthest_pull(&self, index: usize) -> Option<(usize, f64)> {
        let x = &self.body(index).positions;
        let pulls = self.ties.pulls().iter().filter(|pull| pull.body as usize == index);
        largest(
            pulls.map(|pull| (pull.node as usize, distance(&x[pull.node as usize], &pull.target))),
        )
    }

    fn pulled_beyond(&self) -> Option<Failure> {
        (0..self.body_count()).find_map(|body| {
            let (node, distance) = self.farthest_pull(body)?;
            let (tetrahedron, cause) = (self.tetrahedron_of(body, node), Cause::Pulled(distance));
            let beyond = distance > BEYOND * self.size(body);
            beyond.then_some(Failure { body, node, tetrahedron, cause })
        })
    }

    /// The first tetrahedron of a body that a strict step must not leave like that.
    fn blown_up(&self, index: usize) -> Option<Failure> {
        let body = self.body(index);
        body.elastic()?;
        let mesh = self.surfaces[index].mesh();
        let found = mesh.tetrahedra().iter().enumerate().find_map(|(tetrahedron, corners)| {
            let volume = |x: &[Point]| signed_volume(&corners.map(|node| x[node as usize]));
            let rest = volume(mesh.nodes());
            let after = volume(&body.next_positions) / rest;
            if -TURNED_OVER < after && after < BLOWN_UP {
                return None;
            }
            let before = volume(&body.positions) / rest;
            let growth = if after < 0.0 { -before } else { before };
            let blown = after.abs() > AT_ONCE * growth;
            blown.then_some((tetrahedron, corners[0], Cause::BlownUp { before, after }))
        });
        let (tetrahedron, node, cause) = found?;
        Some(Failure { body: index, node: node as usize, tetrahedron: Some(tetrahedron), cause })
    }
}

/// The largest value and what it belongs to; undefined ones count as infinite.
fn largest(values: impl Iterator<Item = (usize, f64)>) -> Option<(usize, f64)> {
    let defined =
        values.map(|(of, value)| (of, if value.is_nan() { f64::INFINITY } else { value }));
    defined.reduce(|most, each| if each.1 > most.1 { each } else { most })
}

fn distance(a: &Point, b: &Point) -> f64 {
    length(&std::array::from_fn(|k| a[k] - b[k]))
}

/// Without the overflow of squares.
fn length(v: &Point) -> f64 {
    v[0].hypot(v[1]).hypot(v[2])
}
