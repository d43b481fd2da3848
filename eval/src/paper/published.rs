//! The numbers of the paper: Aggarwal, Debattista, Dubla, Bashford-Rogers and Chalmers,
//! "Time-constrained High-fidelity Rendering on Local Desktop Grids", Tables 1 and 2 and section 4.2.

/// One line of Tables 1 and 2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row {
    /// As the paper calls it.
    pub scene: &'static str,
    /// Time-constraint, seconds.
    pub deadline_s: u32,
    /// Direct tasks completed by the component-based algorithm.
    pub direct_tasks: u32,
    /// Indirect tasks completed by the component-based algorithm.
    pub indirect_tasks: u32,
    /// Reconstructed pixels of direct light, percent.
    pub direct_percent: f64,
    /// Reconstructed pixels of indirect light, percent.
    pub indirect_percent: f64,
    /// Tasks completed by the straightforward algorithm.
    pub straightforward_tasks: u32,
    /// Reconstructed pixels of the straightforward algorithm, percent.
    pub straightforward_percent: f64,
    /// VDP(P > 75 %) of the component-based algorithm, percent.
    pub component_vdp: f64,
    /// VDP(P > 75 %) of the straightforward algorithm, percent.
    pub straightforward_vdp: f64,
}

/// Tables 1 and 2, in the order of Table 1 and by ascending deadline.
pub const ROWS: [Row; 9] = [
    row(
        "Conference Room",
        4,
        (214, 214, 0.0, 52.45),
        (479, 76.66),
        (25.98, 30.47),
    ),
    row(
        "Conference Room",
        8,
        (515, 514, 0.0, 0.0),
        (991, 51.66),
        (12.31, 17.0),
    ),
    row(
        "Conference Room",
        10,
        (727, 726, 0.0, 29.10),
        (1586, 22.6),
        (9.55, 11.54),
    ),
    row("Sibenik", 3, (95, 94, 0.0, 51.66), (298, 85.5), (17.58, 54.35)),
    row("Sibenik", 5, (154, 154, 0.0, 52.34), (663, 67.68), (15.78, 30.71)),
    row("Sibenik", 10, (653, 653, 0.0, 36.34), (1440, 29.75), (1.55, 7.89)),
    row(
        "Cornell Box",
        2,
        (21, 21, 67.18, 67.23),
        (130, 93.7),
        (13.43, 13.99),
    ),
    row(
        "Cornell Box",
        4,
        (124, 123, 0.0, 51.95),
        (565, 72.46),
        (6.72, 7.27),
    ),
    row(
        "Cornell Box",
        6,
        (377, 377, 0.0, 50.91),
        (1125, 45.12),
        (4.41, 4.44),
    ),
];

/// VDP(P > 75 %) of the Conference Room at 10 s with 14 machines growing to 24, percent.
pub const GROWING_VDP: f64 = 11.15;
/// VDP(P > 75 %) of the Conference Room at 10 s with 24 machines shrinking to 14, percent.
pub const SHRINKING_VDP: f64 = 11.31;

const fn row(
    scene: &'static str,
    deadline_s: u32,
    component: (u32, u32, f64, f64),
    straightforward: (u32, f64),
    vdp: (f64, f64),
) -> Row {
    Row {
        scene,
        deadline_s,
        direct_tasks: component.0,
        indirect_tasks: component.1,
        direct_percent: component.2,
        indirect_percent: component.3,
        straightforward_tasks: straightforward.0,
        straightforward_percent: straightforward.1,
        component_vdp: vdp.0,
        straightforward_vdp: vdp.1,
    }
}
