//! Exact visibility for rendering: what every point of a scene sees of its surroundings, without noise.
//!
//! What a point sees is bounded by *contours*, the edges where a mesh turns from one side to the other. Between them the
//! number of surfaces in a direction does not change. This crate finds the contours, follows that number along lines of the
//! sphere (the isolines of Nowrouzezahrai, Baran, Mitchell and Jarosz, *Visibility Silhouettes for Semi-Analytic
//! Spherical Integration*, 2014) and integrates over what is left open in closed form: ambient occlusion, spherical
//! harmonics of the visibility, cosine transfer vectors, irradiance. The error falls like the number of lines to the power
//! of -1.5.
//!
//! ```
//! use silhouette::{Method, Receivers, Request, Scene, integrate};
//!
//! // A sphere over a plane; `Scene::load("room.toml")` and `Scene::from_meshes(["bunny.obj"])` read files.
//! let scene = Scene::builtin("icosphere")?;
//! let (receivers, _) = Receivers::vertices(&scene.geometry);
//! let request = Request { ambient_occlusion: true, visibility_sh: true, ..Request::default() };
//!
//! let method = Method::Isolines { lines: 64 };
//! let outcome = integrate(&scene.geometry, None, &receivers, &request, method, None, &())?;
//!
//! let occlusion = outcome.arrays.get("ambient_occlusion").expect("asked for");
//! let lowest = (0..receivers.len()).min_by(|&i, &j| occlusion.data[i].total_cmp(&occlusion.data[j]));
//! let lowest = receivers.positions[lowest.expect("there are receivers")];
//! assert!(lowest.y < 0.3, "between the sphere and the plane it is darkest");
//! # Ok::<(), silhouette::Error>(())
//! ```
//!
//! Receivers are the vertices of a mesh, the pixels of a camera ([`bake::Pixels`]) or any points; results go to files by
//! [`bake::writers::write`]. Long computations report and stop through [`bake::Control`]. [`visibility`] has the parts to
//! build other integrals from, [`mod@reference`] the independent judge.
//!
//! # Conventions
//!
//! | | |
//! |---|---|
//! | axes | right-handed; everything is in the scene's own frame and unit of length. y is up in the built-in shapes and, unless told otherwise, in environments |
//! | numbers | geometry is `f32` exactly as loaded, never moved; receivers, directions and results are `f64` |
//! | visibility | V(w) = 1 where the ray from the receiver in the direction w escapes, otherwise 0 |
//! | depth | W(w) = number of surfaces that the ray crosses; V = [W = 0] |
//! | hemisphere | receivers with a normal n count only n . w > 0; probes, without one, the whole sphere |
//! | occlusion | accessibility, 1/pi integral of V max(0, n . w): 1 is open |
//! | harmonics | real and orthonormal on the unit sphere; degree l and order m at `l * l + l + m`; m < 0 sine, m > 0 cosine; no Condon-Shortley sign: Y_1 = sqrt(3/4pi) (y, z, x) |
//! | order | the number of bands: order n has n^2 coefficients |
//! | visibility harmonics | integral of V [n . w > 0] y |
//! | transfer | 1/pi integral of V max(0, n . w) y: its product with the light's coefficients is the radiance of a white diffuse surface |
//! | light | radiance from infinitely far away, linear, constant over each pixel of a lat-long image: [`Environment`] |
//! | irradiance | integral of L V max(0, n . w); vector irradiance: integral of L V [n . w > 0] w |
//! | own surface | a receiver on a surface leaves out the faces that meet in it, by number, not by a distance |
//! | winding | has no influence on results: both sides of a face hide what is behind it |
//!
//! Results do not depend on the number of threads, bit for bit. The library never prints and never exits; every error is
//! one line that names file, line or face: [`Error`].

pub mod bake;
pub mod cli;
mod error;
pub mod integrand;
pub mod proxy;
pub mod race;
pub mod reference;
pub mod report;
pub mod scene;
pub mod sphere;
pub mod stress;
pub mod visibility;

pub use bake::{Arrays, Method, Outcome, Receivers, Request, integrate};
pub use error::{Error, Result};
pub use scene::{Camera, Environment, Geometry, Scene};
