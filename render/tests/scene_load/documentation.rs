//! The example of docs/scene-format.md is a scene.

use crate::{Folder, png, root};

/// The code blocks of a Markdown text in one language.
fn blocks<'t>(text: &'t str, language: &str) -> Vec<&'t str> {
    let start = format!("```{language}\n");
    let after = text.split(start.as_str()).skip(1);
    after.filter_map(|rest| rest.split("```").next()).collect()
}

fn documentation() -> String {
    let path = root().join("docs/scene-format.md");
    std::fs::read_to_string(path).expect("the documentation is there")
}

#[test]
fn the_example_loads_without_a_note() {
    let text = documentation();
    let block = |language| {
        let blocks = blocks(&text, language);
        *blocks.first().expect("a code block")
    };
    let folder = Folder::new()
        .with("room.toml", block("toml"))
        .with("room.obj", block("obj"))
        .with("room.mtl", block("mtl"))
        .with("scenes/models/teapot.obj", block("obj"))
        .with("scenes/models/room.mtl", block("mtl"))
        .with("textures/tiles.png", png(4, 4, [200; 3]))
        .with("scenes/models/textures/tiles.png", png(4, 4, [200; 3]));
    let (loaded, notes) = folder.loaded("room.toml");
    assert!(notes.is_empty(), "{notes:?}");
    assert!(loaded.scene.emitters.len() > 1);
}

#[test]
fn every_key_and_limit_is_documented() {
    let text = documentation();
    let keys = "eye look_at up vertical_fov_degrees width height path translate scale rotate_degrees corner edge_u edge_v radiance";
    let mtl = "Kd map_Kd Ke Ks Tf illum d map_d -s -o -clamp";
    for key in keys.split(' ').chain(mtl.split(' ')) {
        assert!(text.contains(&format!("`{key}`")), "`{key}` is not documented");
    }
    let limits = [
        render::scene::load::limits::TRIANGLES_MAX,
        render::scene::load::limits::VERTICES_MAX,
        render::scene::load::limits::TEXELS_MAX,
        u64::from(render::scene::load::limits::TEXTURE_SIDE_MAX),
        render::scene::load::limits::OBJ_BYTES_MAX >> 20,
    ];
    let digits = text.replace(',', "");
    for limit in limits {
        assert!(digits.contains(&limit.to_string()), "{limit} is not documented");
    }
}
