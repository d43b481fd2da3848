//! The messages: one enum per direction, one struct per message.
//!
//! On the wire a message is a map with one entry, from its name to the map of its fields:
//! `{"pong": {"nonce": 7}}`. Unknown fields are ignored; a new field needs `#[serde(default)]`.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_bytes::ByteBuf;

use crate::digest::Digest;
use crate::ids::{FrameId, WorkerId};
use crate::limits::{self, LimitError, at_most, one_to};
use crate::radiance::{Encoding, Radiance};
use crate::settings::Settings;
use crate::task::Task;

/// What a worker says to its master.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum ToMaster {
    /// First of all: who wants to join.
    Hello(Hello),
    /// A chunk of the scene is not here: please send it.
    Want(Want),
    /// The scene is in memory, its BVH built.
    Prepared(Prepared),
    /// Something could not be done; the worker stays.
    Failed(Failed),
    /// More tasks are wanted.
    Request(Request),
    /// What became of one task.
    Result(TaskResult),
    /// The answer to a `ping`.
    Pong(Pong),
    /// The worker goes; all it has done was sent before.
    Leaving(Leaving),
}

/// What a master says to a worker.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum ToWorker {
    /// The worker has joined.
    Welcome(Welcome),
    /// The worker may not join; the master closes.
    Refused(Refused),
    /// Get a scene ready.
    Prepare(Prepare),
    /// A chunk of a scene, as was asked for.
    SceneChunk(SceneChunk),
    /// A frame begins; an earlier one is over.
    Frame(Frame),
    /// Tasks to do, and how long results are of use.
    Assign(Assign),
    /// Stop, and send at once what is done.
    CutOff(CutOff),
    /// Stop; nothing of this frame is of use any more.
    EndFrame(EndFrame),
    /// Please answer.
    Ping(Ping),
    /// The master has no more work for this connection; the worker closes.
    Shutdown(Shutdown),
}

/// Who wants to join. This layout never changes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Hello {
    /// [`MAGIC`](crate::version::MAGIC).
    pub magic: String,
    /// [`PROTOCOL`](crate::version::PROTOCOL) of the worker.
    pub protocol: u32,
    /// The worker's program version, for people.
    pub version: String,
    /// The worker's name, for people; need not be unique.
    pub name: String,
    /// Threads that will render.
    pub slots: u32,
    /// Given by a master to the worker that it started itself.
    #[serde(default)]
    pub token: Option<String>,
}

/// A chunk of the scene is not here. Each of these is answered by one `scene_chunk`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Want {
    /// That of the `prepare`.
    pub digest: Digest,
    /// Which chunk, `chunk < chunks`.
    pub chunk: u32,
}

/// The scene is in memory, its BVH built.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Prepared {
    /// That of the `prepare`.
    pub digest: Digest,
    /// Time to decode the scene, in microseconds; 0 if it was still in memory.
    pub load_us: u64,
    /// Time to build the BVH, in microseconds; 0 if the scene was still in memory.
    pub bvh_us: u64,
}

/// Something could not be done.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Failed {
    /// What it was.
    pub what: FailedStep,
    /// The frame concerned, if any.
    #[serde(default)]
    pub frame: Option<FrameId>,
    /// The task concerned, if any; no result comes for it.
    #[serde(default)]
    pub task: Option<Task>,
    /// Why, for people.
    pub message: String,
}

/// What a worker could not do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FailedStep {
    /// Loading a scene: the worker can take no part until another `prepare`.
    Scene,
    /// Setting up a frame: the worker takes no part in it.
    Frame,
    /// One task.
    Task,
}

/// More tasks are wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Request {
    /// For this frame.
    pub frame: FrameId,
    /// So many *more*: the number adds to what earlier requests left open.
    pub tasks: u32,
}

/// The outcome of a task that was started: complete, or a prefix of its pixels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TaskResult {
    /// The frame.
    pub frame: FrameId,
    /// The task.
    pub task: Task,
    /// How many pixels of the group were done, in the group's order; 0 is possible.
    pub pixels: u32,
    /// `pixels` × [`floats_per_pixel`](crate::Component::floats_per_pixel) values: radiance per
    /// unit albedo, W·m⁻²·sr⁻¹; progressive: radiance, its albedo included, summed over the passes. In
    /// whatever encoding.
    pub radiance: Radiance,
    /// Rays from the camera that were traced.
    pub primary_rays: u64,
    /// Shadow rays that were traced.
    pub shadow_rays: u64,
    /// Time the slot spent, in microseconds.
    pub busy_us: u64,
}

