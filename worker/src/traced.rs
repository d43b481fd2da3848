//! The real renderer: the crate `render` behind the worker's traits. What comes off the wire becomes
//! `render`'s own types here.

use std::sync::Arc;

use anyhow::Context as _;
use protocol::message::Frame as FrameMessage;
use protocol::radiance::Encoding;
use protocol::{Radiance, settings as wire};
use render::frame::FrameRenderer;
use render::intersect::TracedScene;
use render::scene::{ImageSize, geometry};
use render::settings::{Algorithm, LightPoints, Settings};
use render::task::{Component, Task};
use render::vpl::VplSet;

use crate::clock::Clock;
use crate::renderer::{Frame, LoadedScene, Output, Renderer, Scene};

/// Builds the BVH of scenes by Embree.
#[derive(Debug)]
pub struct TracingRenderer {
    clock: Clock,
}

impl TracingRenderer {
    /// The clock tells how long a scene took.
    pub fn new(clock: Clock) -> Self {
        Self { clock }
    }
}

impl Renderer for TracingRenderer {
    fn load(&self, bytes: &[u8]) -> anyhow::Result<LoadedScene> {
        let begun = self.clock.now();
        let scene = geometry::from_bytes(bytes)?;
        let decoded = self.clock.now();
        let traced = TracedScene::build(scene).context("cannot build the BVH")?;
        let built = self.clock.now();
        Ok(LoadedScene {
            scene: Arc::new(PreparedScene(Arc::new(traced))),
            load: decoded.saturating_sub(begun),
            bvh: built.saturating_sub(decoded),
        })
    }
}

#[derive(Debug)]
struct PreparedScene(Arc<TracedScene>);

impl Scene for PreparedScene {
    fn set_up(&self, frame: &FrameMessage) -> anyhow::Result<Arc<dyn Frame>> {
        let vpl_sets = frame.vpl_sets.iter().enumerate().map(|(index, bytes)| {
            VplSet::from_bytes(bytes).with_context(|| format!("VPL set {index} is broken"))
        });
        let vpl_sets = vpl_sets.collect::<anyhow::Result<_>>()?;
        let renderer = FrameRenderer::new(Arc::clone(&self.0), settings_of(&frame.settings), vpl_sets)?;
        let encoding = frame.radiance;
        Ok(Arc::new(PreparedFrame { renderer, encoding }))
    }
}

/// A frame with the encoding that its master wants.
#[derive(Debug)]
struct PreparedFrame {
    renderer: FrameRenderer,
    encoding: Encoding,
}

impl Frame for PreparedFrame {
    fn has(&self, task: protocol::Task) -> bool {
        self.renderer.has(task_of(task))
    }

    fn render(&self, task: protocol::Task, chunks: &mut dyn FnMut(usize) -> usize) -> Output {
        let output = self.renderer.render(task_of(task), chunks);
        Output {
            pixels: output.pixels_done,
            radiance: Radiance::pack(&output.radiance, self.encoding),
            primary_rays: output.rays.primary,
            shadow_rays: output.rays.shadow,
        }
    }
}

fn settings_of(wire: &wire::Settings) -> Settings {
    Settings {
        algorithm: match wire.algorithm {
            wire::Algorithm::Progressive => Algorithm::Progressive,
            wire::Algorithm::Component => Algorithm::Component,
            wire::Algorithm::Straightforward => Algorithm::Straightforward,
        },
        size: ImageSize {
            width: wire.width,
            height: wire.height,
        },
        groups: wire.groups,
        spp: wire.spp,
        vpls: wire.vpls,
        vpl_sets: wire.vpl_sets,
        seed: wire.seed,
        geometry_clamp: wire.geometry_clamp,
        light_points: match wire.light_points {
            wire::LightPoints::PerPass => LightPoints::PerPass,
            wire::LightPoints::PerPixel => LightPoints::PerPixel,
        },
    }
}

fn task_of(wire: protocol::Task) -> Task {
    let component = match wire.component {
        protocol::Component::Direct => Component::Direct,
        protocol::Component::Indirect => Component::Indirect,
        protocol::Component::Full => Component::Full,
    };
    Task {
        component,
        group: wire.group,
        index: wire.index,
        passes: wire.passes,
    }
}
