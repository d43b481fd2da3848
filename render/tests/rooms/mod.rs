//! Small scenes made in code, and the whole way from a scene to a picture.

#![expect(
    clippy::unwrap_used,
    reason = "a test may stop where its scene cannot be made"
)]

use std::sync::Arc;

use glam::{Vec2, Vec3};
use render::{
    buffer::FrameBuffers,
    frame::FrameRenderer,
    gbuffer::trace_aovs,
    image::Picture,
    intersect::TracedScene,
    pixel_group::PixelGroups,
    reconstruct::{Reconstruction, assemble},
    scene::{CameraPose, Emitter, EmitterShape, ImageSize, Material, Scene, TriangleMesh},
    settings::{Algorithm, Settings},
    task::{Component, Task},
    vpl::trace_sets,
};

/// Puts parallelograms together to a scene.
pub(crate) struct Room {
    scene: Scene,
}

impl Room {
    /// An empty scene with this camera.
    pub(crate) fn new(eye: Vec3, look_at: Vec3, vertical_fov_degrees: f32) -> Self {
        let up = if (look_at - eye).normalize().dot(Vec3::Y).abs() > 0.9 {
            Vec3::Z
        } else {
            Vec3::Y
        };
        let scene = Scene {
            camera: CameraPose {
                eye,
                look_at,
                up,
                vertical_fov_degrees,
            },
            image: ImageSize {
                width: 64,
                height: 64,
            },
            mesh: TriangleMesh::default(),
            materials: Vec::new(),
            textures: Vec::new(),
            emitters: Vec::new(),
        };
        Self { scene }
    }

    /// Adds a parallelogram whose front, and light, is on the side of `edge_u × edge_v`.
    pub(crate) fn quad(mut self, corner: Vec3, edge_u: Vec3, edge_v: Vec3, kd: Vec3, emission: Vec3) -> Self {
        let mesh = &mut self.scene.mesh;
        let first = mesh.positions.len() as u32;
        mesh.positions
            .extend([corner, corner + edge_u, corner + edge_u + edge_v, corner + edge_v]);
        mesh.normals.extend([Vec3::ZERO; 4]);
        mesh.uvs.extend([Vec2::ZERO; 4]);
        mesh.triangles
            .extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        mesh.material_of.extend([self.scene.materials.len() as u32; 2]);
        self.scene.materials.push(Material {
            name: "quad".into(),
            kd,
            kd_map: None,
            emission,
        });
        if emission != Vec3::ZERO {
            let shape = EmitterShape::Parallelogram;
            self.scene.emitters.push(Emitter {
                shape,
                corner,
                edge_u,
                edge_v,
                radiance: emission,
            });
        }
        self
    }

    /// Adds the unit cube, seen from inside, with the same surface everywhere.
    pub(crate) fn cube(self, kd: Vec3, emission: Vec3) -> Self {
        let (x, y, z) = (Vec3::X, Vec3::Y, Vec3::Z);
        self.quad(Vec3::ZERO, x, y, kd, emission)
            .quad(Vec3::ZERO, y, z, kd, emission)
            .quad(Vec3::ZERO, z, x, kd, emission)
            .quad(Vec3::ONE, -y, -x, kd, emission)
            .quad(Vec3::ONE, -z, -y, kd, emission)
            .quad(Vec3::ONE, -x, -z, kd, emission)
    }

    pub(crate) fn build(self) -> Arc<TracedScene> {
        Arc::new(TracedScene::build(self.scene).unwrap())
    }
}

/// A white room with a lamp under its ceiling and a shelf that throws a shadow.
pub(crate) fn room_with_lamp() -> Arc<TracedScene> {
    let kd = Vec3::new(0.7, 0.5, 0.3);
    Room::new(Vec3::new(0.5, 0.5, 0.05), Vec3::new(0.5, 0.45, 1.0), 70.0)
        .cube(kd, Vec3::ZERO)
        .quad(
            Vec3::new(0.4, 0.98, 0.6),
            0.2 * Vec3::X,
            0.2 * Vec3::Z,
            Vec3::ZERO,
            Vec3::splat(20.0),
        )
        .quad(
            Vec3::new(0.3, 0.4, 0.6),
            0.4 * Vec3::X,
            0.3 * Vec3::Z,
            kd,
            Vec3::ZERO,
        )
        .build()
}

/// All tasks of a frame, in no particular order.
pub(crate) fn all_tasks(settings: &Settings) -> Vec<Task> {
    let tasks = |component, count| {
        (0..count).flat_map(move |index| {
            (0..settings.groups).map(move |group| Task {
                component,
                group,
                index,
                passes: 1,
            })
        })
    };
    match settings.algorithm {
        Algorithm::Straightforward => tasks(Component::Full, 1).collect(),
        Algorithm::Progressive => tasks(Component::Direct, settings.spp)
            .chain(tasks(Component::Indirect, settings.spp))
            .collect(),
        Algorithm::Component => tasks(Component::Direct, settings.spp)
            .chain(tasks(Component::Indirect, settings.vpl_sets))
            .collect(),
    }
}

/// Renders some tasks of a frame and makes the picture.
pub(crate) fn picture_of(scene: &Arc<TracedScene>, settings: &Settings, tasks: &[Task]) -> Picture {
    let renderer = FrameRenderer::new(scene.clone(), *settings, trace_sets(scene, settings)).unwrap();
    let mut buffers = FrameBuffers::new(settings, Arc::new(PixelGroups::new(settings)));
    for &task in tasks {
        buffers
            .add(task, &renderer.render(task, &mut |left| left).radiance)
            .unwrap();
    }
    assemble(
        &mut buffers,
        &Arc::new(trace_aovs(scene, settings.size)),
        Reconstruction::Nearest,
        25.0,
    )
}

/// Renders the whole workload.
pub(crate) fn picture(scene: &Arc<TracedScene>, settings: &Settings) -> Picture {
    picture_of(scene, settings, &all_tasks(settings))
}

/// The mean over all pixels.
pub(crate) fn mean(pixels: &[Vec3]) -> Vec3 {
    pixels.iter().sum::<Vec3>() / pixels.len() as f32
}
