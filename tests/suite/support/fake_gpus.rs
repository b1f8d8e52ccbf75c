//! Fake GPUs: a machine whose devices are missing, wrong, lost or refuse jobs, as a test tells
//! them. They draw on the CPU.

use std::collections::VecDeque;
use std::sync::mpsc::Receiver;
use std::sync::{Arc, Mutex, OnceLock};
use std::time::Duration;

use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::backend::gpu::{GpuInfo, GpuKind};
use meshsnap_render::backend::{BackendKind, CostModel, DrawError, GpuDevice, GpuHost, HardwareHint, Opener, Renderer};
use meshsnap_render::image::{Image, LinearImage};
use meshsnap_render::limits::Deadline;
use meshsnap_render::plan::DrawPlan;

use crate::support::scenes;

/// The result of an attempt to open a device.
#[derive(Clone, Copy, Debug)]
pub enum Open {
    Hardware,
    Software,
    /// Hardware that computes wrong numbers.
    Wrong,
    /// The same, with 16 samples per pixel alone.
    WrongAtSixteen,
    /// Hardware that breaks while it is probed.
    Broken,
    Absent,
    Panics,
}

/// A device's reaction to a job; by default the job is drawn.
#[derive(Clone, Copy, Debug)]
pub enum Act {
    Draws,
    Loses,
    Refuses,
    Panics,
    /// As wgpu does on a lost device.
    PanicsLost,
    Stops,
    /// Draws as soon as the machine's gate is open.
    Waits,
}

/// A machine whose devices do as they are told.
#[derive(Clone, Default)]
pub struct Machine(pub Arc<Mutex<Story>>);

#[derive(Default)]
pub struct Story {
    opens: VecDeque<Open>,
    acts: VecDeque<Act>,
    opened: Vec<GpuKind>,
    /// Sides of the pictures that were drawn, pixels.
    pub drawn_px: Vec<u32>,
    pub devices: Vec<Arc<Fake>>,
    pub renderers: usize,
    /// Plans that devices were made ready for.
    pub made_ready: usize,
    /// Plans that pictures drawn together were prepared for.
    pub made_ready_for_load: usize,
    /// True if making a device ready panics.
    pub ready_panics: bool,
    /// What the first probe waits for.
    pub probe_gate: Option<Receiver<()>>,
    /// What [`Act::Waits`] waits for.
    pub gate: Option<Receiver<()>>,
}

impl Machine {
    pub fn new(opens: &[Open], acts: &[Act]) -> Self {
        let machine = Self::default();
        let mut story = machine.0.lock().unwrap();
        (story.opens, story.acts) = (opens.iter().copied().collect(), acts.iter().copied().collect());
        drop(story);
        machine
    }

    pub fn host(&self, hint: HardwareHint) -> Arc<GpuHost> {
        let machine = self.clone();
        let open: Box<Opener> = Box::new(move |kind| machine.open(kind));
        Arc::new(GpuHost::with_opener(hint, CostModel::fixed(), open))
    }

    fn open(&self, kind: GpuKind) -> Result<Arc<dyn GpuDevice>, DrawError> {
        let mut story = self.0.lock().unwrap();
        story.opened.push(kind);
        let open = story.opens.pop_front().expect("an opening too many");
        match open {
            Open::Absent => return Err(DrawError::NoGpu("nothing there".into())),
            Open::Software if kind == GpuKind::Hardware => return Err(DrawError::NoGpu("software alone".into())),
            _ => {}
        }
        let software = matches!(open, Open::Software);
        let info = GpuInfo {
            name: format!("fake {}", story.opened.len()),
            driver: "fake 1.0".into(),
            device_type: if software { "software" } else { "discrete" },
            features: vec!["int64-atomics"],
        };
        let fake = Arc::new(Fake { machine: self.clone(), open, info, lost: OnceLock::new() });
        story.devices.push(fake.clone());
        drop(story);
        assert!(!matches!(open, Open::Panics), "this driver panics");
        Ok(fake)
    }

    pub fn opened(&self) -> Vec<GpuKind> {
        self.0.lock().unwrap().opened.clone()
    }
}