/// The answer to a `ping`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Pong {
    /// That of the `ping`.
    pub nonce: u64,
}

/// The worker goes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Leaving {
    /// Why, for people.
    pub reason: String,
}

/// The worker has joined.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Welcome {
    /// Its number.
    pub worker: WorkerId,
    /// The master's program version, for people.
    pub version: String,
}

/// The worker may not join. This layout never changes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Refused {
    /// Why, for people.
    pub reason: String,
}

/// Get a scene ready.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Prepare {
    /// The scene.
    pub scene: SceneRef,
}

/// A scene, known by its content; see [`bundle`](crate::bundle).
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SceneRef {
    /// BLAKE3 of `bytes`, as eight little-endian bytes, and the digests of all chunks.
    pub digest: Digest,
    /// How many bytes it has.
    pub bytes: u64,
    /// BLAKE3 of each chunk of [`SCENE_CHUNK_BYTES`](limits::SCENE_CHUNK_BYTES); the last may be shorter.
    #[serde(deserialize_with = "crate::bounded::vec::<_, _, { limits::SCENE_CHUNKS }>")]
    pub chunks: Vec<Digest>,
}

/// A chunk of a scene.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SceneChunk {
    /// That of the `want`.
    pub digest: Digest,
    /// Which chunk, as in the `want`.
    pub chunk: u32,
    /// The chunk as [`pack`](crate::bundle::pack) leaves it.
    pub data: ByteBuf,
}

/// A frame begins.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Frame {
    /// Its number.
    pub frame: FrameId,
    /// What all its tasks have in common.
    pub settings: Settings,
    /// The VPLs, set by set: [`VPL_BYTES`](crate::limits::VPL_BYTES) each.
    #[serde(deserialize_with = "crate::bounded::vec::<_, _, { limits::VPL_SETS as usize }>")]
    pub vpl_sets: Vec<ByteBuf>,
    /// How results are to be packed.
    #[serde(default)]
    pub radiance: Encoding,
}

/// Tasks to do.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Assign {
    /// The frame.
    pub frame: FrameId,
    /// The tasks, most urgent first; may be none, to change only the time.
    #[serde(deserialize_with = "crate::bounded::vec::<_, _, { limits::TASKS_PER_ASSIGN }>")]
    pub tasks: Vec<Task>,
    /// So many microseconds from the reading of this message, every result must be on its way.
    /// The latest number holds for all tasks of the frame; none: no deadline.
    #[serde(default)]
    pub send_within_us: Option<u64>,
}

/// Stop, and send at once what is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CutOff {
    /// The frame.
    pub frame: FrameId,
}

/// Nothing of this frame is of use any more.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct EndFrame {
    /// The frame.
    pub frame: FrameId,
}

/// Please answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Ping {
    /// Comes back in the `pong`.
    pub nonce: u64,
}

/// The master has no more work for this connection.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Shutdown {}

/// One direction of the conversation; [`ToMaster`] and [`ToWorker`] are all there is.
pub trait Message: Serialize + DeserializeOwned + sealed::Sealed {
    /// The name on the wire.
    fn name(&self) -> &'static str;

    /// Checks every limit that the decoder itself cannot.
    fn check(&self) -> Result<(), LimitError>;

    /// About how many bytes of pixels and the like a buffer for it should have room for.
    fn bulk_bytes(&self) -> usize;

    /// Whether it goes before messages that wait and are not urgent. Messages that are equally urgent
    /// keep their order.
    fn is_urgent(&self) -> bool;
}

impl Message for ToMaster {
    fn name(&self) -> &'static str {
        match self {
            Self::Hello(_) => "hello",
            Self::Want(_) => "want",
            Self::Prepared(_) => "prepared",
            Self::Failed(_) => "failed",
            Self::Request(_) => "request",
            Self::Result(_) => "result",
            Self::Pong(_) => "pong",
            Self::Leaving(_) => "leaving",
        }
    }

    fn check(&self) -> Result<(), LimitError> {
        match self {
            Self::Hello(hello) => hello.check(),
            Self::Failed(failed) => at_most("failed.message", failed.message.len(), limits::TEXT_BYTES),
            Self::Request(request) => one_to("request.tasks", request.tasks, limits::leases(limits::SLOTS)),
            Self::Result(result) => result.check(),
            Self::Want(_) | Self::Prepared(_) | Self::Pong(_) => Ok(()),
            Self::Leaving(leaving) => at_most("leaving.reason", leaving.reason.len(), limits::TEXT_BYTES),
        }
    }

    fn bulk_bytes(&self) -> usize {
        match self {
            Self::Result(result) => result.radiance.bytes(),
            _ => 0,
        }
    }

    /// Requests are not: what they ask for is paid for by the results before them.
    fn is_urgent(&self) -> bool {
        matches!(self, Self::Want(_) | Self::Pong(_))
    }
}

