//! The textures of a scene: each file is opened and decoded once.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use glam::Vec3;

use super::all;
use super::error::SceneError;
use super::files::FileList;
use super::model::{Model, ModelMaterial, TextureUse};
use super::mtl::GREY;
use super::parallel::in_parallel;
use super::texture_file::{Picture, TextureFile};
use crate::scene::{Material, Texture, Wrap};

/// The textures of all models.
pub(super) struct Textures {
    /// Each file once, in order of first use.
    pub(super) files: Vec<TextureFile>,
    /// The scene's textures: a file, and how it goes on outside the unit square.
    list: Vec<(usize, Wrap)>,
    /// Index into `list` by path and wrap.
    index_of: HashMap<(PathBuf, Wrap), u32>,
}

impl Textures {
    /// Opens the texture files of all models.
    pub(super) fn find(models: &[Model<'_>], files: &mut FileList) -> Result<Self, SceneError> {
        let mut paths: Vec<&TextureUse> = Vec::new();
        let mut file_of: HashMap<&Path, usize> = HashMap::new();
        let (mut list, mut index_of) = (Vec::new(), HashMap::new());
        for material in models.iter().flat_map(|model| &model.materials) {
            let Some((texture, wrap)) = material.texture() else {
                continue;
            };
            if !texture.is_there {
                files.add(&texture.name, &texture.path, None);
                continue;
            }
            let file = *file_of.entry(&texture.path).or_insert(paths.len());
            if file == paths.len() {
                paths.push(texture);
            }
            index_of.entry((texture.path.clone(), wrap)).or_insert_with(|| {
                list.push((file, wrap));
                list.len() as u32 - 1
            });
        }
        let opened = all(in_parallel(&paths, |texture| {
            TextureFile::open(texture.path.clone(), texture.named_at.clone())
        }))?;
        TextureFile::check_total(&opened)?;
        for (texture, file) in paths.iter().zip(&opened) {
            files.add(&texture.name, &texture.path, Some(file.hash));
        }
        Ok(Self {
            files: opened,
            list,
            index_of,
        })
    }

    /// The material with its texture, or in grey where one is missing.
    pub(super) fn applied(&self, material: &ModelMaterial) -> Material {
        let texture = material.texture();
        let kd_map = texture.and_then(|(texture, wrap)| {
            let key = (texture.path.clone(), wrap);
            self.index_of.get(&key).copied()
        });
        let is_missing = texture.is_some() && kd_map.is_none();
        let appearance = material.appearance.as_ref();
        Material {
            name: material.name.clone(),
            kd: appearance.map_or(GREY, |a| if is_missing { GREY } else { a.kd }),
            kd_map,
            emission: appearance.map_or(Vec3::ZERO, |a| a.emission),
        }
    }

    /// The scene's textures, given the pictures of `files`.
    pub(super) fn pictured(&self, mut pictures: Vec<Picture>) -> Vec<Texture> {
        let mut textures = Vec::with_capacity(self.list.len());
        for (index, &(file, wrap)) in self.list.iter().enumerate() {
            let is_used_again = self.list[index + 1..].iter().any(|later| later.0 == file);
            let picture = &mut pictures[file];
            textures.push(Texture {
                width: picture.width,
                height: picture.height,
                texels: if is_used_again {
                    picture.texels.clone()
                } else {
                    std::mem::take(&mut picture.texels)
                },
                wrap,
            });
        }
        textures
    }
}

impl ModelMaterial {
    fn texture(&self) -> Option<(&TextureUse, Wrap)> {
        let wrap = self.appearance.as_ref()?.kd_map.as_ref()?.wrap;
        Some((self.texture.as_ref()?, wrap))
    }
}
