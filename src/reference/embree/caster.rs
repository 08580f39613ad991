use embree3::{
    BufferUsage, BuildQuality, Config, Device, DeviceProperty, Format, GeometryKind, IntersectContextExt,
    IntersectContextFlags, Ray, Ray8, Scene, SoAHit, ValidMask, ValidMaskN,
};

use super::directions::{LANES, Packet};
use crate::reference::{EmbreeKernel, EmbreeQuality};
use crate::scene::Geometry;
use crate::{Error, Result};

/// A scene in Embree, in its fast mode (not its robust one).
///
/// Origins and directions are single precision. Faces that a receiver leaves out are left out by number, in a filter
/// that Embree calls at every hit; a scene built without it is faster and takes only receivers that leave out nothing.
pub struct EmbreeScene {
    scene: Scene<'static>,
    filters: bool,
}

/// What the filter finds beside the context of a query.
pub(super) type Excluded<'a> = &'a [u32];

/// One lane for each ray of a packet.
const ALL: ValidMaskN<LANES> = ValidMaskN::all_active();

/// A receiver as Embree sees it.
pub(super) struct Query<'a> {
    pub(super) origin: [f32; 3],
    /// Columns of the linear map from a packet's directions to the world's.
    pub(super) frame: [[f32; 3]; 3],
    /// Normal of a horizon below which nothing is visible, for directions that reach below it.
    pub(super) horizon: Option<[f32; 3]>,
    pub(super) excluded: Excluded<'a>,
}

/// Working memory of one thread.
#[derive(Default)]
pub(super) struct Rays {
    stream: Vec<Ray>,
    /// Of the packets in the stream.
    numbers: Vec<usize>,
}

impl EmbreeScene {
    /// Builds Embree's tree of all triangles of `geometry` on the threads of the current rayon pool; `filters` lets receivers
    /// leave out faces.
    ///
    /// # Errors
    /// [`Error::Input`] with what Embree says.
    pub fn new(geometry: &Geometry, quality: EmbreeQuality, filters: bool) -> Result<Self> {
        let refuse = |error| Error::input(format!("Embree cannot build the scene: {error:?}"));
        let threads = rayon::current_num_threads() as u32;
        let device =
            Device::with_config(Config { threads, report_errors: false, ..Config::default() }).map_err(refuse)?;
        let mut scene = device.create_scene().map_err(refuse)?;
        scene.set_build_quality(match quality {
            EmbreeQuality::Medium => BuildQuality::MEDIUM,
            EmbreeQuality::High => BuildQuality::HIGH,
        });
        if !geometry.triangles.is_empty() {
            let mut mesh = device.create_geometry(GeometryKind::TRIANGLE).map_err(refuse)?;
            let (positions, triangles) = (&geometry.positions, &geometry.triangles);
            mesh.set_new_buffer::<[f32; 3]>(BufferUsage::VERTEX, 0, Format::FLOAT3, 12, positions.len())
                .map_err(refuse)?
                .iter_mut()
                .zip(positions.iter())
                .for_each(|(slot, position)| *slot = position.to_array());
            mesh.set_new_buffer::<[u32; 3]>(BufferUsage::INDEX, 0, Format::UINT3, 12, triangles.len())
                .map_err(refuse)?
                .copy_from_slice(triangles);
            if filters {
                mesh.set_occluded_filter_function::<_, ()>(|_, hits, mut valid, context, _| {
                    // SAFETY: every query below is made with an `IntersectContextExt<Excluded>`, which outlives it.
                    let excluded = unsafe { context.ext::<Excluded>() };
                    for lane in 0..valid.len() {
                        if excluded.contains(&hits.prim_id(lane)) {
                            valid[lane] = ValidMask::Invalid as i32;
                        }
                    }
                });
            }
            scene.attach_geometry(&mesh.commit());
        }
        scene.commit();
        match device.get_error() {
            embree3::Error::NONE => Ok(Self { scene, filters }),
            error => Err(refuse(error)),
        }
    }

    /// The library's version, such as 3.13.5.
    ///
    /// # Errors
    /// [`Error::Input`] with what Embree says.
    pub fn version() -> Result<String> {
        let refuse = |error| Error::input(format!("Embree does not start: {error:?}"));
        let device =
            Device::with_config(Config { threads: 1, report_errors: false, ..Config::default() }).map_err(refuse)?;
        let number = device.get_property(DeviceProperty::VERSION).map_err(refuse)?;
        Ok(format!("{}.{}.{}", number / 10_000, number / 100 % 100, number % 100))
    }

    /// Whether receivers may leave out faces.
    pub fn filters(&self) -> bool {
        self.filters
    }

    /// Casts the rays of `packets` and hands to `visible` the packets with rays that meet nothing, by number, and 1 for
    /// those rays and 0 for the others.
    pub(super) fn cast(
        &self,
        kernel: EmbreeKernel,
        query: &Query,
        packets: &[Packet],
        rays: &mut Rays,
        mut visible: impl FnMut(usize, &[f32; LANES]),
    ) {
        let Query { origin, frame, horizon, excluded } = query;
        let mut context = IntersectContextExt::<Excluded>::new(IntersectContextFlags::INCOHERENT, excluded);
        let turned = packets.iter().map(|packet| packet.turned(frame)).enumerate();
        let mut turned = turned.filter(|(_, directions)| {
            horizon.is_none_or(|normal| above(normal, directions).iter().any(|&above| above > 0.0))
        });
        let mut report = |number, directions: &[[f32; LANES]; 3], ends: [f32; LANES]| {
            // Embree marks rays that meet something by an end at minus infinity.
            let mut escaped = ends.map(|end| f32::from(u8::from(end > 0.0)));
            if let Some(normal) = *horizon {
                let above = above(normal, directions);
                (0..LANES).for_each(|lane| escaped[lane] *= f32::from(u8::from(above[lane] > 0.0)));
            }
            if escaped != [0.0; LANES] {
                visible(number, &escaped);
            }
        };
        match kernel {
            EmbreeKernel::Packets => {
                let mut packet = Ray8::new([*origin; LANES], [[0.0; 3]; LANES]);
                for (number, directions) in turned {
                    [packet.dir_x, packet.dir_y, packet.dir_z] = directions;
                    packet.tfar = [f32::INFINITY; LANES];
                    self.scene.occluded8(&mut context, &mut packet, &ALL);
                    report(number, &directions, packet.tfar);
                }
            }
            EmbreeKernel::Streams => {
                let Rays { stream, numbers } = rays;
                stream.clear();
                numbers.clear();
                for (number, [x, y, z]) in &mut turned {
                    let ray = |lane| Ray::segment(*origin, [x[lane], y[lane], z[lane]], 0.0, f32::INFINITY);
                    stream.extend((0..LANES).map(ray));
                    numbers.push(number);
                }
                self.scene.occluded_stream_aos(&mut context, stream);
                for (&number, packet) in numbers.iter().zip(stream.as_chunks::<LANES>().0) {
                    let directions =
                        [packet.map(|ray| ray.dir_x), packet.map(|ray| ray.dir_y), packet.map(|ray| ray.dir_z)];
                    report(number, &directions, packet.map(|ray| ray.tfar));
                }
            }
        }
    }
}

/// Cosines with a normal, lane by lane.
fn above(normal: [f32; 3], [x, y, z]: &[[f32; LANES]; 3]) -> [f32; LANES] {
    std::array::from_fn(|lane| normal[0] * x[lane] + normal[1] * y[lane] + normal[2] * z[lane])
}
