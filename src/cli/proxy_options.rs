//! Options of the commands that render sphere proxies.

use clap::builder::RangedU64ValueParser;
use clap::{Args, ValueEnum};

use crate::proxy::{Exponential, IndirectOperator, Interpolant, Overlap, SelfShadowing, Settings, Upsampling};
use crate::sphere::Order;

use super::Failure;

/// How proxies are rendered.
#[derive(Args)]
#[command(next_help_heading = "Proxies")]
pub struct ProxyOptions {
    /// Bands of light and visibility
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = RangedU64ValueParser::<usize>::new().range(2..=6))]
    order: usize,
    /// Bands in which log visibility is accumulated; 6 halve the error of 4 [default: those of --order]
    #[arg(long, value_name = "N", value_parser = RangedU64ValueParser::<usize>::new().range(2..=6))]
    internal_order: Option<usize>,
    /// Exponential that turns log visibility into visibility
    #[arg(long, value_enum, default_value_t = Exponential::Ps2)]
    exponential: Exponential,
    /// What the logarithms of spheres that overlap in a body add up to
    #[arg(long, value_enum, default_value_t = Overlap::Shared)]
    overlap: Overlap,
    /// Rule for spheres that reach below a receiver's horizon
    #[arg(long, value_enum, default_value_t = SelfShadowing::Clipped)]
    self_shadowing: SelfShadowing,
    /// How proxies reflect light
    #[arg(long, value_enum, default_value_t = Indirect::Averaged)]
    indirect: Indirect,
    /// Pixels per receiver, across and down
    #[arg(long, value_name = "1|2|4", default_value_t = 4, value_parser = scale)]
    receiver_scale: usize,
    /// How pixels take from receivers
    #[arg(long, value_enum, default_value_t = Upsampling::Bilateral)]
    upsampling: Upsampling,
    /// What they take
    #[arg(long, value_enum, default_value_t = Interpolant::Vectors)]
    interpolate: Interpolant,
    /// What one sphere may do out of its reach, over the greatest irradiance [default: 1/128]
    #[arg(long, value_name = "E", value_parser = share)]
    reach_error: Option<f64>,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum Indirect {
    /// They do not
    None,
    /// Radiance of the nearest point, all over the disc
    PointSampled,
    /// Mean radiance of the disc
    Averaged,
    /// Radiance of every point of the disc
    Exact,
}

impl ProxyOptions {
    /// The settings asked for.
    pub fn settings(&self) -> std::result::Result<Settings, Failure> {
        let internal = self.internal_order.unwrap_or(self.order);
        if internal < self.order {
            let message = format!("--internal-order {internal} is less than --order {}", self.order);
            return Err(Failure::Usage(message));
        }
        Ok(Settings {
            order: Order::new(self.order)?,
            internal_order: Order::new(internal)?,
            exponential: self.exponential,
            overlap: self.overlap,
            self_shadowing: self.self_shadowing,
            indirect: match self.indirect {
                Indirect::None => None,
                Indirect::PointSampled => Some(IndirectOperator::PointSampled),
                Indirect::Averaged => Some(IndirectOperator::Averaged),
                Indirect::Exact => Some(IndirectOperator::Exact),
            },
            receiver_scale: self.receiver_scale,
            upsampling: self.upsampling,
            interpolant: self.interpolate,
            error: self.reach_error.unwrap_or(Settings::default().error),
        })
    }
}

fn scale(text: &str) -> std::result::Result<usize, String> {
    match text {
        "1" => Ok(1),
        "2" => Ok(2),
        "4" => Ok(4),
        _ => Err("1, 2 or 4".into()),
    }
}

fn share(text: &str) -> std::result::Result<f64, String> {
    text.parse().ok().filter(|x| *x > 0.0 && *x < 1.0).ok_or_else(|| "not a number between 0 and 1".into())
}

/// What the frames are computed on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Device {
    /// Processor
    #[default]
    Cpu,
    /// Graphics processor
    Gpu,
}
