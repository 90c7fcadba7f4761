//! One measurement per stage of detection, on bent bars or the organs of `PALPATE_DATA`.
//!
//! `cargo bench -p palpate-contact`

#[path = "../examples/bodies/mod.rs"]
mod bodies;

use std::sync::Arc;
use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use palpate_contact::{DetectionStats, IntersectionOptions, Scene, SceneOptions};
use palpate_geometry::Point;
use palpate_model::Mesh;

fn as_slices(meshes: &[Arc<Mesh>]) -> Vec<&[Point]> {
    meshes.iter().map(|mesh| mesh.nodes()).collect()
}

/// The sum of one stage's time over some calls.
fn stage(
    calls: u64,
    mut call: impl FnMut() -> DetectionStats,
    time: impl Fn(&DetectionStats) -> Duration,
) -> Duration {
    (0..calls).map(|_| time(&call())).sum()
}

fn stages(criterion: &mut Criterion) {
    let meshes = bodies::four();
    let positions = as_slices(&meshes);
    let distance = bodies::proximity_distance(&meshes);
    let mut scene = Scene::new(meshes.clone(), None, SceneOptions::default()).expect("four bodies");
    let mut group = criterion.benchmark_group("wide");
    group.sample_size(30).measurement_time(Duration::from_secs(2));
    group.bench_function("refit", |bencher| {
        bencher.iter(|| scene.update(&positions).expect("as many positions as nodes"));
    });
    let mut meet = || scene.intersections(&IntersectionOptions::default()).stats;
    group.bench_function("intersections: traversal", |bencher| {
        bencher.iter_custom(|calls| stage(calls, &mut meet, |stats| stats.traversal_time));
    });
    group.bench_function("intersections: triangles", |bencher| {
        bencher.iter_custom(|calls| stage(calls, &mut meet, |stats| stats.polygon_time));
    });
    let mut close = || scene.proximity(&|_, _| Some(distance)).stats;
    group.bench_function("proximity: traversal", |bencher| {
        bencher.iter_custom(|calls| stage(calls, &mut close, |stats| stats.traversal_time));
    });
    group.bench_function("proximity: features", |bencher| {
        bencher.iter_custom(|calls| stage(calls, &mut close, |stats| stats.polygon_time));
    });
    group.bench_function("pack, with the bounding tree", |bencher| {
        bencher.iter(|| scene.replace(3, Arc::clone(&meshes[3])).expect("a fourth body"));
    });
    group.finish();
}

criterion_group!(benches, stages);
criterion_main!(benches);
