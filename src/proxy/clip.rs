use std::collections::BTreeMap;

use glam::{DAffine3, DQuat, DVec3, DVec4};
use gltf::accessor::{DataType, Dimensions};
use gltf::animation::{Animation, Interpolation, Property};
use gltf::{Accessor, buffer};

use crate::scene::gltf_read::{Checked, values};

/// A movement of a character's joints.
#[derive(Clone, Debug)]
pub struct Clip {
    /// Its name in the file, `clip 3` where it has none.
    pub name: String,
    /// The last of its key times, in seconds. Later the last pose stays.
    pub duration: f64,
    channels: Vec<Channel>,
}

/// One property of one node.
#[derive(Clone, Debug)]
struct Channel {
    node: usize,
    property: Property,
    interpolation: Interpolation,
    times: Vec<f32>,
    /// One for every time; before and after it, for cubic splines, the tangents that go in and out.
    values: Vec<DVec4>,
}

/// Where a node stands in its parent's frame: scaled, then turned, then moved.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub(super) translation: DVec3,
    pub(super) rotation: DQuat,
    pub(super) scale: DVec3,
}

impl Place {
    pub(super) fn affine(self) -> DAffine3 {
        DAffine3::from_scale_rotation_translation(self.scale, self.rotation, self.translation)
    }
}

impl Clip {
    /// Reads an animation. Channels of morph targets are left out: they keep their default weights.
    pub(super) fn read(animation: &Animation, buffers: &[buffer::Data]) -> Checked<Self> {
        let name = animation.name().map_or_else(|| format!("clip {}", animation.index()), str::to_owned);
        let mut channels = Vec::new();
        for channel in animation.channels() {
            let property = channel.target().property();
            if property == Property::MorphTargetWeights {
                continue;
            }
            let wrong = |message: String| format!("clip `{name}`, channel {}: {message}", channel.index());
            let sampler = channel.sampler();
            let times = values::<f32>(&sampler.input(), Dimensions::Scalar, DataType::F32, buffers).map_err(wrong)?;
            if !times.is_sorted_by(|a, b| a < b) || !times.iter().all(|t| t.is_finite()) {
                return Err(wrong("its times do not rise".into()));
            }
            let values = outputs(&sampler.output(), property, buffers).map_err(wrong)?;
            let per_time = if sampler.interpolation() == Interpolation::CubicSpline { 3 } else { 1 };
            if values.len() != per_time * times.len() {
                return Err(wrong(format!("{} values belong to {} times", values.len(), times.len())));
            }
            if let Some(value) = values.iter().find(|value| !value.is_finite()) {
                return Err(wrong(format!("the value {value} is not finite")));
            }
            let (node, interpolation) = (channel.target().node().index(), sampler.interpolation());
            channels.push(Channel { node, property, interpolation, times, values });
        }
        let duration = channels.iter().filter_map(|channel| channel.times.last()).copied().fold(0.0, f32::max);
        Ok(Self { name, duration: duration.into(), channels })
    }

    /// The places at `time`, in seconds, of the nodes that move, by node; `rest` gives what the clip leaves alone.
    pub(super) fn places(&self, time: f64, rest: impl Fn(usize) -> Place) -> BTreeMap<usize, Place> {
        let mut places = BTreeMap::new();
        for channel in &self.channels {
            let place = places.entry(channel.node).or_insert_with(|| rest(channel.node));
            let value = channel.at(time);
            match channel.property {
                Property::Translation => place.translation = value.truncate(),
                Property::Rotation => place.rotation = DQuat::from_vec4(value),
                Property::Scale => place.scale = value.truncate(),
                Property::MorphTargetWeights => {}
            }
        }
        places
    }
}

impl Channel {
    /// The value at a time, as the format's specification, appendix C, has it.
    fn at(&self, time: f64) -> DVec4 {
        let is_rotation = self.property == Property::Rotation;
        let stride = if self.interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        let value = |k: usize| {
            let value = self.values[stride * k + stride / 2];
            if is_rotation { value.normalize_or(DVec4::W) } else { value }
        };
        let next = self.times.partition_point(|&t| f64::from(t) <= time);
        if next == 0 {
            return value(0);
        }
        if next == self.times.len() {
            return value(next - 1);
        }
        let [from, to] = [self.times[next - 1], self.times[next]].map(f64::from);
        let (step, t) = (to - from, (time - from) / (to - from));
        let (a, b) = (value(next - 1), value(next));
        match self.interpolation {
            Interpolation::Step => a,
            // Along the shorter arc.
            Interpolation::Linear if is_rotation => DQuat::from_vec4(a).slerp(DQuat::from_vec4(b), t).into(),
            Interpolation::Linear => a.lerp(b, t),
            Interpolation::CubicSpline => {
                let (leaving, arriving) = (self.values[stride * (next - 1) + 2], self.values[stride * next]);
                let (t2, t3) = (t * t, t * t * t);
                let spline = (2.0 * t3 - 3.0 * t2 + 1.0) * self.values[stride * (next - 1) + 1]
                    + step * (t3 - 2.0 * t2 + t) * leaving
                    + (3.0 * t2 - 2.0 * t3) * self.values[stride * next + 1]
                    + step * (t3 - t2) * arriving;
                if is_rotation { spline.normalize_or(DVec4::W) } else { spline }
            }
        }
    }
}

fn outputs(accessor: &Accessor, property: Property, buffers: &[buffer::Data]) -> Checked<Vec<DVec4>> {
    if property != Property::Rotation {
        let triples = values::<[f32; 3]>(accessor, Dimensions::Vec3, DataType::F32, buffers)?;
        return Ok(triples.into_iter().map(|v| DVec3::from_array(v.map(f64::from)).extend(0.0)).collect());
    }
    // Integers are fractions of their greatest value.
    let vec4 = Dimensions::Vec4;
    let quaternions: Vec<[f64; 4]> = match accessor.data_type() {
        kind @ DataType::I8 => {
            let all = values::<[i8; 4]>(accessor, vec4, kind, buffers)?;
            all.into_iter().map(|q| q.map(|x| (f64::from(x) / 127.0).max(-1.0))).collect()
        }
        kind @ DataType::U8 => {
            let all = values::<[u8; 4]>(accessor, vec4, kind, buffers)?;
            all.into_iter().map(|q| q.map(|x| f64::from(x) / 255.0)).collect()
        }
        kind @ DataType::I16 => {
            let all = values::<[i16; 4]>(accessor, vec4, kind, buffers)?;
            all.into_iter().map(|q| q.map(|x| (f64::from(x) / 32767.0).max(-1.0))).collect()
        }
        kind @ DataType::U16 => {
            let all = values::<[u16; 4]>(accessor, vec4, kind, buffers)?;
            all.into_iter().map(|q| q.map(|x| f64::from(x) / 65535.0)).collect()
        }
        _ => {
            let all = values::<[f32; 4]>(accessor, vec4, DataType::F32, buffers)?;
            all.into_iter().map(|q| q.map(f64::from)).collect()
        }
    };
    Ok(quaternions.into_iter().map(DVec4::from_array).collect())
}
