//! The light is right: VPLs and paths, two ways of computing it that share no more than the scene and
//! its surfaces, agree on the whole and in every corner.
//!
//! What must agree is what the master writes: 16,384 VPLs without a bound on their geometry term
//! against a path-traced reference, in mean radiance within 1.5 %, and in 95 % of the means of 16×16
//! blocks within 3 %. `bench/light/run.sh` measures that at full size, by a test that is skipped
//! otherwise. Here
//! the pictures are small, and so are the limits that their noise allows: bias shows in the mean.

#![expect(
    clippy::print_stdout,
    reason = "the rows of the table that bench/light/run.sh prints"
)]

use std::env;

use gridlight::{master::Master, oiio::assert_finite, pixels::Pixels, programs::skipped, scenes::scene};

/// Largest difference of the mean radiance.
const MEAN_WITHIN: f64 = 0.015;
/// Pixels on a block's side.
const BLOCK_SIDE: usize = 16;

/// How well the blocks must agree.
#[derive(Debug, Clone, Copy)]
struct Blocks {
    /// A block agrees if its mean differs by no more than this.
    within: f64,
    /// Share of the blocks that must agree.
    agreeing: f64,
}

/// The aim, at full size.
const AIM: Blocks = Blocks {
    within: 0.03,
    agreeing: 0.95,
};

/// The relative differences of a picture and the reference.
#[derive(Debug)]
struct Differences {
    /// Of the mean radiance.
    mean: f64,
    /// Of the blocks' means, smallest first.
    blocks: Vec<f64>,
}

impl Differences {
    fn of(picture: &Pixels, reference: &Pixels) -> Self {
        let expected = reference.block_means(BLOCK_SIDE);
        let pairs = picture.block_means(BLOCK_SIDE).into_iter().zip(expected);
        // Where the camera sees nothing there is nothing to agree on.
        let lit = pairs.filter(|&(_, expected)| expected > 0.0);
        let mut blocks: Vec<f64> = lit
            .map(|(value, expected)| (value / expected - 1.0).abs())
            .collect();
        blocks.sort_by(f64::total_cmp);
        Self {
            mean: picture.mean_radiance() / reference.mean_radiance() - 1.0,
            blocks,
        }
    }

    /// Share of the blocks that differ by no more than this.
    fn share_within(&self, difference: f64) -> f64 {
        self.blocks.partition_point(|&block| block <= difference) as f64 / self.blocks.len() as f64
    }

    /// The difference that this share of the blocks stays within.
    fn quantile(&self, share: f64) -> f64 {
        self.blocks[(share * self.blocks.len() as f64).ceil() as usize - 1]
    }

    fn are_within(&self, limits: Blocks) -> bool {
        self.mean.abs() <= MEAN_WITHIN && self.share_within(limits.within) >= limits.agreeing
    }
}

/// The workload of both sides.
#[derive(Debug, Clone, Copy)]
struct Effort {
    algorithm: &'static str,
    size: &'static str,
    light_samples: u32,
    vpls: u32,
    paths: u32,
}

/// Renders both and prints a row of the table.
fn compare(name: &str, effort: Effort) -> Differences {
    let Effort {
        algorithm,
        size,
        light_samples,
        vpls,
        paths,
    } = effort;
    let render = |flags: String| {
        let master = Master::new(&format!("--no-deadline --no-png --size {size} {flags}"));
        let picture = master.scene(scene(name)).deliver();
        assert_finite(picture.exr());
        (picture.pixels(), picture.number("/seconds/tracing"))
    };
    // The progressive algorithm takes one set in each pass.
    let sets = match algorithm {
        "progressive" => vpls / 16,
        _ => 64,
    };
    let sides = format!("--algorithm {algorithm}");
    let flags = format!("{sides} --clamp none --vpls {vpls} --vpl-sets {sets} --spp {light_samples}");
    let (by_vpls, vpls_s) = render(flags);
    let (by_paths, paths_s) = render(format!("{sides} --integrator path --spp {paths}"));
    let differences = Differences::of(&by_vpls, &by_paths);
    let effort = format!("| {name} | {size} | {vpls} | {light_samples} | {paths} |");
    let [mean, share, quantile] = [
        differences.mean,
        differences.share_within(AIM.within),
        differences.quantile(AIM.agreeing),
    ]
    .map(|part| 100.0 * part);
    println!("{effort} {mean:+.2} % | {share:.1} % | {quantile:.2} % | {vpls_s:.0} s | {paths_s:.0} s |");
    differences
}

#[test]
fn the_light_of_the_cornell_box_is_right() {
    let effort = Effort {
        algorithm: "component",
        size: "128x128",
        light_samples: 512,
        vpls: 16_384,
        paths: 512,
    };
    let differences = compare("cornell-box", effort);
    assert!(differences.are_within(AIM), "{differences:?}");
}

/// Antialiased on both sides.
#[test]
fn the_light_of_the_progressive_algorithm_is_right() {
    let effort = Effort {
        algorithm: "progressive",
        size: "128x128",
        light_samples: 512,
        vpls: 16_384,
        paths: 512,
    };
    let differences = compare("cornell-box", effort);
    assert!(differences.are_within(AIM), "{differences:?}");
}

#[test]
fn the_light_of_the_nave_is_right() {
    let effort = Effort {
        algorithm: "component",
        size: "128x96",
        light_samples: 256,
        vpls: 16_384,
        paths: 384,
    };
    let differences = compare("nave", effort);
    // Two pictures of other seeds differ as much: where stone meets stone, a VPL that happens to stand
    // next to a pixel's point brightens its block.
    let limits = Blocks {
        within: 0.06,
        agreeing: 0.95,
    };
    assert!(differences.are_within(limits), "{differences:?}");
}

/// The measurement of `bench/light/run.sh`.
#[test]
fn the_light_is_right_at_full_size() {
    let Ok(paths) = env::var("GRIDLIGHT_PATHS") else {
        return skipped(
            "the light at full size",
            "it takes an hour; bench/light/run.sh sets GRIDLIGHT_PATHS and runs it",
        );
    };
    let paths = paths.parse().expect("a number of paths");
    let measured = [("cornell-box", "512x512"), ("nave", "1024x768")].map(|(name, size)| {
        let effort = Effort {
            algorithm: "component",
            size,
            light_samples: 1024,
            vpls: 16_384,
            paths,
        };
        (name, compare(name, effort))
    });
    for (name, differences) in measured {
        assert!(differences.are_within(AIM), "{name} is not within {AIM:?}");
    }
}

/// The measure can fail: what is wrong by little is beyond it.
#[test]
fn a_wrong_light_does_not_agree() {
    let render = |flags: &str| {
        let flags = format!("--algorithm component --no-deadline --no-png --size 64x64 {flags}");
        Master::new(&flags).deliver().pixels()
    };
    let right = render("");
    assert!(Differences::of(&right, &right).are_within(AIM));
    // A bound that takes a little light away.
    let bounded = render("--clamp 1e-5");
    assert!(!Differences::of(&bounded, &right).are_within(AIM));
    // So few VPLs that each leaves its mark.
    let noisy = render("--vpls 8 --vpl-sets 1");
    assert!(!Differences::of(&noisy, &right).are_within(AIM));
}
