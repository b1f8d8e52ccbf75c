//! The values of animation channels (translation, rotation, scale, morph weights) at one moment,
//! interpolated between the keys of a glTF file. glTF 2.0, 3.11 and appendix C.

use crate::import::MeshError;
use crate::import::context::Context;
use crate::import::gltf::data::accessor::Reader;
use crate::import::gltf::data::attribute::{KEY_ROTATIONS, KEY_VECTORS, KEY_WEIGHTS, Rule, TIMES};
use crate::import::gltf::document::lists::Index;
use serde::Deserialize;
use std::collections::BTreeMap;

/// `animation`
#[derive(Debug, Deserialize)]
pub struct Animation {
    pub channels: Vec<JsonChannel>,
    pub samplers: Vec<Sampler>,
}

/// `animation.channel`
#[derive(Debug, Deserialize)]
pub struct JsonChannel {
    pub sampler: Index,
    pub target: Target,
}

/// `animation.channel.target`
#[derive(Debug, Deserialize)]
pub struct Target {
    pub node: Option<Index>,
    pub path: String,
}

/// `animation.sampler`
#[derive(Debug, Deserialize)]
pub struct Sampler {
    pub input: Index,
    pub output: Index,
    pub interpolation: Option<String>,
}

/// One channel of the animation, and its sampler.
pub struct Channel<'a> {
    /// Its name in errors.
    pub what: &'a str,
    /// Its index.
    pub sampler: Index,
}

/// Reads samplers at one time.
pub struct Sampling<'a> {
    animation: &'a Animation,
    time_s: f64,
    /// Key times by accessor: channels often share them.
    moments: BTreeMap<usize, Moment>,
}

/// A time and the two keys around it. Before the first key and after the last, both are that key.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Moment {
    keys: usize,
    before: usize,
    after: usize,
    /// 0 at the key before, 1 at the key after.
    share: f64,
    /// Seconds between the keys.
    span_s: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Interpolation {
    Step,
    Linear,
    Cubic,
}

/// The moment, the interpolation and the key values of a channel.
type Keys<const N: usize> = (Moment, Interpolation, Vec<[f64; N]>);

impl<'a> Sampling<'a> {
    /// A reader that has read nothing yet.
    pub fn new(animation: &'a Animation, time_s: f64) -> Self {
        Self { animation, time_s, moments: BTreeMap::new() }
    }

    /// A translation or a scale.
    pub fn vector(
        &mut self,
        channel: &Channel<'_>,
        reader: &mut Reader<'_>,
        cx: &mut Context<'_>,
    ) -> Result<[f64; 3], MeshError> {
        let (moment, interpolation, values) = self.values::<3>(channel, &KEY_VECTORS, 1, reader, cx)?;
        Ok(interpolate(&moment, interpolation, |i| values[i]))
    }

    /// A unit quaternion.
    pub fn rotation(
        &mut self,
        channel: &Channel<'_>,
        reader: &mut Reader<'_>,
        cx: &mut Context<'_>,
    ) -> Result<[f64; 4], MeshError> {
        let (moment, interpolation, values) = self.values::<4>(channel, &KEY_ROTATIONS, 1, reader, cx)?;
        if interpolation == Interpolation::Linear {
            return Ok(slerp(values[moment.before], values[moment.after], moment.share));
        }
        // The matrix normalises it, as the specification requires for a spline.
        Ok(interpolate(&moment, interpolation, |i| values[i]))
    }

    /// The weights of morph targets.
    pub fn weights(
        &mut self,
        channel: &Channel<'_>,
        targets: usize,
        reader: &mut Reader<'_>,
        cx: &mut Context<'_>,
    ) -> Result<Vec<f64>, MeshError> {
        let (moment, interpolation, values) = self.values::<1>(channel, &KEY_WEIGHTS, targets, reader, cx)?;
        cx.budget.spend("morph weights", targets as u64, 8)?;
        let weight = |target: usize| interpolate(&moment, interpolation, |i| values[i * targets + target])[0];
        Ok((0..targets).map(weight).collect())
    }

    /// The keys of a channel with `per_key` values per key, and three times as many for a spline.
    fn values<const N: usize>(
        &mut self,
        channel: &Channel<'_>,
        rule: &Rule,
        per_key: usize,
        reader: &mut Reader<'_>,
        cx: &mut Context<'_>,
    ) -> Result<Keys<N>, MeshError> {
        let broken = |detail: String| MeshError::broken(format!("{} of the glTF file {detail}", channel.what));
        let sampler = self.animation.samplers.get(channel.sampler.0);
        let sampler = sampler.ok_or_else(|| broken("uses a sampler that is not there".into()))?;
        let interpolation = match sampler.interpolation.as_deref() {
            None | Some("LINEAR") => Interpolation::Linear,
            Some("STEP") => Interpolation::Step,
            Some("CUBICSPLINE") => Interpolation::Cubic,
            Some(other) => return Err(broken(format!("has the interpolation \"{other:.20}\", which is unknown"))),
        };
        let moment = match self.moments.get(&sampler.input.0) {
            Some(known) => *known,
            None => {
                let times: Vec<[f64; 1]> = reader.vectors(sampler.input.0, &TIMES, cx)?;
                let moment = locate(&times, self.time_s)
                    .ok_or_else(|| broken("has key times that do not rise, or none".into()))?;
                self.moments.insert(sampler.input.0, moment);
                moment
            }
        };
        let values: Vec<[f64; N]> = reader.vectors(sampler.output.0, rule, cx)?;
        let times = if interpolation == Interpolation::Cubic { 3 } else { 1 };
        let needed = moment.keys as u64 * per_key as u64 * times;
        if values.len() as u64 != needed {
            let (keys, has) = (moment.keys, values.len());
            return Err(broken(format!("has {keys} key times, which need {needed} values, and {has} values")));
        }
        Ok((moment, interpolation, values))
    }
}

