//! Any message survives its envelope, however the bytes are cut; no bytes do harm.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on should stop")]

use proptest::collection::vec;
use proptest::option;
use proptest::prelude::*;
use proptest::test_runner::FileFailurePersistence;
use protocol::envelope::{Decoded, Decoder, EnvelopeError, encode};
use protocol::message::*;
use protocol::radiance::Encoding;
use protocol::settings::{Algorithm, LightPoints, Settings};
use protocol::{Component, Digest, FrameId, Radiance, Task, ToMaster, ToWorker, WorkerId, limits};
use serde_bytes::ByteBuf;

fn component() -> impl Strategy<Value = Component> {
    prop_oneof![
        Just(Component::Direct),
        Just(Component::Indirect),
        Just(Component::Full)
    ]
}

fn task() -> impl Strategy<Value = Task> {
    (component(), any::<u32>(), any::<u32>()).prop_map(|(component, group, index)| Task {
        component,
        group,
        index,
        passes: 1,
    })
}

fn frame() -> impl Strategy<Value = FrameId> {
    any::<u32>().prop_map(FrameId)
}

fn text(bytes: usize) -> impl Strategy<Value = String> {
    // At most four bytes of UTF-8 for each character.
    vec(any::<char>(), 0..=bytes / 4).prop_map(String::from_iter)
}

fn name() -> impl Strategy<Value = String> {
    text(limits::NAME_BYTES).prop_map(|name| name.replace(char::is_control, "-").chars().take(16).collect())
}

fn hello() -> impl Strategy<Value = Hello> {
    let token = option::of(text(limits::TOKEN_BYTES));
    (text(64), any::<u32>(), text(64), name(), 1..=limits::SLOTS, token).prop_map(
        |(magic, protocol, version, name, slots, token)| Hello {
            magic,
            protocol,
            version,
            name,
            slots,
            token,
        },
    )
}

fn encoding() -> impl Strategy<Value = Encoding> {
    prop_oneof![
        Just(Encoding::Exact),
        Just(Encoding::Half),
        Just(Encoding::SharedExponent)
    ]
}

fn result() -> impl Strategy<Value = TaskResult> {
    let rays = (any::<u64>(), any::<u64>(), any::<u64>());
    let light = (any::<f32>(), encoding());
    (frame(), task(), 0..3000_u32, light, rays).prop_map(|(frame, task, pixels, (first, encoding), rays)| {
        let values = pixels as usize * task.component.floats_per_pixel();
        let mut radiance = vec![0.5; values];
        if let Some(value) = radiance.first_mut()
            && !first.is_nan()
        {
            *value = first;
        }
        TaskResult {
            frame,
            task,
            pixels,
            radiance: Radiance::pack(&radiance, encoding),
            primary_rays: rays.0,
            shadow_rays: rays.1,
            busy_us: rays.2,
        }
    })
}

fn failed() -> impl Strategy<Value = Failed> {
    let what = prop_oneof![
        Just(FailedStep::Scene),
        Just(FailedStep::Frame),
        Just(FailedStep::Task)
    ];
    (
        what,
        option::of(frame()),
        option::of(task()),
        text(limits::TEXT_BYTES),
    )
        .prop_map(|(what, frame, task, message)| Failed {
            what,
            frame,
            task,
            message,
        })
}

fn digest() -> impl Strategy<Value = Digest> {
    any::<[u8; limits::DIGEST_BYTES]>().prop_map(Digest)
}

fn to_master() -> impl Strategy<Value = ToMaster> {
    prop_oneof![
        (digest(), any::<u32>()).prop_map(|(digest, chunk)| ToMaster::Want(Want { digest, chunk })),
        hello().prop_map(ToMaster::Hello),
        (digest(), any::<u64>(), any::<u64>()).prop_map(|(digest, load_us, bvh_us)| ToMaster::Prepared(
            Prepared {
                digest,
                load_us,
                bvh_us
            }
        )),
        failed().prop_map(ToMaster::Failed),
        (frame(), 1..=limits::SLOTS).prop_map(|(frame, tasks)| ToMaster::Request(Request { frame, tasks })),
        result().prop_map(ToMaster::Result),
        any::<u64>().prop_map(|nonce| ToMaster::Pong(Pong { nonce })),
        text(limits::TEXT_BYTES).prop_map(|reason| ToMaster::Leaving(Leaving { reason })),
    ]
}

fn settings() -> impl Strategy<Value = Settings> {
    let algorithm = prop_oneof![Just(Algorithm::Component), Just(Algorithm::Straightforward)];
    let light_points = prop_oneof![Just(LightPoints::PerPass), Just(LightPoints::PerPixel)];
    let size = (1..4000_u32, 1..4000_u32, 16..=limits::GROUPS);
    let light = (
        1..=limits::SPP,
        1..=limits::VPLS,
        1..=limits::VPL_SETS,
        option::of(1e-6..1e6_f32),
    );
    (algorithm, light_points, size, light, any::<u64>()).prop_map(
        |(algorithm, light_points, size, light, seed)| Settings {
            algorithm,
            width: size.0,
            height: size.1,
            groups: size.2,
            spp: light.0,
            vpls: light.1,
            vpl_sets: light.2,
            seed,
            geometry_clamp: light.3,
            light_points,
        },
    )
}

