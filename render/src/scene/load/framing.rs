//! A camera, and a light, for a mesh that comes with none.
//!
//! A thing is looked at from outside, with a light above it and in front. A room is looked at from
//! inside (or through its open side), with a light below the ceiling. What is a room is told by a look
//! around from the middle of the bounding box: nearly all of it must be closed, by surfaces that turn
//! their front to the middle, or with a light that shines there.

use std::f32::consts::PI;
use std::fmt;

use glam::Vec3;

use super::assemble::has_area;
use super::description::FOV_DEFAULT;
use crate::scene::{CameraPose, Emitter, EmitterShape, ImageSize, TriangleMesh};

/// The camera and the light that were chosen from the bounding box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Framing {
    /// The camera.
    pub camera: CameraPose,
    /// A quad light near the top; `None` where something emits by itself.
    pub light: Option<Emitter>,
}

/// Irradiance in W·m⁻² that the light makes in the middle of what it lights: white paper there has a
/// radiance of 0.4 to 0.5, without what comes from the walls.
const IRRADIANCE: f32 = 1.4;
/// The part of the picture's width or height that the bounding box may fill.
const FILLED: f32 = 0.9;

impl Framing {
    /// Chooses a camera, and a light if there are no `emitters`.
    pub(super) fn of(mesh: &TriangleMesh, emitters: &[Emitter], image: ImageSize) -> Self {
        let (min, max) = mesh.bounds().unwrap_or_default();
        let surroundings = Surroundings {
            mesh,
            centre: 0.5 * (min + max),
            half: 0.5 * (max - min),
            aspect: image.width as f32 / image.height as f32,
        };
        let is_room = surroundings.is_room(emitters);
        let outside = || surroundings.camera_outside(surroundings.direction_outside());
        let in_room = is_room.then(|| surroundings.camera_in_room()).flatten();
        let camera = in_room.unwrap_or_else(outside);
        let light = emitters.is_empty().then(|| {
            let below_ceiling = is_room.then(|| surroundings.light_below_ceiling());
            let lights = |light: &Emitter| has_area(light.edge_u, light.edge_v);
            let below_ceiling = below_ceiling.filter(lights);
            below_ceiling.unwrap_or_else(|| surroundings.light_outside())
        });
        Self { camera, light }
    }
}

/// The bounding box and what is in it.
struct Surroundings<'a> {
    mesh: &'a TriangleMesh,
    centre: Vec3,
    /// Half the diagonal.
    half: Vec3,
    /// Width of the picture over its height.
    aspect: f32,
}

