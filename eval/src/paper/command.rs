//! `eval paper`: the paper's experiments, from scenes to a page.

use std::{
    fs,
    io::Write,
    path::{Path, PathBuf},
};

use anyhow::{Context, bail};
use clap::Args;
use render::scene::ImageSize;

use super::{
    document::Document,
    experiment::{Plan, SceneResult, run_scene},
    realtime::measured::Measured,
    report::{Circumstances, report},
};
use crate::grid::{
    parameters::{Parameters, SceneParameters},
    places,
};

/// Picture size of `--quick`.
const QUICK_SIZE: ImageSize = ImageSize {
    width: 256,
    height: 192,
};

/// The flags of `eval paper`.
#[derive(Debug, Args)]
pub struct PaperArgs {
    /// The folder of scenes that are not in this repository [default: `$GRIDLIGHT_SCENES`, else
    /// ../shared/scenes]
    #[arg(long, value_name = "DIR")]
    scenes: Option<PathBuf>,
    /// Small pictures, and only the shortest and the longest deadline of each scene
    #[arg(long)]
    quick: bool,
    /// Where the page goes: paper.html, README.md and its pictures [default: docs/paper; with --quick
    /// target/paper-quick]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Another grid: a TOML file of the form of eval/paper.toml
    #[arg(long, value_name = "FILE")]
    parameters: Option<PathBuf>,
    /// Leave out scenes that are not there instead of refusing to begin
    #[arg(long)]
    allow_missing: bool,
}

/// Renders and judges everything, writes the page, and tells where it is.
pub fn run(args: &PaperArgs) -> anyhow::Result<String> {
    let parameters = Parameters::load(args.parameters.as_deref())?;
    let plan = if args.quick {
        Plan::quick(parameters.at_size(QUICK_SIZE))
    } else {
        Plan::full(parameters)
    };
    let scenes_dir = places::shared_scenes(args.scenes.as_deref());
    let (found, missing) = find(&plan.parameters.scene, &scenes_dir)?;
    if !missing.is_empty() && (found.is_empty() || !args.allow_missing) {
        bail!(
            "{} not found in {}. Get the models from the sources that scenes/README.md names, then pass \
             their folder with --scenes or $GRIDLIGHT_SCENES{}",
            missing.join(", "),
            scenes_dir.display(),
            if found.is_empty() {
                ""
            } else {
                "; --allow-missing goes on without them"
            }
        );
    }
    for name in &missing {
        tell(name, "left out: its files are not there");
    }

    let mut results: Vec<SceneResult> = Vec::new();
    for (scene, file) in found {
        let step = |text: &str| tell(&scene.name, text);
        results.push(run_scene(&plan, scene, &file, &scenes_dir, &step)?);
    }
    let size = plan.parameters.size();
    let out = args.out.clone().unwrap_or_else(|| default_out(args.quick));
    let realtime = Measured::load(&out)?;
    let document = report(
        &results,
        &Circumstances {
            command: if args.quick {
                "cargo run -p eval -- paper --quick"
            } else {
                "cargo run -p eval -- paper"
            },
            size: (size.width, size.height),
            missing: &missing,
            realtime: realtime.as_ref(),
        },
    )?;
    write(&document, &out).with_context(|| format!("cannot write to {}", out.display()))?;
    Ok(out.join("paper.html").display().to_string())
}

/// A scene and its file.
pub(super) type Found<'a> = (&'a SceneParameters, PathBuf);

/// The scenes whose models are there, and the names of the others.
pub(super) fn find<'a>(
    scenes: &'a [SceneParameters],
    scenes_dir: &Path,
) -> anyhow::Result<(Vec<Found<'a>>, Vec<String>)> {
    let (mut found, mut missing) = (Vec::new(), Vec::new());
    for scene in scenes {
        let file = places::scene_file(&scene.file);
        let text = fs::read_to_string(&file)
            .with_context(|| format!("cannot read {}; run this in the project's folder", file.display()))?;
        if models(&text, scenes_dir)?.iter().all(|model| model.is_file()) {
            found.push((scene, file));
        } else {
            missing.push(scene.name.clone());
        }
    }
    Ok((found, missing))
}

/// The models in the shared folder that a scene file names.
fn models(scene: &str, scenes_dir: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let table: toml::Table = toml::from_str(scene)?;
    let meshes = table
        .get("mesh")
        .and_then(toml::Value::as_array)
        .into_iter()
        .flatten();
    let paths = meshes.filter_map(|mesh| mesh.get("path")?.as_str()?.strip_prefix("$GRIDLIGHT_SCENES/"));
    Ok(paths.map(|path| scenes_dir.join(path)).collect())
}

fn default_out(quick: bool) -> PathBuf {
    places::project_root().join(if quick { "target/paper-quick" } else { "docs/paper" })
}

/// The page, the Markdown, and the pictures that it names.
fn write(document: &Document, out: &Path) -> anyhow::Result<()> {
    fs::create_dir_all(out)?;
    for figure in document.figures() {
        fs::write(out.join(&figure.file), &figure.bytes)?;
    }
    fs::write(out.join("paper.html"), document.to_html())?;
    fs::write(out.join("README.md"), document.to_markdown())?;
    Ok(())
}

/// Progress, for people; where stderr is closed there are none.
fn tell(scene: &str, step: &str) {
    let _ = writeln!(std::io::stderr(), "{scene}: {step}");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenes_whose_models_are_not_there_are_named() {
        let parameters = Parameters::load(None).unwrap();
        let nowhere = tempfile::tempdir().unwrap();
        let (found, missing) = find(&parameters.scene, nowhere.path()).unwrap();
        assert!(found.is_empty());
        assert_eq!(missing, ["Conference Room", "Sibenik", "Cornell Box"]);
        let model = nowhere.path().join("cornell/CornellBox-Bunny.obj");
        fs::create_dir_all(model.parent().unwrap()).unwrap();
        fs::write(model, "").unwrap();
        let (found, missing) = find(&parameters.scene, nowhere.path()).unwrap();
        assert_eq!(found[0].0.name, "Cornell Box");
        assert_eq!(missing.len(), 2);
    }
}
