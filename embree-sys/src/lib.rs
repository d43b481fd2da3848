//! Embree 4 by bindgen, and the one safe wrapper over it.
//!
//! A [`Device`] is Embree itself; a [`SceneBuilder`] takes triangles and turns
//! into a [`Scene`], which can no longer change and may be traced from any
//! number of threads. Rays go through it one by one ([`Scene::intersect1`],
//! [`Scene::occluded1`]) or in packets of 4, 8 or 16 ([`Scene::intersect`],
//! [`Scene::occluded`]); nothing but Embree's own call is on that way, and
//! nothing is checked there outside of debug builds. A thread that traces should
//! hold a [`FlushDenormals`].
//!
//! ```
//! use embree4_sys::{Device, DeviceConfig, Ray, SceneBuilder};
//!
//! let device = Device::new(&DeviceConfig::default())?;
//! let mut builder = SceneBuilder::new(&device);
//! let triangle = builder.attach_triangles(
//!     vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
//!     vec![[0, 1, 2]],
//! )?;
//! let scene = builder.commit()?;
//!
//! let down = Ray::new([0.25, 0.25, 2.0], [0.0, 0.0, -1.0]);
//! let hit = scene.intersect1(&down).expect("it goes through the triangle");
//! assert_eq!(hit.geometry, triangle);
//! assert!((hit.t - 2.0).abs() < 1e-6);
//! # Ok::<(), embree4_sys::Error>(())
//! ```
//!
//! A committed scene has nothing that changes it:
//!
//! ```compile_fail,E0599
//! # use embree4_sys::{Device, DeviceConfig, SceneBuilder};
//! # let device = Device::new(&DeviceConfig::default()).unwrap();
//! let mut scene = SceneBuilder::new(&device).commit().unwrap();
//! scene.attach_triangles(vec![], vec![]); // no such method on `Scene`
//! ```
//!
//! and what was committed is gone as a builder:
//!
//! ```compile_fail,E0382
//! # use embree4_sys::{Device, DeviceConfig, SceneBuilder};
//! # let device = Device::new(&DeviceConfig::default()).unwrap();
//! let mut builder = SceneBuilder::new(&device);
//! let scene = builder.commit().unwrap();
//! builder.attach_triangles(vec![], vec![]); // moved by `commit`
//! ```
#![expect(
    unsafe_code,
    reason = "this crate is the one place where Rust meets Embree's C interface"
)]

mod denormals;
mod device;
mod error;
mod geometry;
mod packet;
pub mod raw;
mod ray;
mod scene;
mod vectors;

pub use denormals::FlushDenormals;
pub use device::{Device, DeviceConfig, Isa, PacketWidth};
pub use error::{Error, ErrorCode};
pub use geometry::{COORDINATE_MAX, GeometryId, TriangleMesh};
pub use packet::{HitPacket, LaneMask, Lanes, PacketSize, RayHitPacket, RayPacket};
pub use ray::{Coherence, Hit, Ray};
pub use scene::{Bounds, BuildQuality, Scene, SceneBuilder};
pub use vectors::{WideKernel, with_wide_vectors};
