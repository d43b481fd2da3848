//! Scenes as people write them, and as they get them wrong.

mod documentation;
mod errors;
mod features;
mod never_panics;
mod notes;
mod shared_scenes;

use std::path::{Path, PathBuf};

use render::scene::{LoadOptions, LoadedScene, SceneError, load};

/// A folder with the files of one scene.
struct Folder {
    folder: tempfile::TempDir,
}

impl Folder {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        Self { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn with(self, name: &str, contents: impl AsRef<[u8]>) -> Self {
        let path = self.path(name);
        std::fs::create_dir_all(path.parent().expect("a parent")).expect("a folder");
        std::fs::write(path, contents).expect("written");
        self
    }

    fn load(&self, name: &str) -> Result<LoadedScene, SceneError> {
        load(&self.path(name), &self.options())
    }

    fn options(&self) -> LoadOptions {
        LoadOptions {
            scenes_dir: self.path("scenes"),
        }
    }

    /// The scene, and its notes as text with the folder cut away.
    fn loaded(&self, name: &str) -> (LoadedScene, Vec<String>) {
        let loaded = self.load(name).expect("a valid scene");
        let notes = loaded.notes.iter();
        let notes = notes.map(|note| self.cut(&note.to_string())).collect();
        (loaded, notes)
    }

    /// The error as text with the folder cut away.
    fn error(&self, name: &str) -> String {
        let error = self.load(name).expect_err("an invalid scene");
        self.cut(&error.to_string())
    }

    fn cut(&self, text: &str) -> String {
        let folder = format!("{}/", self.folder.path().display());
        text.replace(&folder, "")
    }
}

/// One triangle that faces +z and has no material.
const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

/// A scene of `a.obj` and a light, without a camera.
const SCENE: &str = r#"
[[mesh]]
path = "a.obj"
[[light.quad]]
corner = [0, 2, 0]
edge_u = [1, 0, 0]
edge_v = [0, 0, 1]
radiance = [1, 2, 3]
"#;

/// A camera that any scene may have.
const CAMERA: &str = "[camera]\neye = [0, 0, 5]\nlook_at = [0, 0, 0]\n";

/// A PNG of `width` × `height` equal pixels.
fn png(width: u32, height: u32, rgb: [u8; 3]) -> Vec<u8> {
    let picture = image::RgbImage::from_pixel(width, height, image::Rgb(rgb));
    encoded(&picture.into(), image::ImageFormat::Png)
}

fn encoded(picture: &image::DynamicImage, format: image::ImageFormat) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut bytes, format).expect("encoded");
    bytes.into_inner()
}

/// The workspace's root.
fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}
