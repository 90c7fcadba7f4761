//! The scene and its motion, as `palpate bench peers` writes them.

use std::fs::File;
use std::io::{self, BufReader, Read};

pub type Point = [f64; 3];
pub type Triangle = [u32; 3];
/// Body and triangle of both sides.
pub type Pair = [u32; 4];
/// Positions of every body.
pub type Frame = Vec<Vec<Point>>;

/// Surface triangles of every body and the frames of the motion; the first is where trees are built.
pub struct Scene {
    pub triangles: Vec<Vec<Triangle>>,
    pub frames: Vec<Frame>,
}

impl Scene {
    /// Little-endian u32: bodies, frames; per body nodes and triangles; then the triangles of every
    /// body (u32), then frame by frame the positions of every body (f64).
    pub fn read(path: &str) -> io::Result<Self> {
        let mut file = BufReader::new(File::open(path)?);
        let [bodies, frames] = [word(&mut file)?, word(&mut file)?];
        let mut counts = Vec::new();
        for _ in 0..bodies {
            counts.push([word(&mut file)?, word(&mut file)?]);
        }
        let mut triangles = Vec::new();
        for &[_, count] in &counts {
            triangles.push((0..count).map(|_| triple(&mut file)).collect::<io::Result<_>>()?);
        }
        let mut read_frame = |_| {
            let points = |&[count, _]: &[u32; 2]| (0..count).map(|_| point(&mut file)).collect();
            counts.iter().map(points).collect::<io::Result<Frame>>()
        };
        let frames = (0..frames).map(&mut read_frame).collect::<io::Result<_>>()?;
        Ok(Self { triangles, frames })
    }

    pub fn corners(&self, frame: &Frame, body: u32, triangle: u32) -> [Point; 3] {
        let nodes = self.triangles[body as usize][triangle as usize];
        nodes.map(|node| frame[body as usize][node as usize])
    }

    /// Lower and upper corner of a triangle's box.
    pub fn bounds(&self, frame: &Frame, body: u32, triangle: u32) -> [Point; 2] {
        let [a, b, c] = self.corners(frame, body, triangle);
        let each = |of: fn(f64, f64) -> f64| std::array::from_fn(|i| of(of(a[i], b[i]), c[i]));
        [each(f64::min), each(f64::max)]
    }

    /// Whether two triangles of one body share a node.
    pub fn are_neighbours(&self, [body_a, a, body_b, b]: Pair) -> bool {
        let nodes = |triangle: u32| &self.triangles[body_a as usize][triangle as usize];
        body_a == body_b && nodes(a).iter().any(|node| nodes(b).contains(node))
    }
}

fn word(file: &mut impl Read) -> io::Result<u32> {
    let mut bytes = [0; 4];
    file.read_exact(&mut bytes)?;
    Ok(u32::from_le_bytes(bytes))
}

fn triple(file: &mut impl Read) -> io::Result<Triangle> {
    Ok([word(file)?, word(file)?, word(file)?])
}

fn point(file: &mut impl Read) -> io::Result<Point> {
    let mut bytes = [0; 24];
    file.read_exact(&mut bytes)?;
    let coordinate =
        |i: usize| f64::from_le_bytes(bytes[8 * i..8 * i + 8].try_into().expect("eight"));
    Ok([coordinate(0), coordinate(1), coordinate(2)])
}