pub struct Fake {
    machine: Machine,
    open: Open,
    info: GpuInfo,
    pub lost: OnceLock<String>,
}

impl GpuDevice for Fake {
    fn info(&self) -> &GpuInfo {
        &self.info
    }

    fn is_software(&self) -> bool {
        matches!(self.open, Open::Software)
    }

    fn lost(&self) -> Option<&str> {
        self.lost.get().map(String::as_str)
    }

    fn renderer(self: Arc<Self>) -> Box<dyn Renderer> {
        self.machine.0.lock().unwrap().renderers += 1;
        Box::new(FakeRenderer(self))
    }

    fn make_ready(&self, _: &DrawPlan<'_>) -> Result<(), DrawError> {
        let mut story = self.machine.0.lock().unwrap();
        story.made_ready += 1;
        let panics = story.ready_panics;
        drop(story);
        assert!(!panics, "a driver that cannot compile");
        Ok(())
    }

    fn make_ready_for_load(&self, _: &DrawPlan<'_>) -> Result<(), DrawError> {
        self.machine.0.lock().unwrap().made_ready_for_load += 1;
        Ok(())
    }
}

struct FakeRenderer(Arc<Fake>);

impl Renderer for FakeRenderer {
    fn draw_linear(&mut self, plan: &DrawPlan<'_>, deadline: &Deadline) -> Result<LinearImage, DrawError> {
        CpuRenderer::new(1).draw_linear(plan, deadline)
    }

    fn draw(&mut self, plan: &DrawPlan<'_>, deadline: &Deadline) -> Result<Image, DrawError> {
        let fake = &self.0;
        let gone = || DrawError::DeviceLost(fake.lost.get_or_init(|| "pulled out".into()).clone());
        if fake.lost.get().is_some() {
            return Err(gone());
        }
        // Anything else is the probe.
        let act = if plan.width_px == JOB_PX { fake.machine.0.lock().unwrap().acts.pop_front() } else { None };
        match act.unwrap_or(Act::Draws) {
            Act::Draws => {}
            Act::Loses => return Err(gone()),
            Act::Refuses => return Err(DrawError::Device("out of memory".into())),
            Act::Panics => panic!("a bug"),
            Act::PanicsLost => {
                let _ = gone();
                panic!("as wgpu does");
            }
            Act::Stops => deadline.stop(),
            Act::Waits => {
                let gate = fake.machine.0.lock().unwrap().gate.take().expect("a gate");
                gate.recv_timeout(Duration::from_secs(30)).expect("the gate opens");
            }
        }
        deadline.check()?;
        let mut image = CpuRenderer::new(1).draw(plan, deadline)?;
        // Pulled out in the meantime.
        if fake.lost.get().is_some() {
            return Err(gone());
        }
        fake.machine.0.lock().unwrap().drawn_px.push(plan.width_px);
        if matches!(fake.open, Open::Wrong) || matches!(fake.open, Open::WrongAtSixteen) && plan.samples == 16 {
            image.rgba[0] ^= 0x80;
        }
        Ok(image)
    }

    fn draw_visibility(&mut self, plan: &DrawPlan<'_>, deadline: &Deadline) -> Result<Vec<u64>, DrawError> {
        if matches!(self.0.open, Open::Broken) {
            return Err(DrawError::Device("no such shader".into()));
        }
        let gate = self.0.machine.0.lock().unwrap().probe_gate.take();
        if let Some(gate) = gate {
            gate.recv_timeout(Duration::from_secs(30)).expect("the gate opens");
        }
        CpuRenderer::new(1).draw_visibility(plan, deadline)
    }

    fn kind(&self) -> BackendKind {
        BackendKind::Gpu
    }
}

const JOB_PX: u32 = 5;

pub fn job() -> DrawPlan<'static> {
    let positions = &[[-9.0, 9.0, 0.5], [9.0, 9.0, 0.5], [0.0, -2.0, 0.5]];
    scenes::screen_plan([JOB_PX; 2], 1, 1.0, positions, &[[0, 1, 2]])
}
