use glam::Vec3;

/// A ball that stands for a part of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Centre, in the frame of the joint it hangs on, or else of the world.
    pub center: Vec3,
    /// Radius, positive.
    pub radius: f32,
    /// The joint it moves with.
    pub joint: Option<u32>,
}

/// The spheres that stand for one body.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SphereSet {
    /// In no particular order.
    pub spheres: Vec<Sphere>,
}
