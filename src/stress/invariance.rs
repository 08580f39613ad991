//! What must not change the answer, or change it in a known way.

use std::sync::Arc;

use glam::{DMat3, DVec3, Vec3};

use super::battery::case;
use super::pieces::{Triangle, ball, boxes, cuboid, floating, grid, moved, placed, polygon, scene, soup, split};
use super::{Case, Term, Truth};
use crate::Result;
use crate::bake::Receivers;
use crate::scene::Geometry;
use crate::scene::shapes::Random;

/// Transforms that are exact for the scene at hand, relations between scenes, and numbers at the ends of the range.
pub(super) fn invariances(many: usize) -> Result<Vec<Case>> {
    let mut random = Random::new(20);
    let clutter = [boxes(&mut random, 5), soup(&mut random, 40)].concat();
    let geometry = scene(&clutter)?;
    let receivers = floating(&mut random, many, 2.5);
    let same = || Truth::Sum(vec![Term::of(&geometry, &receivers)]);
    let mut cases = Vec::new();

    for (name, exponent) in [
        ("scaled by 2^40", 40),
        ("scaled by 2^-40", -40),
        ("scaled to 1e15", 48),
        ("scaled to 1e-30", -100),
        ("scaled to denormals", -144),
    ] {
        let scale = 2f64.powi(exponent);
        // No product of single precision: 2^-144 is not normal there.
        let scaled = moved(&clutter, |p| (p.as_dvec3() * scale).as_vec3());
        cases.push(case(name, &scaled, placed(&receivers, |p| p * scale, DMat3::IDENTITY), same())?);
    }
    // What is left of single precision there are quarters: boxes, which are on eighths, are brought to them first, or what
    // is there would be another scene.
    let crowd = moved(&boxes(&mut random, 8), |p| (p * 4.0).round() / 4.0);
    let away = 2f64.powi(22) * DVec3::new(-1.0, 0.5, 1.0) + DVec3::new(64.0, 0.0, -64.0);
    let moved_away = moved(&crowd, |p| p + away.as_vec3());
    let there = placed(&receivers, |p| p + away, DMat3::IDENTITY);
    let truth = Truth::Sum(vec![Term::of(&scene(&crowd)?, &receivers)]);
    cases.push(case("moved by 1e6 sizes", &moved_away, there, truth)?);

    // Rotations with rational entries, times the denominator.
    for (name, rows, denominator) in [
        ("turned by a quarter", [[0, 0, 1], [0, 1, 0], [-1, 0, 0]], 1),
        ("turned about a diagonal", [[0, 0, 1], [1, 0, 0], [0, 1, 0]], 1),
        ("turned obliquely", [[2, -1, 2], [2, 2, -1], [-1, 2, 2]], 3),
        ("turned obliquely again", [[2, 3, 6], [-6, -2, 3], [3, -6, 2]], 7),
    ] {
        let matrix = DMat3::from_cols_array_2d(&rows.map(|row| row.map(f64::from)));
        let turn = matrix * (1.0 / f64::from(denominator));
        let turned = moved(&clutter, |p| (matrix * p.as_dvec3()).as_vec3());
        let rotated = Term { rotation: turn, ..Term::of(&geometry, &receivers) };
        let truth = Truth::Sum(vec![rotated]);
        cases.push(case(name, &turned, placed(&receivers, |p| matrix * p, turn), truth)?);
    }

    let mut relabelled: Vec<Triangle> =
        clutter.iter().map(|&[a, b, c]| if random.unit() < 0.5 { [b, c, a] } else { [c, b, a] }).collect();
    for i in (1..relabelled.len()).rev() {
        relabelled.swap(i, (random.unit() * (i + 1) as f64) as usize);
    }
    cases.push(case("relabelled and wound at random", &relabelled, receivers.clone(), same())?);

    let finer: Vec<Triangle> = clutter.iter().flat_map(split).collect();
    cases.push(case("faces split", &finer, receivers.clone(), same())?);

    let more = [clutter.clone(), soup(&mut random, 20)].concat();
    cases.push(case("more occluders, not more light", &more, receivers.clone(), Truth::AtMost(geometry.clone()))?);

    cases.extend(sums(many, &mut random, &clutter, &geometry, &receivers)?);
    Ok(cases)
}

fn sums(
    many: usize,
    random: &mut Random,
    clutter: &[Triangle],
    geometry: &Arc<Geometry>,
    receivers: &Receivers,
) -> Result<Vec<Case>> {
    let empty = scene(&[])?;
    let open = |receivers: &Receivers| Term::of(&empty, receivers);
    let mut cases = Vec::new();

    // Behind a wall for everyone on this side of it, and touching nothing.
    let wall = polygon(&[grid(-480, -48, -480), grid(-480, -48, 480), grid(480, -48, 480), grid(480, -48, -480)]);
    let front = [clutter, &wall].concat();
    let hidden = [front.clone(), moved(clutter, |p| p - Vec3::new(0.0, 8.0, 0.0))].concat();
    let near = placed(receivers, |p| DVec3::new(p.x, p.y.max(-2.0), p.z), DMat3::IDENTITY);
    let truth = Truth::Sum(vec![Term::of(&scene(&front)?, &near)]);
    cases.push(case("hidden geometry added", &hidden, near, truth)?);

    // On either side of all receivers.
    let (left, right) = (ball(grid(-128, 0, 0), 1.5)?, cuboid(grid(96, -16, -16), grid(128, 16, 16)));
    let both = [left.clone(), right.clone()].concat();
    let between = floating(random, many, 2.0);
    let truth = Truth::Sum(vec![
        Term::of(&scene(&left)?, &between),
        Term::of(&scene(&right)?, &between),
        open(&between).times(-1.0),
    ]);
    cases.push(case("disjoint occluders add up", &both, between, truth)?);

    // A room without a ceiling, and what would close it.
    let room = cuboid(grid(-16, -16, -16), grid(16, 16, 16));
    let (lid, walls): (Vec<Triangle>, Vec<Triangle>) =
        room.into_iter().partition(|t| t.iter().all(|corner| corner.y == 1.0));
    let within = floating(random, many, 0.99);
    let truth = Truth::Sum(vec![open(&within), Term::of(&scene(&lid)?, &within).times(-1.0)]);
    cases.push(case("visible and hidden make the whole", &walls, within, truth)?);

    let probes = Receivers::probes(receivers.positions.clone());
    let up = receivers.clone();
    let down = placed(receivers, |p| p, -DMat3::IDENTITY);
    let truth = Truth::Sum(vec![Term::of(geometry, &up), Term::of(geometry, &down)]);
    cases.push(case("two hemispheres make the sphere", clutter, probes, truth)?);
    Ok(cases)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Else the case would compare two scenes.
    #[test]
    fn the_move_by_1e6_sizes_is_exact() {
        let cases = invariances(5).unwrap();
        let case = cases.iter().find(|case| case.name == "moved by 1e6 sizes").unwrap();
        let Truth::Sum(terms) = &case.truth else { panic!("the case has a twin") };
        let twin = &terms[0];
        let [there, here] = [&case.geometry, &twin.geometry].map(|g| g.positions.iter().map(|p| p.as_dvec3()));
        let away = case.receivers.positions[0] - twin.receivers.positions[0];
        assert!(away.length() > 1e6 && case.geometry.positions.len() > 50);
        assert!(there.zip(here).all(|(there, here)| there - here == away));
    }
}
