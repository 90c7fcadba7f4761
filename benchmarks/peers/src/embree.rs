//! Embree's `rtcCollide` over user geometries, one per body: boxes in single precision rounded outward.
//! Embree is a C library, loaded when this program starts; the
//! declarations below are those of `embree4/rtcore.h`.

use std::error::Error;
use std::ffi::{c_char, c_int, c_uint, c_void};

use libloading::Library;

use crate::scene::{Frame, Pair, Scene};

type Handle = *mut c_void;
type BoundsFunction = unsafe extern "C" fn(*const BoundsArguments);
type CollideFunction = unsafe extern "C" fn(*mut c_void, *const Collision, usize);

const GEOMETRY_TYPE_USER: c_int = 120;
const BUILD_QUALITY_MEDIUM: c_int = 1;
const BUILD_QUALITY_REFIT: c_int = 3;
const SCENE_FLAG_DYNAMIC: c_int = 1;

#[repr(C, align(16))]
#[derive(Clone, Copy)]
struct Bounds {
    lower: [f32; 4],
    upper: [f32; 4],
}

#[repr(C)]
struct BoundsArguments {
    user: *mut c_void,
    primitive: c_uint,
    _time_step: c_uint,
    bounds: *mut Bounds,
}

#[repr(C)]
#[derive(Clone, Copy)]
struct Collision {
    geometry_a: c_uint,
    primitive_a: c_uint,
    geometry_b: c_uint,
    primitive_b: c_uint,
}

pub struct Embree {
    functions: Functions,
    scene: Handle,
    geometries: Vec<Handle>,
    /// Boxes of every body, which Embree reads through `bounds_of`; the inner vectors never move.
    boxes: Vec<Vec<Bounds>>,
}

struct Functions {
    commit_geometry: unsafe extern "C" fn(Handle),
    commit_scene: unsafe extern "C" fn(Handle),
    collide: unsafe extern "C" fn(Handle, Handle, CollideFunction, *mut c_void),
    // Keeps the functions above loaded.
    _library: Library,
}

impl Embree {
    pub fn new(scene: &Scene, path: &str) -> Result<Self, Box<dyn Error>> {
        // SAFETY: Embree's initialisers have no requirements, and the types of its functions are those
        // of its header; handles are used while the library, kept in `Functions`, is loaded.
        unsafe {
            let library = Library::new(path)?;
            let new_device: extern "C" fn(*const c_char) -> Handle =
                *library.get(b"rtcNewDevice\0")?;
            let new_scene: extern "C" fn(Handle) -> Handle = *library.get(b"rtcNewScene\0")?;
            let set_flags: extern "C" fn(Handle, c_int) = *library.get(b"rtcSetSceneFlags\0")?;
            let set_scene_quality: extern "C" fn(Handle, c_int) =
                *library.get(b"rtcSetSceneBuildQuality\0")?;
            let new_geometry: extern "C" fn(Handle, c_int) -> Handle =
                *library.get(b"rtcNewGeometry\0")?;
            let set_count: extern "C" fn(Handle, c_uint) =
                *library.get(b"rtcSetGeometryUserPrimitiveCount\0")?;
            let set_bounds: extern "C" fn(Handle, BoundsFunction, *mut c_void) =
                *library.get(b"rtcSetGeometryBoundsFunction\0")?;
            let set_user: extern "C" fn(Handle, *mut c_void) =
                *library.get(b"rtcSetGeometryUserData\0")?;
            let set_quality: extern "C" fn(Handle, c_int) =
                *library.get(b"rtcSetGeometryBuildQuality\0")?;
            let attach: extern "C" fn(Handle, Handle) -> c_uint =
                *library.get(b"rtcAttachGeometry\0")?;
            let functions = Functions {
                commit_geometry: *library.get(b"rtcCommitGeometry\0")?,
                commit_scene: *library.get(b"rtcCommitScene\0")?,
                collide: *library.get(b"rtcCollide\0")?,
                _library: library,
            };
            let device = new_device(c"threads=1".as_ptr());
            if device.is_null() {
                return Err("Embree made no device".into());
            }
            let handle = new_scene(device);
            set_flags(handle, SCENE_FLAG_DYNAMIC);
            set_scene_quality(handle, BUILD_QUALITY_MEDIUM);
            let mut boxes: Vec<Vec<Bounds>> = (0..scene.triangles.len())
                .map(|body| boxes(scene, &scene.frames[0], body as u32, 0.0).collect())
                .collect();
            let mut geometries = Vec::new();
            for (body, boxes) in boxes.iter_mut().enumerate() {
                let geometry = new_geometry(device, GEOMETRY_TYPE_USER);
                set_count(geometry, boxes.len() as c_uint);
                set_user(geometry, boxes.as_mut_ptr().cast());
                set_bounds(geometry, bounds_of, std::ptr::null_mut());
                set_quality(geometry, BUILD_QUALITY_REFIT);
                (functions.commit_geometry)(geometry);
                if attach(handle, geometry) as usize != body {
                    return Err("Embree numbers geometries otherwise than bodies".into());
                }
                geometries.push(geometry);
            }
            (functions.commit_scene)(handle);
            Ok(Self { functions, scene: handle, geometries, boxes })
        }
    }
}

