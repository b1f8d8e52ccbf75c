//! The report on standard output, and what machine it is from.

use std::fmt::Write;

use meshsnap_render::backend::gpu::GpuInfo;

use super::{BASELINE, Effort, Row};

/// The hardware of a measurement: models, and nothing that names a machine.
#[derive(Clone, Debug)]
pub struct Machine {
    pub cpu: String,
    /// That this process may use.
    pub cores: usize,
    pub gpu: Option<String>,
    /// Other load: the average over a minute before the first round, where the system tells.
    pub load: Option<f64>,
}

impl Machine {
    pub fn new(gpu: Option<&GpuInfo>) -> Self {
        let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        let model = info.lines().find_map(|line| line.strip_prefix("model name")?.split_once(": "));
        Self {
            cpu: model.map_or_else(|| std::env::consts::ARCH.to_owned(), |(_, name)| name.trim().to_owned()),
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            load: std::fs::read_to_string("/proc/loadavg").ok().and_then(|text| text.split(' ').next()?.parse().ok()),
            gpu: gpu.map(|gpu| format!("{} ({}, {})", gpu.name, gpu.device_type, gpu.driver)),
        }
    }

    /// True if the GPU is software, and shares the CPU's cores.
    pub fn has_software_gpu(&self) -> bool {
        self.gpu.as_ref().is_some_and(|gpu| gpu.contains("(software,"))
    }

    /// A warning where times mean little.
    pub fn warning(&self) -> Option<String> {
        let load = self.load.filter(|load| *load > 0.5)?;
        Some(format!(
            "Other work shared these cores (load average {load:.1} before the first round): times, above all those of several threads, \
             are larger than on an idle machine; errors are the same."
        ))
    }

    /// One line.
    pub fn line(&self) -> String {
        let gpu = self.gpu.as_deref().unwrap_or("none that speaks Vulkan");
        let cores = if self.cores == 1 { "1 core".to_owned() } else { format!("{} cores", self.cores) };
        format!("CPU: {}, {cores}; GPU: {gpu}", self.cpu)
    }
}

/// The method by which times were taken.
pub fn method(effort: Effort) -> String {
    format!(
        "Pictures of {0} x {0} pixels. Times: medians of {1} interleaved rounds of `Renderer::draw` alone (no import, plan or \
         encoding), after one that warms up; ratios to {BASELINE}, on the same mesh in the same rounds.",
        effort.size_px, effort.runs
    )
}

const HEAD: [&str; 11] = [
    "scene",
    "technique",
    "back-end",
    "samples",
    "thickness",
    "median ms",
    "ratio",
    "RMSE/255",
    "max/255",
    "FLIP",
    "ink",
];

/// Aligned columns, a line a row, with an empty line between scenes.
pub fn table(rows: &[Row]) -> String {
    let lines: Vec<[String; 11]> = rows.iter().map(cells).collect();
    let widths: [usize; 11] = std::array::from_fn(|k| {
        lines.iter().map(|line| line[k].chars().count()).chain([HEAD[k].len()]).max().unwrap_or(0)
    });
    let mut text = String::new();
    let mut write = |cells: &[String; 11]| {
        for (k, (cell, width)) in cells.iter().zip(widths).enumerate() {
            // Words to the left, numbers to the right.
            let _ = if k < 3 { write!(text, "{cell:<width$}  ") } else { write!(text, "{cell:>width$}  ") };
        }
        text.truncate(text.trim_end().len());
        text.push('\n');
    };
    write(&HEAD.map(str::to_owned));
    for (i, line) in lines.iter().enumerate() {
        if i > 0 && rows[i].scene != rows[i - 1].scene {
            write(&[const { String::new() }; 11]);
        }
        write(line);
    }
    text
}

fn cells(row: &Row) -> [String; 11] {
    let errors = &row.errors;
    [
        row.scene.to_owned(),
        row.technique.name().to_owned(),
        row.back_end.to_owned(),
        row.samples.to_string(),
        format!("{:.3}", row.thickness),
        format!("{:.3}", row.median_ms),
        format!("{:.3}", row.time_ratio),
        format!("{:.3}", errors.rmse),
        format!("{:.1}", errors.max),
        format!("{:.5}", errors.flip),
        errors.ink.map_or_else(|| "-".to_owned(), |ink| format!("{ink:.4}")),
    ]
}
