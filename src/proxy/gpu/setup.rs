use std::ops::Range;

use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use wgpu::{
    BindGroupDescriptor, BindGroupEntry, BindingResource, Buffer, Color, ColorTargetState, CommandEncoder,
    CompareFunction, DepthStencilState, Extent3d, FragmentState, LoadOp, Operations, RenderPassColorAttachment,
    RenderPassDepthStencilAttachment, RenderPassDescriptor, RenderPipeline, RenderPipelineDescriptor, StoreOp,
    TextureDescriptor, TextureDimension, TextureFormat, TextureUsages, TextureView, VertexState,
};

use super::Gpu;
use super::kernel::{Kernel, Stage, Timer, groups_of_8x8, render_writes};
use super::passes::{Buffers, Shaders};
use crate::Result;
use crate::proxy::{Surface, Viewport};

/// Draws surfaces and finds what every pixel's ray meets: twin of [`draw`](crate::proxy::draw).
pub(super) struct Setup {
    pipeline: RenderPipeline,
    resolve: Kernel,
    /// Positions and normals in turn.
    vertices: Buffer,
    triangles: Buffer,
    transfer: Buffer,
    /// Coefficients in a transfer vector.
    transfer_len: usize,
    /// The set's own vertices and triangles, which come first.
    set: [usize; 2],
    /// All of this frame's.
    count: u32,
}

/// `Triangle` of receiver_setup.wgsl.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Triangle {
    corners: [u32; 3],
    has_transfer: u32,
    albedo: [f32; 3],
    padding: f32,
}

/// `Camera` of receiver_setup.wgsl.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Camera {
    eye: [f32; 4],
    right: [f32; 4],
    down: [f32; 4],
    forward: [f32; 4],
    corner: [f32; 4],
    size: [u32; 4],
    half: [f32; 4],
}

/// Where a view is drawn.
pub(super) struct Target {
    camera: Buffer,
    size: [u32; 2],
    numbers: TextureView,
    depth: TextureView,
}

const NUMBERS: TextureFormat = TextureFormat::R32Uint;
const DEPTH: TextureFormat = TextureFormat::Depth32Float;

impl Target {
    /// Some rows of a viewport's receivers.
    pub(super) fn new(gpu: &Gpu, viewport: &Viewport, rows: Range<u32>, set: &Surface) -> Self {
        let camera = &viewport.camera;
        let size = [viewport.size()[0] as u32, rows.end - rows.start];
        // The band's own image begins here.
        let first = f64::from(rows.start) * viewport.scale as f64;
        let farthest = set.positions.iter().map(|p| camera.project(p.as_dvec3()).z).fold(0.0, f64::max);
        let padded = |v: DVec3, w: f64| [v.x as f32, v.y as f32, v.z as f32, w as f32];
        let corner = camera.ray(0.0, first);
        let [right, down] = [camera.ray(1.0, first) - corner, camera.ray(0.0, first + 1.0) - corner];
        let [width, height] = camera.resolution();
        let parameters = Camera {
            eye: padded(camera.position(), 0.0),
            right: padded(right, right.length_squared().recip()),
            down: padded(down, down.length_squared().recip()),
            forward: padded(camera.forward(), 0.0),
            corner: padded(corner, 0.0),
            size: [size[0], size[1], viewport.scale as u32, 0],
            half: [
                width as f32 / 2.0,
                (f64::from(height) / 2.0 - first) as f32,
                (1e-6 * farthest).max(1e-30) as f32,
                0.0,
            ],
        };
        let texture = |format, usage| {
            let descriptor = TextureDescriptor {
                label: Some("set-up"),
                size: Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: TextureDimension::D2,
                format,
                usage,
                view_formats: &[],
            };
            gpu.device.create_texture(&descriptor).create_view(&Default::default())
        };
        Self {
            camera: gpu.uniform("camera", &[parameters]),
            size,
            numbers: texture(NUMBERS, TextureUsages::RENDER_ATTACHMENT | TextureUsages::TEXTURE_BINDING),
            depth: texture(DEPTH, TextureUsages::RENDER_ATTACHMENT),
        }
    }
}

impl Setup {
    /// For a set that stands still.
    ///
    /// # Errors
    /// More than the device holds, or shaders that it refuses.
    pub(super) fn new(gpu: &Gpu, shaders: &Shaders, set: &Surface) -> Result<Self> {
        let module = gpu.shader("receiver_setup", include_str!("receiver_setup.wgsl").to_owned())?;
        let pipeline = gpu.device.create_render_pipeline(&RenderPipelineDescriptor {
            label: Some("receiver_setup"),
            layout: None,
            vertex: VertexState {
                module: &module,
                entry_point: Some("project"),
                compilation_options: Default::default(),
                buffers: &[],
            },
            primitive: Default::default(),
            depth_stencil: Some(DepthStencilState {
                format: DEPTH,
                depth_write_enabled: Some(true),
                depth_compare: Some(CompareFunction::Greater),
                stencil: Default::default(),
                bias: Default::default(),
            }),
            multisample: Default::default(),
            fragment: Some(FragmentState {
                module: &module,
                entry_point: Some("number"),
                compilation_options: Default::default(),
                targets: &[Some(ColorTargetState::from(NUMBERS))],
            }),
            multiview_mask: None,
            cache: None,
        });
        let parts = [include_str!("receivers.wgsl"), include_str!("receiver_setup.wgsl"), include_str!("resolve.wgsl")];
        let resolve = gpu.kernel("resolve", "resolve", shaders.expand(&parts))?;
        let (vertices, triangles) = packed(set, 0, set.transfer_len > 0);
        gpu.check_size("vertices", size_of_val(&vertices[..]) as u64)?;
        gpu.check_size("triangles", size_of_val(&triangles[..]) as u64)?;
        gpu.check_size("transfer vectors", size_of_val(&set.transfer[..]) as u64)?;
        Ok(Self {
            pipeline,
            resolve,
            vertices: gpu.buffer("vertices", &vertices),
            triangles: gpu.buffer("triangles", &triangles),
            transfer: gpu.buffer("vertex transfer", &set.transfer),
            transfer_len: set.transfer_len,
            set: [set.positions.len(), set.triangles.len()],
            count: set.triangles.len() as u32,
        })
    }