fn locate(times: &[[f64; 1]], time_s: f64) -> Option<Moment> {
    let rises = times.windows(2).all(|pair| pair[0][0] < pair[1][0]);
    if !rises || times.iter().flatten().any(|t| !t.is_finite()) {
        return None;
    }
    let last = times.len().checked_sub(1)?;
    let next = times.partition_point(|t| t[0] <= time_s);
    let (before, after) = (next.saturating_sub(1), next.min(last));
    let span_s = times[after][0] - times[before][0];
    let share = if before == after { 0.0 } else { (time_s - times[before][0]) / span_s };
    Some(Moment { keys: times.len(), before, after, share, span_s })
}

/// The interpolated value. `value` gives keys by index; for a spline it gives each key's
/// in-tangent, value and out-tangent.
fn interpolate<const N: usize>(
    moment: &Moment,
    interpolation: Interpolation,
    value: impl Fn(usize) -> [f64; N],
) -> [f64; N] {
    let &Moment { before, after, share: t, span_s, .. } = moment;
    match interpolation {
        Interpolation::Step => value(before),
        Interpolation::Linear => {
            let (a, b) = (value(before), value(after));
            std::array::from_fn(|k| a[k] * (1.0 - t) + b[k] * t)
        }
        Interpolation::Cubic => {
            let (a, out) = (value(3 * before + 1), value(3 * before + 2));
            let (into, b) = (value(3 * after), value(3 * after + 1));
            let (t2, t3) = (t * t, t * t * t);
            std::array::from_fn(|k| {
                (2.0 * t3 - 3.0 * t2 + 1.0) * a[k]
                    + span_s * (t3 - 2.0 * t2 + t) * out[k]
                    + (3.0 * t2 - 2.0 * t3) * b[k]
                    + span_s * (t3 - t2) * into[k]
            })
        }
    }
}

/// Spherical interpolation along the shorter arc.
fn slerp(a: [f64; 4], b: [f64; 4], t: f64) -> [f64; 4] {
    let unit = |q: [f64; 4]| {
        let length = q.iter().map(|c| c * c).sum::<f64>().sqrt();
        if length > 0.0 { q.map(|c| c / length) } else { q }
    };
    let (a, b) = (unit(a), unit(b));
    let dot: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
    let angle = libm::acos(dot.abs().min(1.0));
    let sine = libm::sin(angle);
    // For a small angle the sine in the denominator vanishes; linear interpolation is exact enough.
    let (of_a, of_b) =
        if sine < 1e-9 { (1.0 - t, t) } else { (libm::sin(angle * (1.0 - t)) / sine, libm::sin(angle * t) / sine) };
    let of_b = of_b.copysign(of_b * dot);
    std::array::from_fn(|k| of_a * a[k] + of_b * b[k])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_lie_between_keys_and_stop_at_the_ends() {
        let times = [[1.0], [2.0], [4.0]];
        let at = |t| locate(&times, t).map(|m| (m.before, m.after, m.share));
        assert_eq!(at(0.0), Some((0, 0, 0.0)));
        assert_eq!(at(1.0), Some((0, 1, 0.0)));
        assert_eq!(at(3.0), Some((1, 2, 0.5)));
        assert_eq!(at(4.0), Some((2, 2, 0.0)));
        assert_eq!(at(1e300), Some((2, 2, 0.0)));
        assert_eq!(locate(&[], 0.0), None);
        assert_eq!(locate(&[[1.0], [1.0]], 0.0), None);
        assert_eq!(locate(&[[f64::NAN]], 0.0), None);
    }

    #[test]
    fn arcs_are_short_and_even() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let (a, b) = ([0.0, 0.0, 0.0, 1.0], [0.0, 0.0, half, half]);
        for (sign, t) in [(1.0, 0.25), (-1.0, 0.25), (1.0, 2.0 / 3.0)] {
            let q = slerp(a, b.map(|c| c * sign), t);
            let quarter = std::f64::consts::FRAC_PI_4 * t;
            let expected = [0.0, 0.0, libm::sin(quarter), libm::cos(quarter)];
            assert!(q.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{q:?}");
        }
        assert_eq!(slerp(a, a, 0.3), a);
    }
}