impl Surroundings<'_> {
    fn is_room(&self, emitters: &[Emitter]) -> bool {
        const DIRECTIONS: usize = 64;
        let directions: Vec<Vec3> = (0..DIRECTIONS).map(|index| spiral(index, DIRECTIONS)).collect();
        let hits = first_hits(self.mesh, self.centre, &directions);
        let closed = hits.iter().flatten().count();
        let front = hits.iter().flatten().filter(|hit| hit.is_front).count();
        4 * closed > 3 * DIRECTIONS && (5 * front > 3 * closed || self.is_lit_at_centre(emitters))
    }

    /// Whether one of some emitters, spread over all of them, shines on the centre unhindered.
    fn is_lit_at_centre(&self, emitters: &[Emitter]) -> bool {
        const TESTED_MAX: usize = 16;
        let towards: Vec<Vec3> = emitters
            .iter()
            .step_by(emitters.len().div_ceil(TESTED_MAX).max(1))
            .map(|emitter| (emitter.point(0.5, 0.5) - self.centre, emitter.normal()))
            .filter(|(towards, normal)| towards.dot(*normal) < 0.0)
            .map(|(towards, _)| towards)
            .collect();
        let hits = first_hits(self.mesh, self.centre, &towards);
        hits.iter()
            .flatten()
            .any(|hit| hit.distance > 0.99 && hit.distance < 1.01)
    }

    /// From the open side where there is one, else from near the end of the longest free view;
    /// `None` when that is no view at all.
    fn camera_in_room(&self) -> Option<CameraPose> {
        let (floor, ceiling) = self.floor_and_ceiling();
        let height = floor + 0.45 * (ceiling - floor);
        let middle = self.centre.with_y(height);
        let sides = [Vec3::Z, Vec3::X, Vec3::NEG_Z, Vec3::NEG_X];
        let hits = first_hits(self.mesh, middle, &sides);
        let mut longest = (Vec3::Z, 0.0);
        for (side, hit) in sides.into_iter().zip(hits) {
            let Some(hit) = hit else {
                return Some(self.camera_outside(side));
            };
            if hit.distance > longest.1 {
                longest = (side, hit.distance);
            }
        }
        let (side, distance) = longest;
        (distance > self.distance_min()).then_some(CameraPose {
            eye: middle + 0.9 * distance * side,
            look_at: middle,
            up: Vec3::Y,
            vertical_fov_degrees: FOV_DEFAULT,
        })
    }

    /// From the front, and from above so far as the thing is flat.
    fn direction_outside(&self) -> Vec3 {
        let width = self.half.x.max(self.half.z);
        let flatness = (0.5 - self.half.y / width.max(self.half.y)).max(0.0);
        Vec3::new(0.0, flatness, 1.0).normalize()
    }

    /// Sees the whole bounding box, from the given side.
    fn camera_outside(&self, side: Vec3) -> CameraPose {
        let tangent = (0.5 * FOV_DEFAULT).to_radians().tan() * FILLED;
        let right = Vec3::Y.cross(side).normalize();
        let up = side.cross(right);
        let mut distance = self.distance_min();
        for corner in 0..8u8 {
            let sign = |bit: u8| if corner & bit == 0 { 1.0 } else { -1.0 };
            let corner = self.half * Vec3::new(sign(1), sign(2), sign(4));
            let across = corner.dot(right).abs() / (tangent * self.aspect);
            let along = corner.dot(up).abs() / tangent;
            distance = distance.max(corner.dot(side) + across.max(along));
        }
        CameraPose {
            eye: self.centre + distance * side,
            look_at: self.centre,
            up: Vec3::Y,
            vertical_fov_degrees: FOV_DEFAULT,
        }
    }

    /// So far must the eye be away that it is another point in `f32`.
    fn distance_min(&self) -> f32 {
        1e-5 * self.centre.abs().max_element()
    }

    /// A square above and in front of the box, facing its centre.
    fn light_outside(&self) -> Emitter {
        let radius = self.half.length();
        let offset = Vec3::new(0.0, self.half.y + 0.5 * radius, 0.5 * radius);
        let side = 0.8 * radius;
        let edge_u = side * Vec3::X;
        let edge_v = side * offset.cross(Vec3::NEG_X).normalize();
        let irradiance_of_one = side * side / offset.length_squared();
        Emitter {
            shape: EmitterShape::Parallelogram,
            corner: self.centre + offset - 0.5 * (edge_u + edge_v),
            edge_u,
            edge_v,
            radiance: Vec3::splat(IRRADIANCE / irradiance_of_one),
        }
    }

    /// A rectangle below the ceiling, as large as the room there suggests, facing down.
    fn light_below_ceiling(&self) -> Emitter {
        let (floor, ceiling) = self.floor_and_ceiling();
        let height = ceiling - floor;
        let middle = self.centre.with_y(ceiling - 0.04 * height);
        let sides = [Vec3::X, Vec3::NEG_X, Vec3::Z, Vec3::NEG_Z];
        let free = first_hits(self.mesh, middle, &sides)
            .iter()
            .map(|hit| hit.map_or(f32::INFINITY, |hit| hit.distance))
            .collect::<Vec<_>>();
        let side = |a: f32, b: f32| (0.6 * a.min(b)).min(0.5 * height);
        let edge_u = side(free[0], free[1]) * Vec3::X;
        let edge_v = side(free[2], free[3]) * Vec3::Z;
        let area = edge_u.length() * edge_v.length();
        // Exact for a lamp much smaller than its height, and never too much for a large one.
        let irradiance_of_one = area / (0.25 * height * height + area / PI);
        Emitter {
            shape: EmitterShape::Parallelogram,
            corner: middle - 0.5 * (edge_u + edge_v),
            edge_u,
            edge_v,
            radiance: Vec3::splat(IRRADIANCE / irradiance_of_one),
        }
    }

    /// Heights of what is below and above the centre; those of the box where nothing is.
    fn floor_and_ceiling(&self) -> (f32, f32) {
        let hits = first_hits(self.mesh, self.centre, &[Vec3::NEG_Y, Vec3::Y]);
        let distance = |hit: Option<Hit>| hit.map_or(self.half.y, |hit| hit.distance);
        let [below, above] = [distance(hits[0]), distance(hits[1])];
        (self.centre.y - below, self.centre.y + above)
    }
}

/// What a ray meets first.
#[derive(Debug, Clone, Copy)]
struct Hit {
    /// In lengths of the ray's direction.
    distance: f32,
    is_front: bool,
}

