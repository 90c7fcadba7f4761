//! Runs one stage of detection a number of times, for a tool that counts instructions:
//! `stage_count STAGE TIMES`; prints the number of surface triangles.

mod bodies;

use std::io::Write;
use std::sync::Arc;

use palpate_contact::{IntersectionOptions, Scene, SceneOptions};
use palpate_geometry::Point;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [stage, times] = arguments.as_slice() else {
        return Err("usage: stage_count refit|intersections|proximity|pack TIMES".into());
    };
    let meshes = bodies::four();
    let distance = bodies::proximity_distance(&meshes);
    let positions: Vec<&[Point]> = meshes.iter().map(|mesh| mesh.nodes()).collect();
    let mut scene = Scene::new(meshes.clone(), None, SceneOptions::default())?;
    for _ in 0..times.parse::<usize>()? {
        match stage.as_str() {
            "refit" => drop(scene.update(&positions)?),
            "intersections" => drop(scene.intersections(&IntersectionOptions::default()).stats),
            "proximity" => drop(scene.proximity(&|_, _| Some(distance)).stats),
            "pack" => drop(scene.replace(3, Arc::clone(&meshes[3]))?),
            other => return Err(format!("no stage is called {other}").into()),
        }
    }
    let triangles: usize = meshes.iter().map(|mesh| mesh.triangles().len()).sum();
    writeln!(std::io::stdout(), "{triangles}")?;
    Ok(())
}
