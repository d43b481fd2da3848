//! The C library as C programs use it: compiled, linked, run, and watched by valgrind.

use std::{
    fs,
    path::Path,
    process::{Command, Stdio},
    sync::{Arc, LazyLock},
};

use gridlight::{
    c_program::{Linkage, Prefix},
    master::Master,
    programs::{root, skipped},
};
use render::{
    frame::FrameRenderer,
    intersect::TracedScene,
    scene::{ImageSize, LoadOptions, load},
    settings::{Algorithm, Settings},
    task::{Component, Task},
    vpl::trace_sets,
};

const CORNELL_BOX: &str = "scenes/cornell-box/cornell-box.toml";

static PREFIX: LazyLock<Prefix> = LazyLock::new(Prefix::install);

/// Runs to the end, which must be a good one.
#[track_caller]
fn must(command: &mut Command) -> String {
    let output = command.output().expect("the program starts");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(
        output.status.success(),
        "{command:?}: {}\n{errors}",
        output.status
    );
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// The light of the task that `render_task.c` renders, by the renderer in this process.
fn light_of_the_task() -> Vec<u8> {
    let scene = load(&root().join(CORNELL_BOX), &LoadOptions::default()).expect("the scene is there");
    let scene = Arc::new(TracedScene::build(scene.scene).expect("Embree takes it"));
    let size = ImageSize {
        width: 256,
        height: 192,
    };
    let settings = Settings {
        groups: 16,
        vpls: 256,
        vpl_sets: 4,
        ..Settings::paper(Algorithm::Component, size)
    };
    let vpl_sets = trace_sets(&scene, &settings);
    let frame = FrameRenderer::new(scene, settings, vpl_sets).expect("the settings are possible");
    let task = Task {
        component: Component::Indirect,
        group: 5,
        index: 2,
        passes: 1,
    };
    let light = frame.render(task, &mut |left| left).radiance;
    light.into_iter().flat_map(f32::to_le_bytes).collect()
}

#[test]
fn a_task_has_the_same_bits_from_c_as_from_the_renderer_here() {
    let expected = light_of_the_task();
    for linkage in [Linkage::Shared, Linkage::Static] {
        let program = PREFIX.compile("capi/examples/render_task.c", linkage);
        let light = PREFIX.file(&format!("{linkage:?}.raw"));
        let said = must(PREFIX.command(&program).arg(CORNELL_BOX).arg(&light));
        assert_eq!(said, "3072 of 3072 pixels\n");
        let found = fs::read(&light).expect("the light is written");
        assert!(found == expected, "{linkage:?}: other light than in Rust");
    }
}

#[test]
fn calls_that_make_no_sense_are_refused_as_the_header_says() {
    let program = PREFIX.compile("capi/tests/misuse.c", Linkage::Shared);
    must(PREFIX.command(&program).arg(CORNELL_BOX));
}

#[test]
fn a_c_program_is_a_worker_of_a_master() {
    let program = PREFIX.compile("capi/examples/worker.c", Linkage::Shared);
    assert_works_for_a_frame(&mut PREFIX.command(&program), "--deadline 4 --size 256x256");
}

/// Lets it be the only worker of a frame, and stops it.
#[track_caller]
fn assert_works_for_a_frame(worker: &mut Command, flags: &str) {
    let master = Master::new(&format!("{flags} --local-slots 0")).start();
    let mut worker = worker
        .args([&master.address().to_string(), "2"])
        .stdin(Stdio::piped())
        .spawn()
        .expect("the program starts");
    let picture = master.finish();
    drop(worker.stdin.take());
    let status = worker.wait().expect("a child can be waited for");
    picture.assert_code(0);
    let worker = picture.worker("a C program");
    assert!(worker["tasks"].as_u64() > Some(0), "{worker:#}");
    assert!(status.success(), "the worker: {status}");
}

#[test]
fn valgrind_finds_no_leak_and_no_bad_access() {
    let compile = |source: &str| PREFIX.compile(source, Linkage::Shared);
    let [render_task, misuse, worker] = [
        "capi/examples/render_task.c",
        "capi/tests/misuse.c",
        "capi/examples/worker.c",
    ]
    .map(compile);
    let checked = |program: &Path| PREFIX.checked_command(program);
    let (Some(mut render_task), Some(mut misuse), Some(mut worker)) =
        (checked(&render_task), checked(&misuse), checked(&worker))
    else {
        return skipped("C programs under valgrind", "valgrind is not installed");
    };
    must(render_task.arg(CORNELL_BOX).arg(PREFIX.file("checked.raw")));
    must(misuse.arg(CORNELL_BOX));
    assert_works_for_a_frame(
        &mut worker,
        "--no-deadline --paper --size 64x64 --vpls 32 --spp 2",
    );
}
