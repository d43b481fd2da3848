//! One frame on the virtual grid: `master`'s scheduler, driven by a simulated clock.

use std::{
    cmp::Reverse,
    collections::{BTreeMap, BinaryHeap},
    time::Duration,
};

use master::{
    frame_time::FrameTime,
    plan::TaskQueues,
    scheduler::{Action, Closing, Event, Extent, Promise, Scheduler, Tally, WorkerId},
};
use protocol::limits::LEASES_PER_SLOT;
use render::{
    settings::Settings,
    task::{Component, Task},
};

use super::{
    cores::{Core, Ending, first_requests},
    link::Link,
    parameters::{Grid, Network},
    script::Script,
};

/// What a task asks of a core and of the network.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TaskCost {
    /// Pixels of its group.
    pub pixels: u32,
    /// Pixels that are done or not done together.
    pub chunk_pixels: u32,
    /// Rays for all of them.
    pub rays: u64,
    /// Numbers in its result for each pixel.
    pub floats_per_pixel: usize,
}

/// Knows what each task costs.
pub trait Workload {
    /// The cost of a task of the frame.
    fn cost(&self, task: Task) -> TaskCost;
}

/// The circumstances of a frame.
#[derive(Debug, Clone, Copy)]
pub struct Circumstances<'a> {
    /// The machines.
    pub grid: &'a Grid,
    /// The way to the master and back.
    pub network: &'a Network,
    /// Speed of a core in this scene.
    pub core_rays_per_s: f64,
    /// Who comes and goes.
    pub script: &'a Script,
    /// When the last result counts; `None`: the full workload is done, however long it takes.
    pub deadline: Option<Duration>,
}

/// A frame as it went.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// Every result that counted, in the order of arrival.
    pub results: Vec<Arrival>,
    /// The scheduler's counts.
    pub tallies: BTreeMap<Component, Tally>,
    /// Results that came too late.
    pub late: u64,
    /// When and why the scheduler closed the frame.
    pub closed: Option<(Duration, Closing)>,
    /// Cores that are there from each moment on.
    pub cores: Vec<(Duration, u32)>,
}

/// A result that counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Arrival {
    /// When.
    pub at: Duration,
    /// Of what.
    pub task: Task,
    /// Length of the finished beginning of its group.
    pub pixels: u32,
    /// Whether that is all of it.
    pub whole: bool,
}

impl Run {
    /// Whole results of a component.
    pub fn completed(&self, component: Component) -> u32 {
        self.tallies.get(&component).map_or(0, |tally| tally.completed)
    }

    /// Whole results that had arrived by a moment.
    pub fn completed_by(&self, at: Duration) -> u32 {
        let whole = self
            .results
            .iter()
            .filter(|result| result.whole && result.at <= at);
        whole.count() as u32
    }
}

/// Renders one frame on the grid.
///
/// Equal arguments give an equal run.
pub fn simulate(circumstances: &Circumstances<'_>, settings: &Settings, workload: &dyn Workload) -> Run {
    let mut simulation = Simulation::new(circumstances, settings, workload);
    while let Some(Reverse(next)) = simulation.agenda.pop() {
        simulation.happen(next.at, next.what);
    }
    simulation.run.tallies = simulation.scheduler.tallies().clone();
    simulation.run.late = simulation.scheduler.late_results();
    simulation.run
}

/// What is going to happen; of two things at one moment, first what was put down first.
#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Appointment {
    at: Duration,
    number: u64,
    what: Happening,
}

#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Happening {
    /// A core asks for its first task.
    Joins(usize),
    /// The script adds machines.
    MachinesJoin(u32),
    /// The script removes machines.
    MachinesLeave(u32),
    /// A core hears when it must have sent what it has.
    Hears(usize, Duration),
    /// Tasks reach a core.
    Gets(usize, Vec<Task>),
    /// A core ends a task with so many pixels done.
    Ends(usize, Task, u32),
    /// A message reaches the master.
    Master(usize, ToMaster),
    /// The cut-off has come.
    CutOff,
}

