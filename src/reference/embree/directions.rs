use std::f64::consts::{FRAC_1_PI, PI, TAU};

use glam::DVec3;

use crate::Result;
use crate::reference::{PixelDistribution, Sobol};
use crate::scene::Environment;
use crate::sphere::{Order, evaluate};

/// Rays in a packet.
pub(super) const LANES: usize = 8;

/// Eight neighbouring directions.
#[derive(Clone, Copy)]
pub(super) struct Packet([[f32; LANES]; 3]);

impl Packet {
    /// The directions as x, y and z, after the linear map with the columns `frame`.
    pub(super) fn turned(&self, frame: &[[f32; 3]; 3]) -> [[f32; LANES]; 3] {
        let Self([x, y, z]) = self;
        let [a, b, c] = frame;
        [0, 1, 2].map(|k| std::array::from_fn(|lane| a[k] * x[lane] + b[k] * y[lane] + c[k] * z[lane]))
    }
}

/// One Owen-scrambled Sobol set of directions and what each contributes to every integral if it is visible.
///
/// The set is cut into eight *blocks* of consecutive points, each of them a net of its own, and sorted along a Morton curve of
/// the square. Eight points that follow each other there fill an elementary interval, in which each block has exactly one
/// point: they are one packet, and lane `j` is of block `j`. So packets are coherent, a lane's sum is the estimate of a
/// smaller net, and the mean over the lanes is that of the whole set.
pub(super) struct Directions {
    packets: Vec<Packet>,
    /// Contributions by packet, integral and lane.
    contributions: Vec<[f32; LANES]>,
    integrals: usize,
    stand_still: bool,
}

/// How directions are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Density {
    /// Evenly over the sphere.
    Sphere,
    /// Evenly over the hemisphere z > 0.
    Hemisphere,
    /// In proportion to the cosine with +z.
    Cosine,
}

impl Directions {
    /// `points` directions, a power of two and at least [`LANES`]; `map` gives the direction of a point of the square, and
    /// writes what it contributes.
    fn new(points: u32, sobol: Sobol, integrals: usize, map: impl Fn([f64; 2], &mut [f64]) -> DVec3) -> Self {
        let block = points / LANES as u32;
        let mut order: Vec<(u32, u32)> = (0..points).map(|index| (morton(sobol.point(index)), index)).collect();
        order.sort_unstable();
        let mut packets = Vec::with_capacity(block as usize);
        let mut contributions = vec![[0.0; LANES]; block as usize * integrals];
        let mut row = vec![0.0; integrals];
        for (number, neighbours) in order.as_chunks::<LANES>().0.iter().enumerate() {
            let mut packet = Packet([[0.0; LANES]; 3]);
            for &(_, index) in neighbours {
                let lane = (index / block) as usize;
                let w = map(sobol.point(index), &mut row).as_vec3();
                packet.0.iter_mut().zip(w.to_array()).for_each(|(axis, w)| axis[lane] = w);
                let places = &mut contributions[number * integrals..][..integrals];
                places.iter_mut().zip(&row).for_each(|(place, &value)| place[lane] = value as f32);
            }
            packets.push(packet);
        }
        Self { packets, contributions, integrals, stand_still: false }
    }

    /// Directions in a receiver's frame, whose normal is +z. Integrals: 1/pi integral of V cos, unless over the
    /// `Sphere`; the harmonics of V of `visibility`; those of 1/pi V cos of `transfer`.
    pub(super) fn around_normal(
        points: u32,
        sobol: Sobol,
        density: Density,
        visibility: Option<Order>,
        transfer: Option<Order>,
    ) -> Self {
        let [visible, transferred] = [visibility, transfer].map(|order| order.map_or(0, Order::len));
        let mut y = vec![0.0; visible.max(transferred)];
        let scratch = std::cell::RefCell::new(&mut y);
        Self::new(points, sobol, 1 + visible + transferred, |[s, t], row| {
            let (z, r, inverse) = match density {
                Density::Sphere => (2.0 * s - 1.0, (4.0 * s * (1.0 - s)).sqrt(), 4.0 * PI),
                Density::Hemisphere => (s, ((1.0 - s) * (1.0 + s)).sqrt(), TAU),
                Density::Cosine => (s.sqrt(), (1.0 - s).sqrt(), PI / s.sqrt()),
            };
            let (sine, cosine) = (TAU * t).sin_cos();
            let w = DVec3::new(r * cosine, r * sine, z);
            let mut y = scratch.borrow_mut();
            if let Some(order) = visibility.max(transfer) {
                evaluate(order, w, &mut y);
            }
            let (first, rest) = row.split_at_mut(1);
            let (second, third) = rest.split_at_mut(visible);
            first[0] = FRAC_1_PI * z * inverse;
            second.iter_mut().zip(&**y).for_each(|(out, y)| *out = inverse * y);
            third.iter_mut().zip(&**y).for_each(|(out, y)| *out = FRAC_1_PI * z * inverse * y);
            w
        })
    }

    /// Directions in the world in proportion to the light that comes from them. Integrals: L V w, colours of axes.
    pub(super) fn towards_light(points: u32, sobol: Sobol, environment: &Environment) -> Result<Self> {
        let distribution = PixelDistribution::of(environment)?;
        let directions = Self::new(points, sobol, 9, |point, row| {
            let (w, density) = distribution.sample(point);
            let radiance = environment.radiance(w).as_dvec3() / density;
            row.copy_from_slice(radiance.to_array().map(|l| (l * w).to_array()).as_flattened());
            w
        });
        Ok(Self { stand_still: true, ..directions })
    }

    /// The set, along the curve.
    pub(super) fn packets(&self) -> &[Packet] {
        &self.packets
    }

    /// Number of integrals.
    pub(super) fn integrals(&self) -> usize {
        self.integrals
    }

    /// Whether the directions are the world's own, and may lie below a receiver's horizon.
    pub(super) fn stand_still(&self) -> bool {
        self.stand_still
    }

    /// Contributions of the directions of packet `number`, by integral.
    pub(super) fn contributions(&self, number: usize) -> &[[f32; LANES]] {
        &self.contributions[number * self.integrals..][..self.integrals]
    }
}

/// The cell of a point of the unit square along a Morton curve whose every prefix is an elementary interval in base two.
fn morton([x, y]: [f64; 2]) -> u32 {
    let spread = |x: f64| {
        let cell = (x * 65536.0) as u32;
        (0..16).fold(0, |code, bit| code | ((cell >> bit) & 1) << (2 * bit))
    };
    spread(x) << 1 | spread(y)
}
