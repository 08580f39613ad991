use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::Instant;

use dual_bvh::{BuildOptions, DualBvh};

use super::by_rays::ByRays;
use super::integrate::run;
use super::layout::Layout;
use super::solver::{Memory, Solver};
use super::{Control, Family, Method, Outcome, Partial, Receivers, Request};
use crate::reference::RayScene;
use crate::scene::{Environment, FaceTree, Geometry};
use crate::visibility::{Skips, Viewer};
use crate::{Error, Result};

/// A scene made ready for integration: what a method searches in is built when it is first needed, and serves all runs.
pub struct Prepared<'a> {
    geometry: &'a Geometry,
    environment: Option<&'a Environment>,
    skips: Skips,
    faces: OnceLock<FaceTree>,
    edges: OnceLock<DualBvh>,
    rays: OnceLock<RayScene>,
    /// Working memory that no thread uses.
    memories: Mutex<Vec<Memory>>,
    #[cfg(feature = "embree")]
    embree: super::by_embree::EmbreeScenes,
}

impl<'a> Prepared<'a> {
    /// Nothing is built yet.
    pub fn new(geometry: &'a Geometry, environment: Option<&'a Environment>) -> Self {
        Self {
            geometry,
            environment,
            skips: Skips::default(),
            faces: OnceLock::new(),
            edges: OnceLock::new(),
            rays: OnceLock::new(),
            memories: Mutex::default(),
            #[cfg(feature = "embree")]
            embree: super::by_embree::EmbreeScenes::default(),
        }
    }

    /// Leaves out only this work in the runs to come; the results are the same, bit for bit.
    pub fn set_skips(&mut self, skips: Skips) {
        self.skips = skips;
    }

    pub(super) fn skips(&self) -> Skips {
        self.skips
    }

    /// The scene.
    pub fn geometry(&self) -> &'a Geometry {
        self.geometry
    }

    /// As [`integrate`](super::integrate), which this is for one run alone. The statistics count what this run built.
    ///
    /// # Errors
    /// As [`integrate`](super::integrate).
    pub fn integrate(
        &self,
        receivers: &Receivers,
        request: &Request,
        method: Method,
        resume: Option<Partial>,
        control: &dyn Control,
    ) -> Result<Outcome> {
        method.check()?;
        let layout = Layout::new(request, receivers.normals.is_empty())?;
        if request.gradients && method != Method::Exact {
            return Err(Error::input(
                "gradients come from the boundary of the visible region: ask the exact method for them",
            ));
        }
        if request.gradients && !(request.ambient_occlusion || request.visibility_sh || request.transfer_sh) {
            return Err(Error::input("gradients of what? Ask for occlusion, visibility or transfer vectors, too"));
        }
        let light = match (request.irradiance || request.vector_irradiance, self.environment) {
            (false, _) => None,
            (true, None) => return Err(Error::input("irradiance was asked for, but there is no environment")),
            (true, light) => light,
        };
        let started = Instant::now();
        match method {
            Method::Isolines { .. } | Method::Exact => {
                let baker = Solver::new(self, light, request, &layout, method)?;
                run(&baker, &layout, self.geometry, receivers, method, request, resume, started, control)
            }
            Method::Qmc { samples, seed } => {
                let baker = ByRays::new(self, light, request, &layout, samples, seed)?;
                run(&baker, &layout, self.geometry, receivers, method, request, resume, started, control)
            }
            #[cfg(feature = "embree")]
            Method::Embree { samples, seed, variant } => {
                let baker =
                    super::by_embree::ByEmbree::new(self, light, request, &layout, receivers, samples, seed, variant)?;
                run(&baker, &layout, self.geometry, receivers, method, request, resume, started, control)
            }
            #[cfg(not(feature = "embree"))]
            Method::Embree { .. } => unreachable!("it has just been refused"),
        }
    }

    /// Builds what `family` searches in, on all threads; Embree's tree depends on whether the receivers leave faces out.
    #[cfg_attr(not(feature = "embree"), expect(unused_variables, reason = "only Embree asks for the receivers"))]
    pub(super) fn build(&self, family: Family, receivers: &Receivers) -> Result<()> {
        match family {
            Family::Isolines | Family::Exact => self.viewer().map(|_| ()),
            Family::Qmc => {
                self.rays();
                Ok(())
            }
            #[cfg(feature = "embree")]
            Family::Embree => self.embree.get(self.geometry, Default::default(), receivers).map(|_| ()),
            #[cfg(not(feature = "embree"))]
            Family::Embree => family.method(0).check(),
        }
    }

    /// What finds contours, and the faces along a ray.
    pub(super) fn viewer(&self) -> Result<Viewer<'_>> {
        // In this order the two builds need the least memory.
        let faces = self.faces();
        if self.edges.get().is_none() {
            let (positions, triangles) = (&self.geometry.positions, &self.geometry.triangles);
            let edges = DualBvh::build(positions.clone(), triangles.clone(), &BuildOptions::default())?;
            // Whoever comes second finds the same built.
            let _ = self.edges.set(edges);
        }
        let Some(edges) = self.edges.get() else { unreachable!("they have just been set") };
        Ok(Viewer { edges, faces })
    }

    /// The faces along rays, and around points.
    pub fn faces(&self) -> &FaceTree {
        self.faces.get_or_init(|| self.geometry.face_tree())
    }

    /// The faces alone, without what else has been built.
    pub fn into_faces(self) -> FaceTree {
        let Self { geometry, faces, .. } = self;
        faces.into_inner().unwrap_or_else(|| geometry.face_tree())
    }

    /// Working memory of a thread that searches contours.
    pub(super) fn lend(&self) -> Memory {
        self.memories.lock().unwrap_or_else(PoisonError::into_inner).pop().unwrap_or_default()
    }

    /// Keeps it for the next thread, or the next run; not in large meshes, where it grows with all that is ever searched, and new memory
    /// costs little beside a search.
    pub(super) fn give_back(&self, memory: Memory) {
        const LARGE: usize = 1 << 20;
        if self.geometry.triangles.len() > LARGE {
            return;
        }
        self.memories.lock().unwrap_or_else(PoisonError::into_inner).push(memory);
    }

    /// The judge's rays.
    pub(super) fn rays(&self) -> &RayScene {
        self.rays.get_or_init(|| RayScene::new(self.geometry))
    }

    #[cfg(feature = "embree")]
    pub(super) fn embree(&self) -> &super::by_embree::EmbreeScenes {
        &self.embree
    }
}
