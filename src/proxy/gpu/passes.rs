use bytemuck::{Pod, Zeroable};
use wgpu::{Buffer, CommandEncoder};

use super::Gpu;
use super::kernel::{Kernel, Stage, Timer, groups_of_8x8, groups_of_64};
use super::source::Source;
use crate::proxy::coverage::FADE;
use crate::proxy::direct_product::{DIRECTIONS, RIM};
use crate::proxy::exponential::{HYB_BOUND, PS2_BOUND};
use crate::proxy::self_shadow::INSIDE;
use crate::proxy::shade::COSINE;
use crate::proxy::upsample::{LEAST_WEIGHT, PLANE_DISTANCE};
use crate::proxy::{
    ClippedCapTable, DirectProduct, Exponential, Exponentiator, IndirectOperator, IndirectTable, Interpolant, LogTable,
    ReflectedLight, SelfShadowing, Settings, ShadingLight, Upsampling,
};
use crate::{Error, Result};

/// What a pass knows of the receivers it works on: `View` of receivers.wgsl.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(super) struct View {
    pub(super) size: [u32; 2],
    pub(super) count: u32,
    pub(super) proxies: u32,
    pub(super) fine_size: [u32; 2],
    pub(super) scale: u32,
    pub(super) pixel: f32,
    pub(super) shadow_expansion: f32,
    pub(super) indirect_expansion: f32,
    pub(super) reflects: u32,
    pub(super) first_row: u32,
    pub(super) fine_first_row: u32,
    pub(super) padding: [u32; 3],
}

/// Bytes of a receiver.
const RECEIVER: usize = 48;

/// The buffers of some receivers.
pub(super) struct Buffers {
    pub(super) view: Buffer,
    pub(super) receivers: Buffer,
    pub(super) transfer: Buffer,
    pub(super) log: Buffer,
    pub(super) visibility: Buffer,
    pub(super) indirect: Buffer,
    pub(super) shading: Buffer,
}

/// The light as the passes want it.
pub(super) struct Light {
    pub(super) coefficients: Buffer,
    product: Buffer,
    reflected: Buffer,
}

impl Light {
    pub(super) fn new(gpu: &Gpu, shading: &ShadingLight, reflected: &ReflectedLight) -> Self {
        let padded = |colours: &[[f32; 3]]| colours.iter().map(|[r, g, b]| [*r, *g, *b, 0.0]).collect::<Vec<_>>();
        let mut parts = [[0.0; 4]; 9];
        for colour in 0..3 {
            let [x, y, z] = reflected.linear[colour];
            let [xx, yy, zz, xy, yz, zx] = reflected.quadratic[colour];
            parts[colour] = [x, y, z, reflected.constant[colour]];
            parts[3 + colour] = [xx, yy, zz, 0.0];
            parts[6 + colour] = [xy, yz, zx, 0.0];
        }
        Self {
            coefficients: gpu.buffer("light", &padded(shading.coefficients())),
            product: gpu.uniform("product", &padded(shading.product())),
            reflected: gpu.uniform("reflected", &parts),
        }
    }
}

/// Empty tiles and pairs of tiles and proxies, for shadows and then for indirect light.
pub(super) const COUNTS: usize = 4;

/// The passes over receivers, and those between receivers and pixels.
pub(super) struct Passes {
    shadows: Shadows,
    splat_indirect: Kernel,
    shade: Kernel,
    pub(super) upsample: Kernel,
    pub(super) gather: Kernel,
    pub(super) scatter: Kernel,
    pub(super) base: Kernel,
    clipped: Buffer,
    indirect_table: Buffer,
    sizes: Sizes,
}

/// The way from proxies to visibility, with its tables.
enum Shadows {
    /// Sums of logarithms and their exponentials.
    Logarithms { splat: Kernel, table: Buffer, exponentiate: Kernel, linear: Option<Buffer> },
    /// The product in many directions.
    Product { splat: Kernel, directions: Buffer, projection: Buffer },
}

/// Numbers per receiver.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sizes {
    log: usize,
    visibility: usize,
    /// Rows of shading.
    pub(super) shading: usize,
    pub(super) transfer: usize,
    needed: usize,
}

/// What all shaders are made with.
pub(super) struct Shaders<'a> {
    source: Source<'a>,
}