impl Embree {
    pub fn update(&mut self, scene: &Scene, frame: &Frame, margin: f64) {
        for (body, kept) in self.boxes.iter_mut().enumerate() {
            for (kept, new) in kept.iter_mut().zip(boxes(scene, frame, body as u32, margin)) {
                *kept = new;
            }
        }
        // SAFETY: the handles are those that `new` made; `boxes` are complete and do not change here.
        unsafe {
            for &geometry in &self.geometries {
                (self.functions.commit_geometry)(geometry);
            }
            (self.functions.commit_scene)(self.scene);
        }
    }

    pub fn candidates<F: FnMut(Pair)>(&mut self, mut visit: F) {
        let user = (&raw mut visit).cast();
        // SAFETY: `visit` outlives the call, and the device has one thread, so that `collect` is the
        // only user of it meanwhile.
        unsafe {
            (self.functions.collide)(self.scene, self.scene, collect::<F>, user);
        }
    }
}

/// SAFETY: called by Embree with the boxes given in `new` and a primitive below their number.
unsafe extern "C" fn bounds_of(arguments: *const BoundsArguments) {
    unsafe {
        let arguments = &*arguments;
        *arguments.bounds = *arguments.user.cast::<Bounds>().add(arguments.primitive as usize);
    }
}

/// SAFETY: called by Embree with the closure given in `candidates` and `count` collisions.
unsafe extern "C" fn collect<F: FnMut(Pair)>(
    user: *mut c_void,
    collisions: *const Collision,
    count: usize,
) {
    let (visit, collisions) =
        unsafe { (&mut *user.cast::<F>(), std::slice::from_raw_parts(collisions, count)) };
    for each in collisions {
        let pair = [each.geometry_a, each.primitive_a, each.geometry_b, each.primitive_b];
        // The scene against itself gives every pair twice.
        if pair[..2] < pair[2..] {
            visit(pair);
        }
    }
}

fn boxes(scene: &Scene, frame: &Frame, body: u32, margin: f64) -> impl Iterator<Item = Bounds> {
    (0..scene.triangles[body as usize].len() as u32).map(move |triangle| {
        let [min, max] = scene.bounds(frame, body, triangle);
        let below = |value: f64| {
            let near = value as f32;
            if f64::from(near) > value { near.next_down() } else { near }
        };
        let lower = min.map(|value| below(value - margin));
        let upper = max.map(|value| -below(-value - margin));
        let padded = |[x, y, z]: [f32; 3]| [x, y, z, 0.0];
        Bounds { lower: padded(lower), upper: padded(upper) }
    })
}
