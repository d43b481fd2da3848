//! What a frame costs besides tracing, at 1024×768: the start, and all that must fit between the
//! cut-off and the deadline.

#[path = "../tests/rooms/mod.rs"]
#[expect(dead_code, reason = "the tests use more of it")]
mod rooms;

use std::{hint::black_box, io::Cursor, sync::Arc};

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use render::{
    buffer::FrameBuffers,
    frame::FrameRenderer,
    gbuffer::trace_aovs,
    image::{write_exr, write_png},
    pixel_group::PixelGroups,
    reconstruct::{Reconstruction, assemble},
    scene::ImageSize,
    settings::{Algorithm, Settings},
    vpl::trace_sets,
};

fn frame(criterion: &mut Criterion) {
    let size = ImageSize {
        width: 1024,
        height: 768,
    };
    let settings = Settings::paper(Algorithm::Component, size);
    let scene = rooms::room_with_lamp();
    let aovs = Arc::new(trace_aovs(&scene, size));
    let groups = Arc::new(PixelGroups::new(&settings));
    let renderer = FrameRenderer::new(scene.clone(), settings, trace_sets(&scene, &settings))
        .unwrap_or_else(|error| panic!("{error}"));
    // Three quarters of all tasks, so that there is something to reconstruct.
    let outputs: Vec<_> = rooms::all_tasks(&settings)
        .into_iter()
        .filter(|task| (task.group + task.index) % 4 != 0)
        .map(|task| (task, renderer.render(task, &mut |left| left).radiance))
        .collect();
    let buffers = || {
        let mut buffers = FrameBuffers::new(&settings, groups.clone());
        for (task, radiance) in &outputs {
            buffers
                .add(*task, radiance)
                .unwrap_or_else(|error| panic!("{error}"));
        }
        buffers
    };
    let picture = assemble(&mut buffers(), &aovs, Reconstruction::Nearest, 25.0);

    let mut group = criterion.benchmark_group("frame");
    group.sample_size(10);
    group.bench_function("pixel groups", |b| {
        b.iter(|| PixelGroups::new(black_box(&settings)));
    });
    group.bench_function("VPL sets", |b| {
        b.iter(|| trace_sets(&scene, black_box(&settings)));
    });
    group.bench_function("AOVs", |b| {
        b.iter(|| trace_aovs(&scene, black_box(size)));
    });
    group.bench_function("buffers", |b| {
        b.iter(buffers);
    });
    group.bench_function("assemble", |b| {
        b.iter_batched(
            buffers,
            |mut buffers| assemble(&mut buffers, &aovs, Reconstruction::Nearest, 25.0),
            BatchSize::PerIteration,
        );
    });
    group.bench_function("EXR to memory", |b| {
        b.iter(|| {
            let mut bytes = Cursor::new(Vec::with_capacity(64 << 20));
            write_exr(&picture, &[], &mut bytes).unwrap_or_else(|error| panic!("{error}"));
            bytes.into_inner().len()
        });
    });
    group.bench_function("PNG to memory", |b| {
        b.iter(|| {
            let mut bytes = Vec::with_capacity(4 << 20);
            write_png(&picture, 0.0, &mut bytes).unwrap_or_else(|error| panic!("{error}"));
            bytes.len()
        });
    });
    group.finish();
}

criterion_group!(benches, frame);
criterion_main!(benches);