impl<'a> Shaders<'a> {
    /// For settings, and receivers with transfer vectors or without.
    pub(super) fn new(settings: &Settings, sizes: Sizes, exponentiator: &'a Exponentiator) -> Self {
        let bands = settings.internal_order.bands();
        let needed_bands = sizes.needed.isqrt();
        let rows = if settings.interpolant == Interpolant::Shades { 1 } else { sizes.needed };
        let number = |x: f32| format!("{x:e}");
        let index = |x: usize| format!("{x}u");
        let rule = match settings.self_shadowing {
            SelfShadowing::Whole => "WHOLE",
            SelfShadowing::Clipped => "CLIPPED",
            SelfShadowing::Replaced => "REPLACED",
        };
        let bound = match settings.exponential {
            Exponential::Hyb => HYB_BOUND,
            Exponential::Ps2 => PS2_BOUND,
            Exponential::Ol | Exponential::Matrix | Exponential::Direct => 1e37,
        };
        let linear = exponentiator.optimal_linear();
        let mut constants: Vec<(String, String)> = [
            ("WHOLE", "0u".into()),
            ("CLIPPED", "1u".into()),
            ("REPLACED", "2u".into()),
            ("INSIDE_BELOW", number(INSIDE[0])),
            ("INSIDE_ABOVE", number(INSIDE[1])),
            ("FADE", number(FADE)),
            ("CLIPPED_INTERVALS", index(ClippedCapTable::INTERVALS)),
            ("LOG_INTERVALS", index(LogTable::INTERVALS)),
            ("INDIRECT_INTERVALS", index(IndirectTable::INTERVALS)),
            ("LINEAR_INTERVALS", index(linear.table.len() - 1)),
            ("GREATEST", number(linear.greatest)),
            ("BOUND", number(bound)),
            ("QUADRATIC", (settings.exponential == Exponential::Ps2).to_string()),
            ("EXACT", (settings.indirect == Some(IndirectOperator::Exact)).to_string()),
            ("SHADES", (settings.interpolant == Interpolant::Shades).to_string()),
            ("BILATERAL", (settings.upsampling == Upsampling::Bilateral).to_string()),
            ("HAS_TRANSFER", (sizes.transfer > 0).to_string()),
            ("PLANE_DISTANCE", number(PLANE_DISTANCE)),
            ("RIM", number(RIM)),
        ]
        .map(|(name, value): (&str, String)| (name.to_owned(), value))
        .to_vec();
        let rules = ["WHOLE", "CLIPPED", "REPLACED"].iter().position(|name| *name == rule).unwrap_or_default();
        constants.push(("RULE".into(), index(rules)));
        let least = if settings.upsampling == Upsampling::Bilateral { LEAST_WEIGHT } else { f32::MIN_POSITIVE };
        constants.push(("LEAST_WEIGHT".into(), number(least)));
        // The clamped cosine's own factor on every band of the harmonics.
        for (l, factor) in COSINE.iter().enumerate().take(needed_bands) {
            constants.push((format!("COSINE_{l}"), number(*factor)));
        }
        let counts = vec![
            ("BANDS", bands),
            ("LEN", sizes.log),
            ("OUT_LEN", sizes.visibility),
            ("NEEDED", sizes.needed),
            ("NEEDED_BANDS", needed_bands),
            ("ROWS", rows),
            ("DIRECTIONS", DIRECTIONS),
            ("PRODUCT", sizes.visibility * sizes.visibility),
        ];
        Self { source: Source { constants, counts, exponentiator: Some(exponentiator) } }
    }

    pub(super) fn expand(&self, parts: &[&str]) -> String {
        self.source.expand(parts)
    }
}

impl Sizes {
    /// Bytes that a receiver takes in the largest of its buffers.
    pub(super) fn receiver(&self) -> u64 {
        self.pixel().max(4 * self.log.max(self.visibility).max(4 * self.shading) as u64)
    }

    /// The same for a pixel that only takes from receivers.
    pub(super) fn pixel(&self) -> u64 {
        RECEIVER.max(4 * self.transfer) as u64
    }

    pub(super) fn new(settings: &Settings, transfer_len: usize) -> Self {
        let order = settings.order;
        // As `ShadingLight::needed`.
        let needed = match transfer_len {
            0 if order.bands() <= 4 => order.len().min(9),
            0 => 25,
            _ => order.len(),
        };
        let rows = if settings.interpolant == Interpolant::Shades { 1 } else { needed };
        Self {
            log: if settings.exponential == Exponential::Direct { 0 } else { settings.internal_order.len() },
            visibility: order.len(),
            shading: rows + 1,
            transfer: transfer_len,
            needed,
        }
    }
}

const RECEIVERS: &str = include_str!("receivers.wgsl");
const SELF_SHADOW: &str = include_str!("self_shadow.wgsl");
const TILE: &str = include_str!("tile.wgsl");
const TRANSFER: &str = include_str!("transfer.wgsl");