#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
enum ToMaster {
    Ready,
    Result(Task, u32),
    Gone,
}

struct Simulation<'a> {
    circumstances: Circumstances<'a>,
    workload: &'a dyn Workload,
    scheduler: Scheduler,
    link: Link,
    cores: Vec<Core>,
    /// The cores of each machine that is there; those that came last are last.
    machines: Vec<Vec<usize>>,
    agenda: BinaryHeap<Reverse<Appointment>>,
    appointments: u64,
    run: Run,
}

impl<'a> Simulation<'a> {
    fn new(circumstances: &Circumstances<'a>, settings: &Settings, workload: &'a dyn Workload) -> Self {
        let promise = match circumstances.deadline {
            Some(_) => Promise::Deadline,
            None => Promise::FullWorkload,
        };
        let mut simulation = Self {
            circumstances: *circumstances,
            workload,
            scheduler: Scheduler::new(TaskQueues::new(settings), promise, LEASES_PER_SLOT),
            link: Link::new(circumstances.network),
            cores: Vec::new(),
            machines: Vec::new(),
            agenda: BinaryHeap::new(),
            appointments: 0,
            run: Run {
                results: Vec::new(),
                tallies: BTreeMap::new(),
                late: 0,
                closed: None,
                cores: Vec::new(),
            },
        };
        if let Some(deadline) = circumstances.deadline {
            let at = FrameTime::after_start(deadline);
            simulation.decide(Duration::ZERO, Event::CutOff { at }, 0);
            simulation.expect(deadline, Happening::CutOff);
        }
        simulation.first_machines();
        for change in &circumstances.script.changes {
            simulation.expect(change.at(), Happening::MachinesJoin(change.join));
            simulation.expect(change.at(), Happening::MachinesLeave(change.leave));
        }
        simulation
    }

    fn first_machines(&mut self) {
        let Circumstances { grid, script, .. } = self.circumstances;
        let machines = script.machines.unwrap_or(grid.machines);
        let moments = first_requests(grid, machines * grid.cores_per_machine);
        self.machines_join(Duration::ZERO, machines, |core| {
            Duration::from_secs_f64(moments[core])
        });
    }

    fn expect(&mut self, at: Duration, what: Happening) {
        let number = self.appointments;
        self.appointments += 1;
        self.agenda.push(Reverse(Appointment { at, number, what }));
    }

    fn happen(&mut self, now: Duration, what: Happening) {
        match what {
            Happening::Joins(core) if self.cores[core].is_present() => self.say(now, core, ToMaster::Ready),
            Happening::MachinesJoin(count) => {
                let delay = Duration::from_secs_f64(self.circumstances.grid.first_request_s[0]);
                self.machines_join(now, count, |_| now + delay);
            }
            Happening::MachinesLeave(count) => self.machines_leave(now, count),
            Happening::Hears(core, send_by) => self.cores[core].set_send_by(send_by),
            Happening::Gets(core, tasks) => {
                self.cores[core].take(tasks);
                self.begin(now, core);
            }
            Happening::Ends(core, task, pixels) if self.cores[core].is_present() => {
                self.cores[core].rest();
                self.say(now, core, ToMaster::Result(task, pixels));
                self.begin(now, core);
            }
            // Their core has left meanwhile, and nobody will ever know.
            Happening::Joins(_) | Happening::Ends(..) => {}
            Happening::Master(core, message) => self.hear(now, core, &message),
            Happening::CutOff => self.decide(now, Event::Tick, 0),
        }
    }

    fn machines_join(&mut self, now: Duration, count: u32, first_request: impl Fn(usize) -> Duration) {
        let Circumstances {
            grid,
            core_rays_per_s,
            ..
        } = self.circumstances;
        for _ in 0..count {
            let first = self.cores.len();
            let cores: Vec<usize> = (first..first + grid.cores_per_machine as usize).collect();
            for &core in &cores {
                self.cores.push(Core::new(grid, core_rays_per_s, core as u32));
                self.expect(first_request(core), Happening::Joins(core));
            }
            self.machines.push(cores);
        }
        self.note_cores(now);
    }

