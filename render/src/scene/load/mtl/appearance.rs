//! How a material looks to a renderer that knows diffuse surfaces only, and what that leaves out.

use glam::Vec3;

use super::super::error::Place;
use super::super::note::Simplification;
use super::TextureReference;

/// The albedo of what is missing: a visible grey.
pub(in super::super) const GREY: Vec3 = Vec3::splat(0.5);

/// Albedo below this in every channel is black.
const BLACK: f32 = 0.02;

/// A material in terms of the renderer.
#[derive(Debug, Clone, PartialEq)]
pub(in super::super) struct Appearance {
    /// The line of its `map_Kd`, or else of its `newmtl`.
    pub(in super::super) place: Place,
    /// Albedo in [0, 1].
    pub(in super::super) kd: Vec3,
    /// Albedo map.
    pub(in super::super) kd_map: Option<TextureReference>,
    /// Emitted radiance.
    pub(in super::super) emission: Vec3,
    /// What is left out or changed.
    pub(in super::super) simplifications: Vec<Simplification>,
}

/// Puts an MTL material into terms of the renderer.
pub(super) fn of(material: &tobj::Material, place: Place) -> Appearance {
    let mut simplifications = Vec::new();
    let kd_map = material
        .diffuse_texture
        .as_deref()
        .and_then(|text| TextureReference::parse(text).ok());
    let emission = material.emissive.map_or(Vec3::ZERO, Vec3::from);
    let reflectance = reflectance(material, kd_map.is_some(), &mut simplifications);
    let kd = reflectance.clamp(Vec3::ZERO, Vec3::ONE);
    if kd != reflectance {
        simplifications.push(Simplification::Clamped);
    }
    let ignored = [
        (
            kd_map.as_ref().is_some_and(|map| map.has_ignored_options),
            Simplification::MapOptions,
        ),
        (material.dissolve_texture.is_some(), Simplification::CutOut),
        (
            material.unknown_param.contains_key("map_Ke"),
            Simplification::EmissionMap,
        ),
    ];
    simplifications.extend(ignored.into_iter().filter(|i| i.0).map(|i| i.1));
    Appearance {
        place,
        kd,
        kd_map,
        emission,
        simplifications,
    }
}

/// The diffuse reflectance that stands for everything the material reflects.
fn reflectance(material: &tobj::Material, has_map: bool, simplifications: &mut Vec<Simplification>) -> Vec3 {
    let ks = material.specular.map_or(Vec3::ZERO, Vec3::from);
    let emits = material.emissive.is_some_and(|ke| Vec3::from(ke) != Vec3::ZERO);
    let kd = match material.diffuse {
        Some(kd) => Vec3::from(kd),
        None if has_map => Vec3::ONE,
        None if emits || !is_black(ks) => Vec3::ZERO,
        None => {
            simplifications.push(Simplification::NoKd);
            GREY
        }
    };
    let special = special(material);
    if let Some(special) = special {
        simplifications.push(special);
    } else if !is_black(ks) {
        simplifications.push(Simplification::Gloss);
    }
    if has_map && is_black(kd) {
        simplifications.push(Simplification::MapAlone);
        return Vec3::ONE;
    }
    let dimmer = is_black(kd) || (special.is_some() && kd.element_sum() < ks.element_sum());
    if emits || has_map || !dimmer {
        return kd;
    }
    if !is_black(ks) {
        return ks;
    }
    match special {
        Some(_) => transmittance(material).unwrap_or(GREY),
        None => kd,
    }
}

/// Whether the material is a mirror or glass.
fn special(material: &tobj::Material) -> Option<Simplification> {
    let dissolved = material.dissolve.is_some_and(|d| d < 0.5);
    match material.illumination_model {
        Some(4 | 6 | 7 | 9) => Some(Simplification::Glass),
        _ if dissolved => Some(Simplification::Glass),
        Some(3 | 5 | 8) => Some(Simplification::Mirror),
        _ => None,
    }
}

/// `Tf` where it is given and not black.
fn transmittance(material: &tobj::Material) -> Option<Vec3> {
    let mut channels = material
        .unknown_param
        .get("Tf")?
        .split_ascii_whitespace()
        .map(str::parse);
    let mut channel = || channels.next()?.ok();
    let tf = Vec3::new(channel()?, channel()?, channel()?);
    (!is_black(tf)).then_some(tf)
}

fn is_black(albedo: Vec3) -> bool {
    albedo.max_element() < BLACK
}

#[cfg(test)]
mod tests {
    use super::super::read;
    use super::*;
    use std::path::Path;
    use std::sync::Arc;