    /// Puts the bodies of a frame behind the set.
    ///
    /// # Errors
    /// More than the device holds.
    ///
    /// # Panics
    /// If a body's transfer vectors are of another length than the set's.
    pub(super) fn place(&mut self, gpu: &Gpu, bodies: &[Surface]) -> Result<()> {
        let (mut vertices, mut triangles, mut transfer) = (Vec::new(), Vec::new(), Vec::new());
        for body in bodies {
            let has_transfer = self.transfer_len > 0 && body.transfer_len > 0;
            assert!(!has_transfer || body.transfer_len == self.transfer_len);
            let (v, t) = packed(body, self.set[0] + vertices.len() / 2, has_transfer);
            vertices.extend(v);
            triangles.extend(t);
            transfer.extend_from_slice(if has_transfer { &body.transfer } else { &[] });
            // Those that have none are not looked at.
            transfer.resize(self.transfer_len * (vertices.len() / 2), 0.0);
        }
        let [own_vertices, own_triangles] = self.set;
        append(gpu, &mut self.transfer, "vertex transfer", (own_vertices * self.transfer_len) as u64 * 4, &transfer)?;
        append(gpu, &mut self.vertices, "vertices", own_vertices as u64 * 32, &vertices)?;
        append(gpu, &mut self.triangles, "triangles", own_triangles as u64 * 32, &triangles)?;
        self.count = (own_triangles + triangles.len()) as u32;
        Ok(())
    }

    /// Records the set-up of a view's receivers.
    pub(super) fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut CommandEncoder,
        timer: &mut Timer,
        target: &Target,
        out: &Buffers,
    ) {
        let drawn = [&target.camera, &self.vertices, &self.triangles];
        let entries: Vec<BindGroupEntry> = (0..)
            .zip(drawn)
            .map(|(binding, buffer)| BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        let layout = &self.pipeline.get_bind_group_layout(0);
        let bindings = gpu.device.create_bind_group(&BindGroupDescriptor { label: None, layout, entries: &entries });
        let writes = timer.draw(Stage::Setup);
        let color = RenderPassColorAttachment {
            view: &target.numbers,
            depth_slice: None,
            resolve_target: None,
            ops: Operations { load: LoadOp::Clear(Color::TRANSPARENT), store: StoreOp::Store },
        };
        let mut pass = encoder.begin_render_pass(&RenderPassDescriptor {
            label: Some("receiver_setup"),
            color_attachments: &[Some(color)],
            depth_stencil_attachment: Some(RenderPassDepthStencilAttachment {
                view: &target.depth,
                depth_ops: Some(Operations { load: LoadOp::Clear(0.0), store: StoreOp::Discard }),
                stencil_ops: None,
            }),
            timestamp_writes: writes.as_ref().map(render_writes),
            occlusion_query_set: None,
            multiview_mask: None,
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &bindings, &[]);
        pass.draw(0..3 * self.count, 0..1);
        drop(pass);
        timer.ended(gpu, encoder, Stage::Setup);

        let resources = [
            target.camera.as_entire_binding(),
            self.vertices.as_entire_binding(),
            self.triangles.as_entire_binding(),
            BindingResource::TextureView(&target.numbers),
            self.transfer.as_entire_binding(),
            out.receivers.as_entire_binding(),
            out.transfer.as_entire_binding(),
        ];
        let bindings = self.resolve.bind(gpu, &resources);
        self.resolve.run_on(gpu, encoder, timer, Stage::Setup, &bindings, groups_of_8x8(target.size));
    }
}

/// Positions and normals in turn, and the triangles, whose corners are counted from `first` on.
fn packed(surface: &Surface, first: usize, has_transfer: bool) -> (Vec<[f32; 4]>, Vec<Triangle>) {
    let pairs = surface.positions.iter().zip(&surface.normals);
    let vertices = pairs.flat_map(|(p, n)| [p.extend(0.0).to_array(), n.extend(0.0).to_array()]).collect();
    let triangles = surface.triangles.iter().zip(&surface.albedo).map(|(corners, albedo)| Triangle {
        corners: corners.map(|v| v + first as u32),
        has_transfer: has_transfer.into(),
        albedo: albedo.to_array(),
        padding: 0.0,
    });
    (vertices, triangles.collect())
}

/// Writes behind the first `offset` bytes of a buffer, which stay, in a larger one if need be.
fn append<T: Pod>(gpu: &Gpu, buffer: &mut Buffer, label: &str, offset: u64, contents: &[T]) -> Result<()> {
    let bytes: &[u8] = bytemuck::cast_slice(contents);
    let needed = offset + bytes.len() as u64;
    if needed > buffer.size() {
        gpu.check_size(label, needed)?;
        let larger = gpu.zeros(label, needed);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(buffer, 0, &larger, 0, offset);
        gpu.queue.submit([encoder.finish()]);
        *buffer = larger;
    }
    gpu.queue.write_buffer(buffer, offset, bytes);
    Ok(())
}