impl Message for ToWorker {
    fn name(&self) -> &'static str {
        match self {
            Self::Welcome(_) => "welcome",
            Self::Refused(_) => "refused",
            Self::Prepare(_) => "prepare",
            Self::SceneChunk(_) => "scene_chunk",
            Self::Frame(_) => "frame",
            Self::Assign(_) => "assign",
            Self::CutOff(_) => "cut_off",
            Self::EndFrame(_) => "end_frame",
            Self::Ping(_) => "ping",
            Self::Shutdown(_) => "shutdown",
        }
    }

    fn check(&self) -> Result<(), LimitError> {
        match self {
            Self::Welcome(welcome) => {
                at_most("welcome.version", welcome.version.len(), limits::VERSION_BYTES)
            }
            Self::Refused(refused) => at_most("refused.reason", refused.reason.len(), limits::TEXT_BYTES),
            Self::Prepare(prepare) => prepare.scene.check(),
            Self::SceneChunk(chunk) => chunk.check(),
            Self::Frame(frame) => frame.check(),
            Self::Assign(assign) => check_tasks(assign.tasks.len()),
            Self::CutOff(_) | Self::EndFrame(_) | Self::Ping(_) | Self::Shutdown(_) => Ok(()),
        }
    }

    fn bulk_bytes(&self) -> usize {
        match self {
            Self::Frame(frame) => frame.vpl_sets.iter().map(|set| set.len() + 5).sum(),
            Self::Prepare(prepare) => prepare.scene.chunks.len() * (limits::DIGEST_BYTES + 2),
            Self::SceneChunk(chunk) => chunk.data.len(),
            _ => 0,
        }
    }

    /// A scene must not delay the frame of another one, nor a ping.
    fn is_urgent(&self) -> bool {
        !matches!(self, Self::SceneChunk(_))
    }
}

impl Hello {
    fn check(&self) -> Result<(), LimitError> {
        at_most("hello.magic", self.magic.len(), limits::NAME_BYTES)?;
        at_most("hello.version", self.version.len(), limits::VERSION_BYTES)?;
        at_most("hello.name", self.name.len(), limits::NAME_BYTES)?;
        at_most(
            "hello.token",
            self.token.as_ref().map_or(0, String::len),
            limits::TOKEN_BYTES,
        )?;
        one_to("hello.slots", self.slots, limits::SLOTS)?;
        if self.name.chars().any(char::is_control) {
            let (value, allowed) = (
                format!("{:?}", self.name),
                "text without control characters".to_owned(),
            );
            return Err(LimitError {
                what: "hello.name",
                value,
                allowed,
            });
        }
        Ok(())
    }
}

impl TaskResult {
    fn check(&self) -> Result<(), LimitError> {
        if self.pixels > limits::GROUP_PIXELS {
            let (value, allowed) = (self.pixels.to_string(), format!("0 to {}", limits::GROUP_PIXELS));
            return Err(LimitError {
                what: "result.pixels",
                value,
                allowed,
            });
        }
        let values = self.pixels as usize * self.task.component.floats_per_pixel();
        if self.radiance.values() != Some(values) {
            let value = format!("{} bytes", self.radiance.bytes());
            let allowed = format!(
                "{values} values for {} pixels of a {} task",
                self.pixels,
                self.task.component.name()
            );
            return Err(LimitError {
                what: "result.radiance",
                value,
                allowed,
            });
        }
        Ok(())
    }
}

impl SceneRef {
    fn check(&self) -> Result<(), LimitError> {
        if !(1..=limits::SCENE_BYTES).contains(&self.bytes) {
            return Err(LimitError {
                what: "prepare.scene.bytes",
                value: self.bytes.to_string(),
                allowed: format!("1 to {}", limits::SCENE_BYTES),
            });
        }
        let chunks = self.bytes.div_ceil(limits::SCENE_CHUNK_BYTES as u64);
        if self.chunks.len() as u64 != chunks {
            return Err(LimitError {
                what: "prepare.scene.chunks (count)",
                value: self.chunks.len().to_string(),
                allowed: format!("{chunks} for {} bytes", self.bytes),
            });
        }
        Ok(())
    }
}

impl SceneChunk {
    fn check(&self) -> Result<(), LimitError> {
        at_most("scene_chunk.data", self.data.len(), limits::SCENE_CHUNK_BYTES)
    }
}

