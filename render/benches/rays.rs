//! Shadow rays to VPLs: our gather against a bare Embree loop over prepared rays, the same rays in the
//! same run, in turns, so that a machine whose speed drifts does not decide.
//!
//! `cargo bench -p render --bench rays` prints rates in million rays per second of one thread and their
//! ratios for the Cornell box and, where the scenes are, the others; then the other orders and forms that
//! packets could have.

#![expect(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a benchmark prints its results"
)]

use std::{
    hint::black_box,
    path::{Path, PathBuf},
    sync::Arc,
    time::Duration,
};

use embree4_sys::{
    Coherence, FlushDenormals, LaneMask, Lanes, PacketSize, RayPacket, WideKernel, with_wide_vectors,
};
use render::{
    gbuffer::{GBuffer, Vec3Lanes},
    intersect::TracedScene,
    pixel_group::PixelGroups,
    scene::{ImageSize, LoadOptions, load},
    section::Section,
    settings::{Algorithm, Settings},
    vpl::{Gather, GeometryBound, Vpl, trace_sets},
};

const ROUNDS: usize = 15;
const TIME_MIN: Duration = Duration::from_millis(150);
const SIZE: ImageSize = ImageSize {
    width: 1024,
    height: 768,
};

fn main() {
    // Cargo passes `--bench`; when tests are run, benches are only started.
    if !std::env::args().any(|argument| argument == "--bench") {
        return;
    }
    // `-- nave` asks for the scenes with this in their name.
    let wanted = std::env::args()
        .skip(1)
        .find(|argument| !argument.starts_with('-'));
    let _flush = FlushDenormals::in_this_thread();
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let scenes =
        std::env::var_os("GRIDLIGHT_SCENES").map_or_else(|| root.join("../shared/scenes"), PathBuf::from);
    for file in [
        "cornell-box/cornell-box.toml",
        "sibenik.toml",
        "nave/nave.toml",
        "conference.toml",
        "sponza.toml",
    ] {
        if wanted.as_ref().is_some_and(|wanted| !file.contains(wanted)) {
            continue;
        }
        match load(
            &root.join("scenes").join(file),
            &LoadOptions {
                scenes_dir: scenes.clone(),
            },
        ) {
            Ok(loaded) => bench_scene(file, loaded.scene),
            Err(error) => eprintln!("{file} is skipped: {error}"),
        }
    }
}

/// G-buffer points of the first group and the VPLs of one set.
struct Work {
    scene: Arc<TracedScene>,
    /// All of them, along the curve.
    points: GBuffer,
    /// The same in the group's order, cut into chunks.
    chunks: Vec<GBuffer>,
    vpls: Vec<Vpl>,
}

fn bench_scene(name: &str, scene: render::scene::Scene) {
    let scene = match TracedScene::build(scene) {
        Ok(scene) => Arc::new(scene),
        Err(error) => return eprintln!("{name} is skipped: {error}"),
    };
    let settings = Settings::paper(Algorithm::Component, SIZE);
    let groups = PixelGroups::new(&settings);
    let pixels = groups.pixels(0);
    let chunks = pixels.chunks(groups.chunk_pixels());
    let work = Work {
        points: Section::trace(&scene, SIZE, pixels).points().clone(),
        chunks: chunks
            .map(|pixels| GBuffer::trace(&scene, SIZE, pixels))
            .collect(),
        vpls: trace_sets(&scene, &settings).swap_remove(0).vpls,
        scene,
    };
    println!(
        "{name}: {} triangles, one thread",
        work.scene.scene().mesh.triangles.len()
    );
    match work.scene.packet_width().lanes() {
        4 => bench_gather::<4>(&work),
        8 => bench_gather::<8>(&work),
        _ => bench_gather::<16>(&work),
    }
    bench_forms(&work);
}

/// The gather and its visibility alone against the bare loop, in turns.
fn bench_gather<const N: usize>(work: &Work)
where
    Lanes<N>: PacketSize,
{
    let gather = Gather::new(&work.scene, GeometryBound::new(None));
    let mut prepared = near_points_to_one_vpl::<N>(&work.points, &work.vpls);
    let rays: u64 = prepared.iter().map(|(valid, _)| u64::from(valid.count())).sum();
    let mut radiance = Vec3Lanes::zeros(work.points.position.x.len());
    let (mut bare, mut visibility, mut whole) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..ROUNDS {
        bare.push(time(|| trace(work, &mut prepared, Coherence::Incoherent)));
        visibility.push(time(|| {
            black_box(gather.count_visible(&work.points, &work.vpls));
        }));
        whole.push(time(|| {
            black_box(gather.add(&work.points, &work.vpls, &mut radiance));
        }));
    }
    println!(
        "  {:44} {:7.2} Mrays/s",
        format!("bare loop, packets of {N}, prepared rays"),
        rate(rays, &bare)
    );
    for (name, times) in [
        ("gather, visibility alone", &visibility),
        ("gather, whole", &whole),
    ] {
        println!(
            "  {name:44} {:7.2} Mrays/s = {:.3} of bare",
            rate(rays, times),
            median_ratio(&bare, times)
        );
    }
}