/// What rays from one point meet first, by a look at every triangle: a few rays are not worth a
/// bounding volume hierarchy.
fn first_hits(mesh: &TriangleMesh, origin: Vec3, directions: &[Vec3]) -> Vec<Option<Hit>> {
    let mut nearest: Vec<Option<Hit>> = vec![None; directions.len()];
    for triangle in 0..mesh.triangles.len() {
        // The same for all rays: the solution of origin + t·direction = a + u·edge_u + v·edge_v.
        let [a, b, c] = mesh.corners(triangle);
        let (edge_u, edge_v, from_a) = (b - a, c - a, origin - a);
        let normal = edge_u.cross(edge_v);
        let height = from_a.dot(normal);
        let (for_u, for_v) = (edge_v.cross(from_a), from_a.cross(edge_u));
        for (direction, nearest) in directions.iter().zip(&mut nearest) {
            let towards = -direction.dot(normal);
            let distance = height / towards;
            let (u, v) = (for_u.dot(*direction) / towards, for_v.dot(*direction) / towards);
            let is_hit = distance > 0.0 && u >= 0.0 && v >= 0.0 && u + v <= 1.0;
            if is_hit && nearest.is_none_or(|hit| distance < hit.distance) {
                *nearest = Some(Hit {
                    distance,
                    is_front: towards > 0.0,
                });
            }
        }
    }
    nearest
}

/// The `index`-th of `count` directions that are spread evenly over the sphere (a Fibonacci spiral).
fn spiral(index: usize, count: usize) -> Vec3 {
    let golden_angle = PI * (3.0 - 5f32.sqrt());
    let z = 1.0 - (2 * index + 1) as f32 / count as f32;
    let (sin, cos) = (golden_angle * index as f32).sin_cos();
    let radius = (1.0 - z * z).sqrt();
    Vec3::new(radius * cos, radius * sin, z)
}