    fn appearance(lines: &str) -> Appearance {
        let file: Arc<Path> = Path::new("a.mtl").into();
        let text = format!("newmtl a\n{lines}");
        let mut library = read(&file, text.as_bytes()).expect("readable");
        library.remove("a").expect("there")
    }

    fn check(lines: &str, kd: [f32; 3], simplifications: &[Simplification]) {
        let appearance = appearance(lines);
        assert_eq!(appearance.kd, Vec3::from(kd), "{lines}");
        assert_eq!(appearance.simplifications, simplifications, "{lines}");
    }

    #[test]
    fn a_diffuse_material_is_taken_as_it_is() {
        check("Kd 0.1 0.2 0.3\nKs 0 0 0\nillum 1", [0.1, 0.2, 0.3], &[]);
        check("Kd 0.4", [0.4; 3], &[]);
    }

    #[test]
    fn gloss_is_left_out_of_a_diffuse_material() {
        check(
            "Kd 0.1 0.2 0.3\nKs 0.5 0.5 0.5",
            [0.1, 0.2, 0.3],
            &[Simplification::Gloss],
        );
    }

    #[test]
    fn mirrors_and_glass_show_the_brighter_of_ks_and_kd() {
        check(
            "Kd 0 0 0\nKs 0.9 0.8 0.7\nillum 3",
            [0.9, 0.8, 0.7],
            &[Simplification::Mirror],
        );
        check(
            "Kd 0.01 0.01 0.01\nKs 0.95 0.95 0.95\nillum 5",
            [0.95; 3],
            &[Simplification::Mirror],
        );
        check(
            "Kd 0.6 0.6 0.6\nKs 0.1 0.1 0.1\nd 0.2",
            [0.6; 3],
            &[Simplification::Glass],
        );
        check(
            "Kd 0 0 0\nKs 0.1 0.1 0.1\nTf 0.5 0.5 0.5\nillum 4",
            [0.1; 3],
            &[Simplification::Glass],
        );
    }

    #[test]
    fn glass_without_kd_and_ks_shows_tf_or_grey() {
        check(
            "Kd 0 0 0\nKs 0 0 0\nTf 0.8 0.7 0.6\nillum 7",
            [0.8, 0.7, 0.6],
            &[Simplification::Glass],
        );
        check("Kd 0 0 0\nTf 0 0 0\nillum 7", [0.5; 3], &[Simplification::Glass]);
        check("Kd 0 0 0\nKs 0 0 0\nillum 6", [0.5; 3], &[Simplification::Glass]);
    }

    #[test]
    fn ks_stands_for_a_black_kd() {
        check(
            "Kd 0 0 0\nKs 0.3 0.3 0.3\nillum 2",
            [0.3; 3],
            &[Simplification::Gloss],
        );
    }

    #[test]
    fn black_paint_and_black_lamps_stay_black() {
        check("Kd 0 0 0\nKs 0 0 0\nillum 1", [0.0; 3], &[]);
        check(
            "Kd 0 0 0\nKs 0.5 0.5 0.5\nKe 5 5 5\nillum 2",
            [0.0; 3],
            &[Simplification::Gloss],
        );
        check("Ke 5 5 5", [0.0; 3], &[]);
    }

    #[test]
    fn a_material_without_colour_is_grey() {
        check("illum 1", [0.5; 3], &[Simplification::NoKd]);
    }

    #[test]
    fn a_map_stands_for_a_kd_that_is_black_or_not_given() {
        check("map_Kd a.png", [1.0; 3], &[]);
        check("Kd 0 0 0\nmap_Kd a.png", [1.0; 3], &[Simplification::MapAlone]);
        check("Kd 0.5 0.5 0.5\nmap_Kd a.png", [0.5; 3], &[]);
    }

    #[test]
    fn albedo_is_clamped_to_what_a_surface_can_reflect() {
        check("Kd 1.5 -0.5 0.5", [1.0, 0.0, 0.5], &[Simplification::Clamped]);
        check("Kd 1 0 1", [1.0, 0.0, 1.0], &[]);
    }

    #[test]
    fn what_is_not_rendered_is_said() {
        check("Kd 1 1 1\nmap_d leaf.png", [1.0; 3], &[Simplification::CutOut]);
        check(
            "Kd 1 1 1\nmap_Ke glow.png",
            [1.0; 3],
            &[Simplification::EmissionMap],
        );
        check("map_Kd -mm 0 2 a.png", [1.0; 3], &[Simplification::MapOptions]);
    }
}