fn to_worker() -> impl Strategy<Value = ToWorker> {
    let sets = vec(vec(any::<u8>(), 0..200).prop_map(ByteBuf::from), 0..20);
    let scene = vec(digest(), 1..20).prop_map(|chunks| SceneRef {
        digest: chunks[0],
        bytes: (chunks.len() * limits::SCENE_CHUNK_BYTES) as u64,
        chunks,
    });
    let chunk = (digest(), any::<u32>(), vec(any::<u8>(), 0..2_000));
    let tasks = vec(task(), 0..=limits::TASKS_PER_ASSIGN / 8);
    prop_oneof![
        (any::<u32>(), text(limits::VERSION_BYTES)).prop_map(|(id, version)| ToWorker::Welcome(Welcome {
            worker: WorkerId(id),
            version
        })),
        text(limits::TEXT_BYTES).prop_map(|reason| ToWorker::Refused(Refused { reason })),
        scene.prop_map(|scene| ToWorker::Prepare(Prepare { scene })),
        chunk.prop_map(|(digest, chunk, data)| ToWorker::SceneChunk(SceneChunk {
            digest,
            chunk,
            data: ByteBuf::from(data),
        })),
        (frame(), settings(), sets, encoding()).prop_map(|(frame, settings, vpl_sets, radiance)| {
            ToWorker::Frame(Frame {
                frame,
                settings,
                vpl_sets,
                radiance,
            })
        }),
        (frame(), tasks, option::of(any::<u64>())).prop_map(|(frame, tasks, send_within_us)| {
            ToWorker::Assign(Assign {
                frame,
                tasks,
                send_within_us,
            })
        }),
        frame().prop_map(|frame| ToWorker::CutOff(CutOff { frame })),
        frame().prop_map(|frame| ToWorker::EndFrame(EndFrame { frame })),
        any::<u64>().prop_map(|nonce| ToWorker::Ping(Ping { nonce })),
        Just(ToWorker::Shutdown(Shutdown {})),
    ]
}

/// Feeds the bytes in the given pieces and collects what comes out.
fn decoded<M: Message>(bytes: &[u8], cuts: &[usize]) -> Result<Vec<M>, EnvelopeError> {
    let mut decoder = Decoder::new();
    decoder.handshake_done();
    let mut messages = Vec::new();
    let ends = cuts
        .iter()
        .map(|cut| cut % (bytes.len() + 1))
        .chain([bytes.len()]);
    let mut start = 0;
    for end in ends {
        decoder.push(bytes.get(start..end).unwrap_or_default());
        start = start.max(end);
        while let Decoded::Message(message) = decoder.decode()? {
            messages.push(message);
        }
    }
    assert!(decoder.is_empty());
    Ok(messages)
}

fn check_round_trip<M: Message + Clone + PartialEq + std::fmt::Debug>(messages: &[M], cuts: &[usize]) {
    let envelopes = messages.iter().map(|message| encode(message).unwrap());
    let bytes = envelopes.collect::<Vec<_>>().concat();
    assert_eq!(decoded::<M>(&bytes, cuts).unwrap(), messages);
}

/// Whatever comes out, memory stays within twice of what came in, plus a constant.
fn check_harmless<M: Message>(bytes: &[u8]) {
    let mut decoder = Decoder::new();
    decoder.handshake_done();
    for piece in bytes.chunks(100) {
        decoder.push(piece);
        loop {
            match decoder.decode::<M>() {
                Ok(Decoded::Message(_)) => {}
                Ok(Decoded::Incomplete { missing_bytes }) => {
                    assert!(
                        (1..=limits::ENVELOPE_BYTES as usize + limits::LENGTH_BYTES).contains(&missing_bytes)
                    );
                    break;
                }
                Err(_) => return,
            }
        }
        assert!(decoder.held_bytes() <= 2 * bytes.len() + (64 << 10));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_failure_persistence(
        FileFailurePersistence::WithSource("regressions")
    ))]

    #[test]
    fn messages_to_the_master_survive_any_cutting(
        messages in vec(to_master(), 1..6),
        mut cuts in vec(any::<usize>(), 0..12),
    ) {
        cuts.sort_unstable();
        check_round_trip(&messages, &cuts);
    }

    #[test]
    fn messages_to_a_worker_survive_any_cutting(
        messages in vec(to_worker(), 1..6),
        mut cuts in vec(any::<usize>(), 0..12),
    ) {
        cuts.sort_unstable();
        check_round_trip(&messages, &cuts);
    }

    #[test]
    fn arbitrary_bytes_do_no_harm(bytes in vec(any::<u8>(), 0..2000)) {
        check_harmless::<ToMaster>(&bytes);
        check_harmless::<ToWorker>(&bytes);
    }

    #[test]
    fn arbitrary_payloads_do_no_harm(payload in vec(any::<u8>(), 0..2000)) {
        let length = u32::try_from(payload.len()).unwrap().to_be_bytes();
        check_harmless::<ToMaster>(&[&length[..], &payload].concat());
        check_harmless::<ToWorker>(&[&length[..], &payload].concat());
    }

    #[test]
    fn damaged_messages_do_no_harm(
        message in to_worker(),
        damage in vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
    ) {
        let mut bytes = encode(&message).unwrap();
        for (at, value) in damage {
            *at.get_mut(&mut bytes[limits::LENGTH_BYTES..]) = value;
        }
        check_harmless::<ToWorker>(&bytes);
    }
}

/// One message, cut at each boundary in turn.
#[test]
fn an_envelope_may_be_cut_anywhere() {
    let message = ToWorker::Refused(Refused {
        reason: "the worker is version 0.0.9".to_owned(),
    });
    for cut in 0..encode(&message).unwrap().len() {
        check_round_trip(std::slice::from_ref(&message), &[cut]);
    }
}
