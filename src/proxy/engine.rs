#[cfg(feature = "gpu")]
use super::gpu;
use super::{DistantLight, FrameStatistics, Proxy, Renderer, Settings, Surface};
#[cfg(not(feature = "gpu"))]
use crate::Error;
use crate::Result;
use crate::scene::{Camera, Environment};

/// What renders frames: the stages on the processor or their twins on a graphics processor.
pub enum Engine {
    /// The processor.
    Cpu(Box<Renderer>),
    /// A graphics processor.
    #[cfg(feature = "gpu")]
    Gpu(Box<gpu::Renderer>),
}

impl Engine {
    /// On the processor; see [`Renderer::new`].
    ///
    /// # Errors
    /// As there.
    pub fn cpu(
        settings: Settings,
        camera: &Camera,
        set: &Surface,
        light: &DistantLight,
        background: Option<&Environment>,
    ) -> Result<Self> {
        Ok(Self::Cpu(Box::new(Renderer::new(settings, camera, set, light, background)?)))
    }

    /// On the fastest graphics processor.
    ///
    /// # Errors
    /// A build without the feature `gpu`, no device, or one that lacks what is needed; settings out of their domain.
    #[cfg(feature = "gpu")]
    pub fn gpu(
        settings: Settings,
        camera: &Camera,
        set: &Surface,
        light: &DistantLight,
        background: Option<&Environment>,
    ) -> Result<Self> {
        let device = gpu::Gpu::open()?;
        Ok(Self::Gpu(Box::new(gpu::Renderer::new(device, settings, camera, set, light, background)?)))
    }

    /// On the fastest graphics processor.
    ///
    /// # Errors
    /// A build without the feature `gpu`, no device, or one that lacks what is needed; settings out of their domain.
    #[cfg(not(feature = "gpu"))]
    pub fn gpu(_: Settings, _: &Camera, _: &Surface, _: &DistantLight, _: Option<&Environment>) -> Result<Self> {
        Err(Error::input(
            "this silhouette cannot use graphics processors; build it with --features gpu, or leave out --device gpu",
        ))
    }

    /// Changes the light and the background.
    pub fn set_light(&mut self, light: &DistantLight, background: Option<&Environment>) {
        match self {
            Self::Cpu(renderer) => renderer.set_light(light, background),
            #[cfg(feature = "gpu")]
            Self::Gpu(renderer) => renderer.set_light(light, background),
        }
    }

    /// Renders a frame; see [`Renderer::render`].
    ///
    /// # Errors
    /// As there; a device that is too small or has gone.
    pub fn render(&mut self, bodies: &[Surface], proxies: &[Proxy]) -> Result<FrameStatistics> {
        match self {
            Self::Cpu(renderer) => renderer.render(bodies, proxies),
            #[cfg(feature = "gpu")]
            Self::Gpu(renderer) => renderer.render(bodies, proxies),
        }
    }

    /// What frames are rendered on.
    pub fn device(&self) -> &str {
        match self {
            Self::Cpu(_) => "the processor",
            #[cfg(feature = "gpu")]
            Self::Gpu(renderer) => renderer.gpu().name(),
        }
    }

    /// Pixels across and down.
    pub fn size(&self) -> [usize; 2] {
        match self {
            Self::Cpu(renderer) => renderer.size(),
            #[cfg(feature = "gpu")]
            Self::Gpu(renderer) => renderer.size(),
        }
    }

    /// Radiance of the last frame, row by row.
    pub fn radiance(&self) -> &[[f32; 3]] {
        match self {
            Self::Cpu(renderer) => renderer.radiance(),
            #[cfg(feature = "gpu")]
            Self::Gpu(renderer) => renderer.radiance(),
        }
    }
}
