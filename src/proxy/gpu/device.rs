use bytemuck::{NoUninit, Pod};
use wgpu::util::{BufferInitDescriptor, DeviceExt};
use wgpu::{
    Buffer, BufferDescriptor, BufferUsages, ComputePipelineDescriptor, DeviceDescriptor, ErrorFilter, Features,
    Instance, InstanceDescriptor, MapMode, PollType, PowerPreference, RequestAdapterOptions, ShaderModule,
    ShaderModuleDescriptor, ShaderSource,
};

use super::kernel::Kernel;
use crate::{Error, Result};

/// A graphics processor, or software that stands in for one, ready to compute.
pub struct Gpu {
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    name: String,
    has_timestamps: bool,
    is_software: bool,
    /// Bytes that a buffer of a pass may have.
    most: u64,
}

/// Storage buffers that one pass needs.
const STORAGE_BUFFERS: u32 = 8;

impl Gpu {
    /// Opens the fastest device of the system; without any graphics processor, one in software.
    ///
    /// # Errors
    /// No device, or one that lacks what the passes need: the line says what.
    pub fn open() -> Result<Self> {
        let instance = Instance::new(InstanceDescriptor::new_without_display_handle());
        let options =
            RequestAdapterOptions { power_preference: PowerPreference::HighPerformance, ..Default::default() };
        let adapter = pollster::block_on(instance.request_adapter(&options)).map_err(|_| {
            Error::input(
                "no Vulkan, Metal or DirectX 12 device was found; install its driver (one in software is Debian's \
                 mesa-vulkan-drivers), or leave out --device gpu",
            )
        })?;
        let info = adapter.get_info();
        let name = format!("{} ({})", info.name, info.backend);
        let limits = adapter.limits();
        if limits.max_storage_buffers_per_shader_stage < STORAGE_BUFFERS {
            return Err(Error::input(format!(
                "{name} has {} storage buffers per pass and {STORAGE_BUFFERS} are needed; leave out --device gpu",
                limits.max_storage_buffers_per_shader_stage
            )));
        }
        let most = limits.max_buffer_size.min(limits.max_storage_buffer_binding_size);
        let is_software = info.device_type == wgpu::DeviceType::Cpu;
        let has_timestamps = !is_software && adapter.features().contains(Features::TIMESTAMP_QUERY);
        let descriptor = DeviceDescriptor {
            label: Some("proxies"),
            required_features: if has_timestamps { Features::TIMESTAMP_QUERY } else { Features::empty() },
            required_limits: limits,
            ..Default::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))
            .map_err(|error| Error::input(format!("{name} cannot be used: {error}")))?;
        Ok(Self { device, queue, name, has_timestamps, is_software, most })
    }

    /// What the device calls itself, and by which interface it is used.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Whether the device itself tells how long passes take. Software ones do not count: Mesa's stamps passes when it
    /// flushes, long after them.
    pub fn has_timestamps(&self) -> bool {
        self.has_timestamps
    }

    /// Whether the device is software on the processor.
    pub fn is_software(&self) -> bool {
        self.is_software
    }

    /// Bytes that a buffer of a pass may have.
    pub(super) fn most(&self) -> u64 {
        self.most
    }

    /// The device as if its buffers were smaller.
    #[cfg(test)]
    pub(super) fn with_most(self, most: u64) -> Self {
        Self { most, ..self }
    }

    /// Fails where a buffer of so many bytes is more than a pass may use.
    pub(super) fn check_size(&self, what: &str, bytes: u64) -> Result<()> {
        if bytes <= self.most {
            return Ok(());
        }
        let [bytes, most] = [bytes, self.most].map(|bytes| bytes >> 20);
        Err(Error::input(format!(
            "{}: {what} take {bytes} MiB, and {most} fit; ask for fewer or larger receivers",
            self.name
        )))
    }

    /// A buffer of zeros for passes.
    pub(super) fn zeros(&self, label: &str, bytes: u64) -> Buffer {
        self.device.create_buffer(&BufferDescriptor {
            label: Some(label),
            // Bindings are of four floats at least.
            size: bytes.max(16).next_multiple_of(4),
            usage: BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST,
            mapped_at_creation: false,
        })
    }

    /// A buffer with these contents for passes.
    pub(super) fn buffer<T: NoUninit>(&self, label: &str, contents: &[T]) -> Buffer {
        let mut bytes = bytemuck::cast_slice(contents).to_vec();
        bytes.resize(bytes.len().max(16).next_multiple_of(4), 0);
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        self.device.create_buffer_init(&BufferInitDescriptor { label: Some(label), contents: &bytes, usage })
    }

    /// A buffer of parameters.
    pub(super) fn uniform<T: NoUninit>(&self, label: &str, contents: &[T]) -> Buffer {
        let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
        let contents = bytemuck::cast_slice(contents);
        self.device.create_buffer_init(&BufferInitDescriptor { label: Some(label), contents, usage })
    }

    /// Makes `buffer` hold these contents, in a larger one if need be. Returns whether it is another one now.
    pub(super) fn fill<T: NoUninit>(&self, buffer: &mut Buffer, label: &str, contents: &[T]) -> bool {
        let bytes = bytemuck::cast_slice(contents);
        let grows = (bytes.len() as u64) > buffer.size();
        if grows {
            *buffer = self.zeros(label, bytes.len() as u64 * 5 / 4);
        }
        self.queue.write_buffer(buffer, 0, bytes);
        grows
    }

    /// Reads numbers from the beginning of a buffer, after all that was submitted before.
    ///
    /// # Errors
    /// A device that has gone.
    pub(super) fn read<T: Pod>(&self, buffer: &Buffer, count: usize) -> Result<Vec<T>> {
        let bytes = (count * size_of::<T>()) as u64;
        if bytes == 0 {
            return Ok(Vec::new());
        }
        let size = bytes.next_multiple_of(4);
        let staging = self.device.create_buffer(&BufferDescriptor {
            label: Some("staging"),
            size,
            usage: BufferUsages::COPY_DST | BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let mut encoder = self.device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, size);
        self.queue.submit([encoder.finish()]);
        let take = |bytes: &[u8]| bytemuck::pod_collect_to_vec(&bytes[..count * size_of::<T>()]);
        self.read_staged(&staging, take)
    }

    /// Waits until everything that was submitted is done.
    ///
    /// # Errors
    /// A device that has gone.
    pub(super) fn wait(&self) -> Result<()> {
        let gone = |error| Error::input(format!("{} stopped working: {error}", self.name));
        self.device.poll(PollType::wait_indefinitely()).map(drop).map_err(gone)
    }

    /// Hands out what is in a buffer that can be mapped, after all that was submitted before.
    ///
    /// # Errors
    /// A device that has gone.
    pub(super) fn read_staged<T: Pod, R>(&self, staging: &Buffer, take: impl FnOnce(&[T]) -> R) -> Result<R> {
        staging.map_async(MapMode::Read, .., |_| ());
        self.wait()?;
        let gone = |error| Error::input(format!("{} stopped working: {error}", self.name));
        let view = staging.get_mapped_range(..).map_err(gone)?;
        // Mappings are aligned to 8 bytes at least.
        let taken = take(bytemuck::cast_slice(&view));
        drop(view);
        staging.unmap();
        Ok(taken)
    }

    /// Compiles a shader.
    ///
    /// # Errors
    /// What the device does not accept.
    pub(super) fn shader(&self, label: &str, source: String) -> Result<ShaderModule> {
        let scope = self.device.push_error_scope(ErrorFilter::Validation);
        let descriptor = ShaderModuleDescriptor { label: Some(label), source: ShaderSource::Wgsl(source.into()) };
        let module = self.device.create_shader_module(descriptor);
        match pollster::block_on(scope.pop()) {
            None => Ok(module),
            Some(error) => Err(Error::input(format!("{}: the pass {label} is refused: {error}", self.name))),
        }
    }

    /// A compute pass.
    ///
    /// # Errors
    /// What the device does not accept.
    pub(super) fn kernel(&self, label: &'static str, entry: &str, source: String) -> Result<Kernel> {
        let module = self.shader(label, source)?;
        let scope = self.device.push_error_scope(ErrorFilter::Validation);
        let pipeline = self.device.create_compute_pipeline(&ComputePipelineDescriptor {
            label: Some(label),
            layout: None,
            module: &module,
            entry_point: Some(entry),
            compilation_options: Default::default(),
            cache: None,
        });
        match pollster::block_on(scope.pop()) {
            None => Ok(Kernel::new(label, pipeline)),
            Some(error) => Err(Error::input(format!("{}: the pass {label} is refused: {error}", self.name))),
        }
    }
}