    fn machines_leave(&mut self, now: Duration, count: u32) {
        for _ in 0..count {
            for core in self.machines.pop().unwrap_or_default() {
                self.cores[core].leave();
                self.say(now, core, ToMaster::Gone);
            }
        }
        self.note_cores(now);
    }

    fn note_cores(&mut self, now: Duration) {
        let cores = self.machines.iter().map(|cores| cores.len() as u32).sum();
        if self.run.cores.last().is_none_or(|&(_, before)| before != cores) {
            self.run.cores.push((now, cores));
        }
    }

    fn begin(&mut self, now: Duration, core: usize) {
        let workload = self.workload;
        if let Some(Ending { at, task, pixels }) = self.cores[core].begin(now, |task| workload.cost(task)) {
            self.expect(at, Happening::Ends(core, task, pixels));
        }
    }

    /// A core sends a message.
    fn say(&mut self, now: Duration, core: usize, message: ToMaster) {
        let bytes = match message {
            ToMaster::Result(task, pixels) => {
                size_of::<f32>() * self.workload.cost(task).floats_per_pixel * pixels as usize
            }
            ToMaster::Ready | ToMaster::Gone => 0,
        };
        let at = self.link.arrival_at_master(now, bytes);
        self.expect(at, Happening::Master(core, message));
    }

    /// The master gets a message. "Each idle worker sends a request to ask for work": one task with
    /// its greeting, one with each result.
    fn hear(&mut self, now: Duration, core: usize, message: &ToMaster) {
        let worker = WorkerId(core as u32);
        let request = Event::Request { worker, count: 1 };
        match *message {
            ToMaster::Ready => {
                let delta_t = self.circumstances.network.delta_t();
                self.decide(now, Event::WorkerReady { worker, slots: 1 }, 0);
                self.decide(now, Event::DeltaT { worker, delta_t }, 0);
                self.decide(now, request, 0);
            }
            ToMaster::Result(task, pixels) => {
                let extent = match pixels {
                    0 => Extent::Nothing,
                    pixels if pixels < self.workload.cost(task).pixels => Extent::Prefix,
                    _ => Extent::Whole,
                };
                let completed = Event::Completed {
                    worker,
                    task,
                    extent,
                    busy: Duration::ZERO,
                };
                self.decide(now, completed, pixels);
                self.decide(now, request, 0);
            }
            ToMaster::Gone => self.decide(now, Event::WorkerLeft { worker }, 0),
        }
    }

    /// Gives the scheduler one event and does what it says. `pixels` are those of the event's result.
    fn decide(&mut self, now: Duration, event: Event, pixels: u32) {
        self.scheduler.handle(FrameTime::after_start(now), event);
        while let Some(action) = self.scheduler.poll_action() {
            let reaches_worker_at = self.link.arrival_at_worker(now);
            match action {
                Action::Assign { worker, tasks } => {
                    self.expect(reaches_worker_at, Happening::Gets(worker.0 as usize, tasks));
                }
                Action::SendBy { worker, at } => {
                    self.expect(
                        reaches_worker_at,
                        Happening::Hears(worker.0 as usize, at.elapsed()),
                    );
                }
                Action::Add { task, .. } => self.run.results.push(Arrival {
                    at: now,
                    task,
                    pixels,
                    whole: pixels == self.workload.cost(task).pixels,
                }),
                Action::Close(closing) => self.run.closed = Some((now, closing)),
                Action::Disconnect { worker, fault } => {
                    // A worker whose last words were under way when it left; the simulated ones never
                    // break a rule otherwise.
                    debug_assert!(!self.cores[worker.0 as usize].is_present(), "{worker}: {fault}");
                }
            }
        }
    }
}
