//! The well-known scenes, where they are on this machine.

use std::io::Write as _;
use std::path::PathBuf;

use render::scene::{LoadOptions, Note, load};

use crate::root;

/// The scenes and their triangles, as the folder's README counts them.
const SCENES: &[(&str, u64)] = &[
    ("sibenik/sibenik.obj", 75_267),
    ("conference/conference.obj", 160_668),
    ("cornell/CornellBox-Original.obj", 32),
    ("cornell/CornellBox-Bunny.obj", 69_463),
    ("cornell/CornellBox-Mirror.obj", 32),
    ("cornell/CornellBox-Glossy.obj", 1_112),
    ("cornell/CornellBox-Glossy-Floor.obj", 1_112),
    ("cornell/CornellBox-Sphere.obj", 2_188),
    ("cornell/CornellBox-Water.obj", 7_088),
    ("cornell/CornellBox-Empty-White.obj", 12),
    ("cornell/cornell-measured.obj", 36),
    ("sponza-dabrovic/sponza.obj", 66_453),
    ("living-room/living-room.obj", 142_963),
    ("bunny/bunny.obj", 69_451),
    ("models/dragon.obj", 60_000),
    ("models/teapot.obj", 6_320),
];

/// The folder, if it is there.
fn folder() -> Option<PathBuf> {
    let folder =
        std::env::var_os("GRIDLIGHT_SCENES").map_or_else(|| root().join("../shared/scenes"), PathBuf::from);
    if folder.is_dir() {
        return Some(folder);
    }
    // Not `eprintln!`, whose text is shown for tests that fail only.
    let skipped = writeln!(
        std::io::stderr(),
        "SKIPPED: {} is not there; set GRIDLIGHT_SCENES to the folder of scenes",
        folder.display()
    );
    skipped.expect("written");
    None
}

#[test]
fn every_mesh_has_the_triangles_it_should_have() {
    let Some(folder) = folder() else { return };
    for (name, triangles) in SCENES {
        let loaded = load(&folder.join(name), &LoadOptions::default()).expect(name);
        let mut found = loaded.scene.mesh.triangles.len() as u64;
        for note in &loaded.notes {
            println!("{note}");
            match note {
                Note::DegenerateDropped { counts } => {
                    found += counts.iter().map(|(_, count)| count).sum::<u64>();
                }
                Note::Framed { framing, .. } => found -= 2 * u64::from(framing.light.is_some()),
                Note::Simplified { .. } => {}
                other => panic!("{name} should have no such note: {other}"),
            }
        }
        println!(
            "{name}: {found} triangles, {} vertices, {} materials, {} textures, {} emitters",
            loaded.scene.mesh.positions.len(),
            loaded.scene.materials.len(),
            loaded.scene.textures.len(),
            loaded.scene.emitters.len()
        );
        assert_eq!(found, *triangles, "{name}");
    }
}

#[test]
fn every_scene_file_of_the_project_loads() {
    let options = LoadOptions {
        scenes_dir: folder().unwrap_or_default(),
    };
    let has_models = options.scenes_dir.is_dir();
    let mut pending = vec![root().join("scenes")];
    while let Some(path) = pending.pop() {
        if path.is_dir() {
            let entries = std::fs::read_dir(path).expect("readable");
            pending.extend(entries.map(|entry| entry.expect("readable").path()));
        } else if path.extension().is_some_and(|e| e == "toml") {
            let text = std::fs::read_to_string(&path).expect("readable");
            if has_models || !text.contains("$GRIDLIGHT_SCENES") {
                load(&path, &options).expect("a valid scene");
            }
        }
    }
}