/// The same pairs of points and VPLs in the other orders and widths, bare.
fn bench_forms(work: &Work) {
    let Work {
        points, chunks, vpls, ..
    } = work;
    for (coherence, name) in [
        (Coherence::Incoherent, "incoherent"),
        (Coherence::Coherent, "coherent"),
    ] {
        let near = "along the curve, one VPL";
        let packets = near_points_to_one_vpl::<4>(points, vpls);
        bench_form(work, &format!("{near}, 4 lanes, {name}"), packets, coherence);
        let packets = near_points_to_one_vpl::<8>(points, vpls);
        bench_form(work, &format!("{near}, 8 lanes, {name}"), packets, coherence);
        let packets = near_points_to_one_vpl::<16>(points, vpls);
        bench_form(work, &format!("{near}, 16 lanes, {name}"), packets, coherence);
        let packets = chunks
            .iter()
            .flat_map(|points| near_points_to_one_vpl::<16>(points, vpls))
            .collect();
        bench_form(
            work,
            &format!("by chunks, one VPL, 16 lanes, {name}"),
            packets,
            coherence,
        );
        let packets = one_point_to_vpls::<16>(points, vpls);
        bench_form(
            work,
            &format!("one point, 16 VPLs, 16 lanes, {name}"),
            packets,
            coherence,
        );
    }
}

fn bench_form<const N: usize>(work: &Work, name: &str, mut packets: Packets<N>, coherence: Coherence)
where
    Lanes<N>: PacketSize,
{
    let rays = packets.iter().map(|(valid, _)| u64::from(valid.count())).sum();
    let times: Vec<Duration> = (0..5)
        .map(|_| time(|| trace(work, &mut packets, coherence)))
        .collect();
    println!("  {name:44} {:7.2} Mrays/s", rate(rays, &times));
}

type Packets<const N: usize> = Vec<(LaneMask<N>, RayPacket<N>)>;

fn trace<const N: usize>(work: &Work, packets: &mut Packets<N>, coherence: Coherence)
where
    Lanes<N>: PacketSize,
{
    with_wide_vectors(Bare {
        scene: &work.scene,
        packets,
        coherence,
    });
}

/// Nothing but Embree.
struct Bare<'a, const N: usize> {
    scene: &'a TracedScene,
    packets: &'a mut Packets<N>,
    coherence: Coherence,
}

impl<const N: usize> WideKernel for Bare<'_, N>
where
    Lanes<N>: PacketSize,
{
    type Output = ();

    #[inline(always)]
    #[expect(
        clippy::inline_always,
        reason = "it must be compiled for the processor's vectors, as the gather is"
    )]
    fn run(self) {
        for (valid, packet) in self.packets {
            self.scene.accelerated().occluded(valid, packet, self.coherence);
            black_box(&packet.tfar);
            // Ready for the next time; by then the write is long done.
            packet.tfar = [1.0; N];
        }
    }
}

fn near_points_to_one_vpl<const N: usize>(points: &GBuffer, vpls: &[Vpl]) -> Packets<N> {
    let mut packets = Vec::new();
    for vpl in vpls {
        for first in (0..points.len).step_by(N) {
            packets.extend(packet((first..first + N).map(|lane| (points, lane, vpl))));
        }
    }
    packets
}

fn one_point_to_vpls<const N: usize>(points: &GBuffer, vpls: &[Vpl]) -> Packets<N> {
    let mut packets = Vec::new();
    for lane in 0..points.len {
        for vpls in vpls.chunks(N) {
            packets.extend(packet(vpls.iter().map(|vpl| (points, lane, vpl))));
        }
    }
    packets
}

/// A packet of the pairs that face each other; `None` if no pair does.
fn packet<'a, const N: usize>(
    pairs: impl Iterator<Item = (&'a GBuffer, usize, &'a Vpl)>,
) -> Option<(LaneMask<N>, RayPacket<N>)> {
    let mut packet = RayPacket::new();
    packet.tfar = [1.0; N];
    let mut faces = [false; N];
    for (lane, (points, point, vpl)) in pairs.enumerate() {
        let connection = points.position.get(point) - vpl.position;
        [packet.org_x[lane], packet.org_y[lane], packet.org_z[lane]] = vpl.position.to_array();
        [packet.dir_x[lane], packet.dir_y[lane], packet.dir_z[lane]] = connection.to_array();
        faces[lane] = connection.dot(vpl.normal) > 0.0
            && connection.dot(points.shading_normal.get(point)) < 0.0
            && connection.dot(points.geometric_normal.get(point)) < 0.0;
    }
    let mask = LaneMask::from_lanes(faces);
    (mask.count() > 0).then_some((mask, packet))
}

/// Time on a core, which other programs do not lengthen as they do the time by the clock. The kernel
/// may count in ticks of some milliseconds: work is repeated until that no longer matters.
fn time(mut work: impl FnMut()) -> Duration {
    let start = cpu_time();
    for repeats in 1.. {
        work();
        let elapsed = cpu_time().saturating_sub(start);
        if elapsed >= TIME_MIN {
            return elapsed / repeats;
        }
    }
    Duration::ZERO
}

/// What this thread has run so far, by the kernel's scheduler statistics.
fn cpu_time() -> Duration {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let nanoseconds = text
        .split_whitespace()
        .next()
        .and_then(|number| number.parse().ok());
    Duration::from_nanos(nanoseconds.unwrap_or_else(|| panic!("this benchmark needs Linux' schedstat")))
}

fn rate(rays: u64, times: &[Duration]) -> f64 {
    rays as f64 / median(times.iter().map(Duration::as_secs_f64).collect()) / 1e6
}

/// Speed relative to the baseline, round by round.
fn median_ratio(baseline: &[Duration], times: &[Duration]) -> f64 {
    median(
        baseline
            .iter()
            .zip(times)
            .map(|(a, b)| a.as_secs_f64() / b.as_secs_f64())
            .collect(),
    )
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