impl Frame {
    fn check(&self) -> Result<(), LimitError> {
        self.settings.check()?;
        at_most(
            "frame.vpl_sets (count)",
            self.vpl_sets.len(),
            limits::VPL_SETS as usize,
        )?;
        let bytes = self.vpl_sets.iter().map(|set| set.len()).sum();
        at_most("frame.vpl_sets", bytes, limits::VPLS as usize * limits::VPL_BYTES)
    }
}

fn check_tasks(tasks: usize) -> Result<(), LimitError> {
    if tasks <= limits::TASKS_PER_ASSIGN {
        return Ok(());
    }
    let (value, allowed) = (tasks.to_string(), format!("0 to {}", limits::TASKS_PER_ASSIGN));
    Err(LimitError {
        what: "assign.tasks",
        value,
        allowed,
    })
}

/// A text for a message's `reason` or `message`, shortened to what may be sent.
pub fn text(text: impl Into<String>) -> String {
    let mut text = text.into();
    let mut end = text.len().min(limits::TEXT_BYTES);
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    text.truncate(end);
    text
}

mod sealed {
    pub trait Sealed {}
    impl Sealed for super::ToMaster {}
    impl Sealed for super::ToWorker {}
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hello() -> Hello {
        Hello {
            magic: crate::version::MAGIC.to_owned(),
            protocol: crate::version::PROTOCOL,
            version: "0.1.0".to_owned(),
            name: "lab-7".to_owned(),
            slots: 4,
            token: None,
        }
    }

    fn refused(change: impl FnOnce(&mut Hello)) -> &'static str {
        let mut hello = hello();
        change(&mut hello);
        hello.check().unwrap_err().what
    }

    #[test]
    fn a_hello_is_held_to_its_limits() {
        assert_eq!(hello().check(), Ok(()));
        assert_eq!(refused(|h| h.name = "x".repeat(1_000_000)), "hello.name");
        assert_eq!(refused(|h| h.name = "\u{1b}[2Jgone".to_owned()), "hello.name");
        assert_eq!(refused(|h| h.slots = 0), "hello.slots");
        assert_eq!(refused(|h| h.slots = 1_000_000), "hello.slots");
        assert_eq!(refused(|h| h.token = Some("x".repeat(200))), "hello.token");
    }

    #[test]
    fn a_result_has_exactly_the_values_of_its_pixels() {
        let task = Task {
            component: crate::Component::Full,
            group: 3,
            index: 0,
            passes: 1,
        };
        let result = |pixels, values| TaskResult {
            frame: FrameId(1),
            task,
            pixels,
            radiance: Radiance::pack(&vec![0.0; values], Encoding::SharedExponent),
            primary_rays: 0,
            shadow_rays: 0,
            busy_us: 0,
        };
        assert_eq!(result(2, 12).check(), Ok(()));
        assert_eq!(result(0, 0).check(), Ok(()));
        assert_eq!(result(2, 6).check().unwrap_err().what, "result.radiance");
        assert_eq!(
            result(limits::GROUP_PIXELS + 1, 0).check().unwrap_err().what,
            "result.pixels"
        );
    }

    #[test]
    fn a_scene_names_exactly_the_chunks_that_it_has() {
        let scene = |bytes, chunks| SceneRef {
            bytes,
            chunks: vec![Digest::of(b"red"); chunks],
            digest: Digest::of(b"red"),
        };
        let refused = |bytes, chunks| scene(bytes, chunks).check().unwrap_err().what;
        assert_eq!(scene(limits::SCENE_CHUNK_BYTES as u64 + 1, 2).check(), Ok(()));
        assert_eq!(scene(limits::SCENE_BYTES, limits::SCENE_CHUNKS).check(), Ok(()));
        assert_eq!(refused(0, 0), "prepare.scene.bytes");
        assert_eq!(
            refused(limits::SCENE_BYTES + 1, limits::SCENE_CHUNKS),
            "prepare.scene.bytes"
        );
        assert_eq!(refused(100, 2), "prepare.scene.chunks (count)");
        assert_eq!(refused(limits::SCENE_BYTES, 1), "prepare.scene.chunks (count)");
    }

    #[test]
    fn a_long_text_is_cut_between_characters() {
        let long = "é".repeat(limits::TEXT_BYTES);
        assert_eq!(text(long).len(), limits::TEXT_BYTES);
        assert_eq!(
            text(format!("a{}", "é".repeat(limits::TEXT_BYTES))).len(),
            limits::TEXT_BYTES - 1
        );
        assert_eq!(text("short"), "short");
    }
}