impl Passes {
    /// Passes for settings and receivers of these sizes.
    ///
    /// # Errors
    /// Shaders that the device refuses.
    pub(super) fn new(gpu: &Gpu, settings: &Settings, sizes: Sizes) -> Result<Self> {
        let exponentiator = Exponentiator::new(settings.exponential, settings.internal_order);
        let shaders = Shaders::new(settings, sizes, &exponentiator);
        let kernel = |label, parts: &[&str]| gpu.kernel(label, "main", shaders.expand(parts));
        let indirect = IndirectTable::new(settings.indirect.unwrap_or_default());
        let shadows = if settings.exponential == Exponential::Direct {
            let product = DirectProduct::new(settings.order);
            Shadows::Product {
                splat: kernel("direct_product", &[RECEIVERS, TILE, SELF_SHADOW, include_str!("direct_product.wgsl")])?,
                directions: gpu.buffer("directions", &product.directions()),
                projection: gpu.buffer("projection", product.projection()),
            }
        } else {
            let is_matrix = settings.exponential == Exponential::Matrix;
            let exponential =
                if is_matrix { include_str!("matrix_exponential.wgsl") } else { include_str!("exponential.wgsl") };
            Shadows::Logarithms {
                splat: kernel("splat", &[RECEIVERS, TILE, SELF_SHADOW, include_str!("splat.wgsl")])?,
                table: gpu.buffer("log table", LogTable::new(settings.internal_order).rows()),
                exponentiate: kernel("exponentiate", &[RECEIVERS, exponential, include_str!("exponentiate.wgsl")])?,
                linear: (!is_matrix).then(|| gpu.buffer("optimal linear", &exponentiator.optimal_linear().table)),
            }
        };
        Ok(Self {
            shadows,
            splat_indirect: kernel(
                "splat_indirect",
                &[RECEIVERS, TILE, SELF_SHADOW, include_str!("splat_indirect.wgsl")],
            )?,
            shade: kernel("shade", &[RECEIVERS, TRANSFER, include_str!("shade.wgsl")])?,
            upsample: kernel("upsample", &[RECEIVERS, TRANSFER, include_str!("upsample.wgsl")])?,
            gather: kernel("gather", &[RECEIVERS, include_str!("gather.wgsl")])?,
            scatter: kernel("scatter", &[RECEIVERS, TRANSFER, include_str!("scatter.wgsl")])?,
            base: kernel("base", &[RECEIVERS, TRANSFER, include_str!("base.wgsl")])?,
            clipped: gpu.buffer("clipped", ClippedCapTable::get().entries()),
            indirect_table: gpu.buffer("indirect table", indirect.rows()),
            sizes,
        })
    }

    /// Buffers for receivers of a size; for pixels that only take from receivers, without what is accumulated.
    ///
    /// # Errors
    /// More than the device holds.
    pub(super) fn buffers(&self, gpu: &Gpu, view: &View, accumulate: bool) -> Result<Buffers> {
        let count = u64::from(view.count);
        let floats = |label: &str, per_receiver: usize| {
            let bytes = 4 * per_receiver as u64 * count;
            gpu.check_size(label, bytes)?;
            Ok::<_, Error>(gpu.zeros(label, bytes))
        };
        let accumulated = |label: &str, per_receiver: usize| floats(label, if accumulate { per_receiver } else { 0 });
        gpu.check_size("receivers", RECEIVER as u64 * count)?;
        Ok(Buffers {
            view: gpu.uniform("view", &[*view]),
            receivers: gpu.zeros("receivers", RECEIVER as u64 * count),
            transfer: floats("transfer vectors", self.sizes.transfer)?,
            log: accumulated("log visibility", self.sizes.log)?,
            visibility: accumulated("visibility", self.sizes.visibility)?,
            indirect: accumulated("indirect light", 4)?,
            shading: accumulated("shading", 4 * self.sizes.shading)?,
        })
    }

    /// Records the passes from the splats to the shading of receivers. `counts` gets [`COUNTS`] numbers added.
    #[expect(clippy::too_many_arguments, reason = "plain buffers in, plain buffers out")]
    pub(super) fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut CommandEncoder,
        timer: &mut Timer,
        buffers: &Buffers,
        view: &View,
        proxies: &Buffer,
        light: &Light,
        counts: &Buffer,
    ) {
        let Buffers { view: parameters, receivers, transfer, log, visibility, indirect, shading } = buffers;
        let tiles = groups_of_8x8(view.size);
        let groups = groups_of_64(view.count);
        match &self.shadows {
            Shadows::Logarithms { splat, table, exponentiate, linear } => {
                let splatted = [parameters, receivers, proxies, &self.clipped, counts, table, log];
                splat.run(gpu, encoder, timer, Stage::Splat, &splatted, tiles);
                let exponentiated: Vec<&Buffer> = [parameters, log, visibility].into_iter().chain(linear).collect();
                exponentiate.run(gpu, encoder, timer, Stage::Exponentiate, &exponentiated, groups);
            }
            Shadows::Product { splat, directions, projection } => {
                let splatted =
                    [parameters, receivers, proxies, &self.clipped, counts, directions, projection, visibility];
                splat.run(gpu, encoder, timer, Stage::Splat, &splatted, tiles);
            }
        }
        if view.reflects != 0 {
            let (table, reflected) = (&self.indirect_table, &light.reflected);
            let lit = [parameters, receivers, proxies, &self.clipped, counts, table, reflected, indirect];
            self.splat_indirect.run(gpu, encoder, timer, Stage::Indirect, &lit, tiles);
        }
        let shaded = [parameters, receivers, transfer, visibility, indirect, &light.product, shading];
        self.shade.run(gpu, encoder, timer, Stage::Shade, &shaded, groups);
    }
}