impl fmt::Display for Framing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let CameraPose { eye, look_at, .. } = self.camera;
        write!(
            f,
            "no camera is given, framed from the bounding box (eye {eye:.3}, look_at {look_at:.3})"
        )?;
        match self.light {
            Some(light) => {
                let centre = light.point(0.5, 0.5);
                let radiance = light.radiance.x;
                write!(
                    f,
                    "; nothing emits, a quad light is put near the top (centre {centre:.3}, radiance {radiance:.3})",
                )
            }
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A box of two triangles on each side but those left out, with the fronts in- or outside.
    fn cube(half: Vec3, centre: Vec3, left_out: &[Vec3], fronts_inside: bool) -> TriangleMesh {
        let mut mesh = TriangleMesh::default();
        for side in [Vec3::X, Vec3::Y, Vec3::Z]
            .map(|axis| [axis, -axis])
            .as_flattened()
        {
            if left_out.contains(side) {
                continue;
            }
            let edge_u = side.any_orthonormal_vector();
            let edge_v = side.cross(edge_u);
            let base = mesh.positions.len() as u32;
            for (u, v) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
                mesh.positions
                    .push(centre + half * (side + u * edge_u + v * edge_v));
            }
            for [a, b, c] in [[0, 1, 2], [0, 2, 3]] {
                let triangle = if fronts_inside { [a, c, b] } else { [a, b, c] };
                mesh.triangles.push(triangle.map(|index| base + index));
                mesh.material_of.push(0);
            }
        }
        mesh
    }

    const SIZE: ImageSize = ImageSize {
        width: 400,
        height: 300,
    };

    fn framed(mesh: &TriangleMesh) -> Framing {
        Framing::of(mesh, &[], SIZE)
    }

    /// Whether a point is in the picture.
    fn is_seen(camera: &CameraPose, point: Vec3) -> bool {
        let forwards = (camera.look_at - camera.eye).normalize();
        let right = forwards.cross(camera.up).normalize();
        let from_eye = point - camera.eye;
        let depth = from_eye.dot(forwards);
        let tangent = (0.5 * camera.vertical_fov_degrees).to_radians().tan();
        let (x, y) = (from_eye.dot(right), from_eye.dot(right.cross(forwards)));
        depth > 0.0 && x.abs() <= 4.0 / 3.0 * tangent * depth && y.abs() <= tangent * depth
    }

    fn lamp(corner: Vec3, edge_u: Vec3, edge_v: Vec3) -> Emitter {
        Emitter {
            shape: EmitterShape::Parallelogram,
            corner,
            edge_u,
            edge_v,
            radiance: Vec3::ONE,
        }
    }

    #[test]
    fn a_thing_is_seen_whole_from_outside_and_lit_from_above() {
        for (half, centre) in [
            (Vec3::new(1.0, 2.0, 3.0), Vec3::new(5.0, 6.0, 7.0)),
            (Vec3::new(40.0, 0.1, 30.0), Vec3::ZERO),
            (Vec3::splat(0.001), Vec3::ONE),
        ] {
            let mesh = cube(half, centre, &[], false);
            let Framing { camera, light } = framed(&mesh);
            for &corner in &mesh.positions {
                assert!(is_seen(&camera, corner), "{half}: {corner} from {camera:?}");
            }
            let light = light.expect("nothing emits");
            let (min, max) = mesh.bounds().expect("triangles");
            assert!(camera.eye.z > max.z, "{half}: {camera:?}");
            let source = light.point(0.5, 0.5);
            assert!(source.y > max.y, "{half}: {light:?}");
            let towards = (0.5 * (min + max) - source).normalize();
            assert!(light.normal().dot(towards) > 0.999, "{half}: {light:?}");
        }
    }

    #[test]
    fn a_closed_room_is_seen_from_inside_and_lit_from_below_the_ceiling() {
        let mesh = cube(Vec3::new(8.0, 2.0, 3.0), Vec3::ZERO, &[], true);
        let Framing { camera, light } = framed(&mesh);
        let light = light.expect("nothing emits");
        let source = light.point(0.5, 0.5);
        assert!(camera.eye.x.abs() > 6.0 && camera.eye.x.abs() < 8.0, "{camera:?}");
        assert!(source.y > 1.5 && source.y < 2.0, "{light:?}");
        assert!(light.normal().abs_diff_eq(Vec3::NEG_Y, 1e-6), "{light:?}");
    }

    #[test]
    fn a_room_with_an_open_side_is_seen_from_there() {
        for side in [Vec3::X, Vec3::NEG_Z] {
            let mesh = cube(Vec3::ONE, Vec3::ZERO, &[side], true);
            let camera = framed(&mesh).camera;
            assert!(camera.eye.dot(side) > 2.0, "{camera:?}");
            assert!(mesh.positions.iter().all(|&corner| is_seen(&camera, corner)));
        }
    }

    #[test]
    fn a_lamp_inside_makes_a_room_of_walls_with_their_backs_to_it() {
        let mesh = cube(Vec3::new(8.0, 2.0, 3.0), Vec3::ZERO, &[], false);
        // The lamp is in the mesh, too, as the loader puts it.
        let mut lit = mesh.clone();
        let base = lit.positions.len() as u32;
        let down = lamp(Vec3::new(-1.0, 1.9, -1.0), 2.0 * Vec3::X, 2.0 * Vec3::Z);
        let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
        lit.positions.extend(corners.map(|(s, t)| down.point(s, t)));
        lit.triangles
            .extend([[base, base + 1, base + 2], [base, base + 2, base + 3]]);
        let framing = Framing::of(&lit, &[down], SIZE);
        assert!(framing.light.is_none());
        assert!(framing.camera.eye.x.abs() < 8.0, "{:?}", framing.camera);
        // Without it they are the outside of a box.
        assert!(framed(&mesh).camera.eye.z > 3.0);
    }

    #[test]
    fn the_light_gives_a_decent_exposure() {
        let outside = cube(Vec3::new(1.0, 1.0, 1.0), Vec3::ZERO, &[], false);
        let room = cube(Vec3::new(8.0, 2.0, 3.0), Vec3::ZERO, &[], true);
        for (mesh, lit) in [(outside, Vec3::ZERO), (room, Vec3::new(0.0, -2.0, 0.0))] {
            let light = framed(&mesh).light.expect("nothing emits");
            // The irradiance at `lit` of a surface that faces the light: a sum over its area.
            let mut irradiance = 0.0;
            for (i, j) in (0..16u8).flat_map(|i| (0..16u8).map(move |j| (i, j))) {
                let stratum = |k: u8| (f32::from(k) + 0.5) / 16.0;
                let from = light.point(stratum(i), stratum(j)) - lit;
                let cosine = light.normal().dot(-from.normalize());
                irradiance += light.radiance.x * cosine * cosine / from.length_squared();
            }
            irradiance *= light.area() / 256.0;
            assert!(
                irradiance > 0.3 && irradiance < 2.0,
                "{irradiance} from {light:?}"
            );
        }
    }

    #[test]
    fn meshes_at_the_limits_give_two_different_points_and_a_finite_light() {
        for (half, centre) in [
            (Vec3::splat(1e-8), Vec3::ZERO),
            (Vec3::new(16.0, 0.0, 16.0), Vec3::splat(1e8)),
            (Vec3::splat(1e9), Vec3::ZERO),
            (Vec3::splat(64.0), Vec3::splat(9e8)),
        ] {
            for fronts_inside in [false, true] {
                let mesh = cube(half, centre, &[], fronts_inside);
                let Framing { camera, light } = framed(&mesh);
                let axis = camera.look_at - camera.eye;
                assert!(axis.try_normalize().is_some(), "{half} {centre}: {camera:?}");
                let light = light.expect("nothing emits");
                assert!(light.radiance.is_finite(), "{half} {centre}: {light:?}");
                assert!(light.area() > 0.0, "{half} {centre}: {light:?}");
            }
        }
    }
}
