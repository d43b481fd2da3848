//! What no lint checks: first lines, licences of scenes, files that are made by programs.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use gridlight::programs::{root, skipped};

/// The files that git knows, or would take; `None` outside of a work tree.
fn files() -> Option<Vec<PathBuf>> {
    let arguments = ["ls-files", "--cached", "--others", "--exclude-standard"];
    let output = Command::new("git")
        .args(arguments)
        .current_dir(root())
        .output()
        .ok()?;
    let names = String::from_utf8(output.stdout).ok()?;
    let files: Vec<PathBuf> = names
        .lines()
        .map(|name| root().join(name))
        .filter(|file| file.is_file())
        .collect();
    (output.status.success() && !files.is_empty()).then_some(files)
}

fn files_or_skip() -> Vec<PathBuf> {
    files().unwrap_or_else(|| {
        skipped("tidiness", "this is no work tree of git");
        Vec::new()
    })
}

#[test]
fn every_rust_file_begins_by_saying_what_it_is_for() {
    let is_rust = |file: &PathBuf| file.extension().is_some_and(|extension| extension == "rs");
    for file in files_or_skip().into_iter().filter(is_rust) {
        let text = fs::read_to_string(&file).expect("a text file");
        let first = text.lines().next().unwrap_or_default();
        // Cargo's own scripts may be modules of others, where the line comes just the same.
        assert!(
            first
                .strip_prefix("//! ")
                .is_some_and(|sentence| sentence.len() > 10),
            "{}:1: the first line is no `//!` sentence",
            file.display()
        );
    }
}

#[test]
fn every_scene_has_a_line_with_its_source_and_licence() {
    let scenes = root().join("scenes");
    let list = fs::read_to_string(scenes.join("README.md")).expect("the list of scenes");
    for entry in fs::read_dir(&scenes).expect("the scenes").flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let is_scene = entry
            .path()
            .extension()
            .is_some_and(|extension| extension == "toml");
        let row = |named: &str| {
            list.lines()
                .find(|line| line.starts_with(&format!("| `{named}`")))
        };
        if entry.path().is_dir() {
            let row = row(&format!("{name}/{name}.toml"));
            let row = row.unwrap_or_else(|| panic!("scenes/README.md has no line for {name}/"));
            let readme = entry.path().join("README.md");
            assert!(row.contains(&format!("]({name}/README.md)")), "{name}: {row}");
            let text = fs::read_to_string(&readme).unwrap_or_default();
            assert!(
                text.to_lowercase().contains("licence"),
                "{} names no licence",
                readme.display()
            );
        } else if is_scene {
            assert!(row(&name).is_some(), "scenes/README.md has no line for {name}");
        }
    }
}

#[test]
fn no_text_holds_a_path_of_the_machine_it_was_written_on() {
    // Where this work tree is, and where people's files are on any machine.
    let here = root().parent().filter(|folder| folder.components().count() > 1);
    let mut forbidden: Vec<String> = ["home", "root", "Users"].map(|name| format!("/{name}/")).into();
    forbidden.extend(here.map(|folder| format!("{}/", folder.display())));
    for file in files_or_skip() {
        // Pictures are no text.
        let Ok(text) = fs::read_to_string(&file) else {
            continue;
        };
        for (number, line) in text.lines().enumerate() {
            for path in &forbidden {
                assert!(
                    !line.contains(path),
                    "{}:{}: holds {path}",
                    file.display(),
                    number + 1
                );
            }
        }
    }
}

#[test]
fn the_nave_is_what_its_generator_makes() {
    let committed = root().join("scenes/nave");
    let made = tempfile::tempdir().expect("a temporary folder");
    let generator = committed.join("generate.py");
    let run = Command::new("python3")
        .arg("-B")
        .arg(&generator)
        .arg(made.path())
        .output();
    let Ok(output) = run else {
        return skipped("the nave's generator", "there is no python3");
    };
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let mut compared = 0;
    for entry in fs::read_dir(made.path()).expect("the folder").flatten() {
        assert_equal_files(&entry.path(), &committed.join(entry.file_name()));
        compared += 1;
    }
    assert!(compared > 10, "only {compared} files were made");
}

fn assert_equal_files(made: &Path, committed: &Path) {
    let read = |path| fs::read(path).unwrap_or_default();
    assert!(
        read(made) == read(committed),
        "{} is not what the generator makes",
        committed.display()
    );
}
