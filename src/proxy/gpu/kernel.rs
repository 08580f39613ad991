use std::time::Instant;

use wgpu::{
    BindGroup, BindGroupDescriptor, BindGroupEntry, BindingResource, Buffer, BufferDescriptor, BufferUsages,
    CommandEncoder, ComputePassDescriptor, ComputePassTimestampWrites, ComputePipeline, QuerySet, QuerySetDescriptor,
    QueryType, RenderPassTimestampWrites,
};

use super::Gpu;
use crate::Result;

/// A compute pass.
pub(super) struct Kernel {
    label: &'static str,
    pipeline: ComputePipeline,
}

impl Kernel {
    pub(super) fn new(label: &'static str, pipeline: ComputePipeline) -> Self {
        Self { label, pipeline }
    }

    /// What the pass works on, in the order of its bindings.
    pub(super) fn bind(&self, gpu: &Gpu, resources: &[BindingResource]) -> BindGroup {
        let entries: Vec<_> =
            (0..).zip(resources).map(|(binding, r)| BindGroupEntry { binding, resource: r.clone() }).collect();
        let layout = &self.pipeline.get_bind_group_layout(0);
        gpu.device.create_bind_group(&BindGroupDescriptor { label: Some(self.label), layout, entries: &entries })
    }

    /// Runs the pass on buffers in the order of its bindings, in so many work groups across and down.
    pub(super) fn run(
        &self,
        gpu: &Gpu,
        encoder: &mut CommandEncoder,
        timer: &mut Timer,
        stage: Stage,
        buffers: &[&Buffer],
        groups: [u32; 2],
    ) {
        let resources: Vec<BindingResource> = buffers.iter().map(|buffer| buffer.as_entire_binding()).collect();
        self.run_on(gpu, encoder, timer, stage, &self.bind(gpu, &resources), groups);
    }

    /// Runs the pass on what [`Self::bind`] gave.
    pub(super) fn run_on(
        &self,
        gpu: &Gpu,
        encoder: &mut CommandEncoder,
        timer: &mut Timer,
        stage: Stage,
        bindings: &BindGroup,
        groups: [u32; 2],
    ) {
        let writes = timer.next(stage);
        let timestamp_writes = writes.as_ref().map(|(set, first)| ComputePassTimestampWrites {
            query_set: set,
            beginning_of_pass_write_index: Some(*first),
            end_of_pass_write_index: Some(first + 1),
        });
        let mut pass = encoder.begin_compute_pass(&ComputePassDescriptor { label: Some(self.label), timestamp_writes });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, bindings, &[]);
        pass.dispatch_workgroups(groups[0], groups[1], 1);
        drop(pass);
        timer.ended(gpu, encoder, stage);
    }
}

/// Work groups of 64 for `count` receivers: across and, where there are more than a row may have, down.
pub(super) fn groups_of_64(count: u32) -> [u32; 2] {
    const MOST: u32 = 65_535;
    let groups = count.div_ceil(64).max(1);
    let rows = groups.div_ceil(MOST);
    [groups.div_ceil(rows), rows]
}

/// Work groups of 8 x 8 for a picture.
pub(super) fn groups_of_8x8([width, height]: [u32; 2]) -> [u32; 2] {
    [width.div_ceil(8).max(1), height.div_ceil(8).max(1)]
}

/// Parts of a frame that are timed apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stage {
    Setup,
    Splat,
    Exponentiate,
    Indirect,
    Shade,
    Upsample,
}

/// Times passes: by the device's own clock or, on software, by waiting for each.
pub(super) struct Timer {
    queries: Option<(QuerySet, Buffer)>,
    stages: Vec<Stage>,
    waited: Vec<(Stage, f64)>,
}

impl Timer {
    /// Passes in a frame.
    const MOST: u32 = 32;

    pub(super) fn new(gpu: &Gpu) -> Self {
        let queries = gpu.has_timestamps().then(|| {
            let descriptor =
                QuerySetDescriptor { label: Some("timer"), ty: QueryType::Timestamp, count: 2 * Self::MOST };
            let buffer = gpu.device.create_buffer(&BufferDescriptor {
                label: Some("timer"),
                size: 16 * u64::from(Self::MOST),
                usage: BufferUsages::QUERY_RESOLVE | BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            });
            (gpu.device.create_query_set(&descriptor), buffer)
        });
        Self { queries, stages: Vec::new(), waited: Vec::new() }
    }

    /// To be called after every pass: on software, does what was recorded and takes the time.
    pub(super) fn ended(&mut self, gpu: &Gpu, encoder: &mut CommandEncoder, stage: Stage) {
        if !gpu.is_software() {
            return;
        }
        let recorded = std::mem::replace(encoder, gpu.device.create_command_encoder(&Default::default()));
        let started = Instant::now();
        gpu.queue.submit([recorded.finish()]);
        // A device that has gone is told about when the frame is read.
        if gpu.wait().is_ok() {
            self.waited.push((stage, started.elapsed().as_secs_f64()));
        }
    }

    /// The queries for the beginning of the next pass and, one further, for its end.
    fn next(&mut self, stage: Stage) -> Option<(QuerySet, u32)> {
        let (set, _) = self.queries.as_ref()?;
        let index = self.stages.len() as u32;
        (index < Self::MOST).then(|| {
            self.stages.push(stage);
            (set.clone(), 2 * index)
        })
    }

    /// Times a draw.
    pub(super) fn draw(&mut self, stage: Stage) -> Option<(QuerySet, u32)> {
        self.next(stage)
    }

    /// The seconds of every stage since the last call, after all passes were submitted; none where the device cannot tell.
    ///
    /// # Errors
    /// A device that has gone.
    pub(super) fn seconds(&mut self, gpu: &Gpu) -> Result<Vec<(Stage, f64)>> {
        let stages = std::mem::take(&mut self.stages);
        let waited = std::mem::take(&mut self.waited);
        let Some((set, buffer)) = self.queries.as_ref().filter(|_| !stages.is_empty()) else { return Ok(waited) };
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        encoder.resolve_query_set(set, 0..2 * stages.len() as u32, buffer, 0);
        gpu.queue.submit([encoder.finish()]);
        let ticks: Vec<u64> = gpu.read(buffer, 2 * stages.len())?;
        let period = f64::from(gpu.queue.get_timestamp_period()) * 1e-9;
        let passes = stages.into_iter().zip(ticks.as_chunks::<2>().0);
        Ok(passes.map(|(stage, [from, to])| (stage, to.saturating_sub(*from) as f64 * period)).collect())
    }
}

/// Where a draw writes its times.
pub(super) fn render_writes((set, first): &(QuerySet, u32)) -> RenderPassTimestampWrites<'_> {
    RenderPassTimestampWrites {
        query_set: set,
        beginning_of_pass_write_index: Some(*first),
        end_of_pass_write_index: Some(first + 1),
    }
}
