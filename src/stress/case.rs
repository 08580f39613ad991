use std::sync::Arc;

use glam::DMat3;

use crate::bake::Receivers;
use crate::scene::Geometry;

/// A scene with receivers and what is known about their answers.
///
/// The answer of one receiver is a row of numbers: the SH coefficients of its visibility, then, if the receivers have
/// normals, its ambient occlusion.
#[derive(Clone)]
pub struct Case {
    /// What is degenerate about it.
    pub name: String,
    /// The scene.
    pub geometry: Arc<Geometry>,
    /// Who looks.
    pub receivers: Receivers,
    /// What they must see.
    pub truth: Truth,
}

/// What is known about the answers of a [`Case`], apart from what rays say.
#[derive(Clone)]
pub enum Truth {
    /// One row per receiver, from a closed form.
    Known(Vec<Vec<f64>>),
    /// A sum of the answers of other scenes by the same method.
    Sum(Vec<Term>),
    /// No receiver gets more light than in this scene by the same method.
    AtMost(Arc<Geometry>),
    /// Nothing: the rays decide, and between the methods the exact one.
    Rays,
}

/// The answers of a scene as part of a sum, receiver by receiver.
#[derive(Clone)]
pub struct Term {
    /// Its factor.
    pub weight: f64,
    /// The scene.
    pub geometry: Arc<Geometry>,
    /// As many receivers as the case has.
    pub receivers: Receivers,
    /// Applied to the coefficients.
    pub rotation: DMat3,
}

impl Term {
    /// The answers as they are.
    pub fn of(geometry: &Arc<Geometry>, receivers: &Receivers) -> Self {
        Self { weight: 1.0, geometry: geometry.clone(), receivers: receivers.clone(), rotation: DMat3::IDENTITY }
    }

    /// The same with another factor.
    pub fn times(self, weight: f64) -> Self {
        Self { weight, ..self }
    }
}
