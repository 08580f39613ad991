use std::path::PathBuf;

use clap::Args;

use crate::bake::writers::npz;
use crate::bake::{Arrays, Changes, Method, Partial, Phase, Provenance, Receivers, flip_phase};
use crate::scene::Geometry;
use crate::{Error, Result};

use super::options::scene;
use super::say;

/// An earlier result to start from.
#[derive(Args)]
#[command(next_help_heading = "Update")]
pub struct UpdateOptions {
    /// Earlier result (.npz) with the same settings: what has moved since is found, and only receivers whose result it can
    /// change are computed anew
    #[arg(long, value_name = "OLD.npz", requires = "before", conflicts_with = "resume")]
    update: Option<PathBuf>,
    /// Scene file or mesh that the earlier result was computed for
    #[arg(long, value_name = "OLD_SCENE", requires = "update")]
    before: Option<PathBuf>,
}

/// An earlier result, and what has moved since.
pub struct Earlier {
    path: PathBuf,
    arrays: Arrays,
    provenance: Provenance,
    changes: Changes,
}

impl UpdateOptions {
    /// The earlier result and what has moved up to now, if there is one.
    ///
    /// # Errors
    /// When the file or its scene cannot be read.
    pub fn earlier(&self, now: &Geometry) -> Result<Option<Earlier>> {
        let Some((path, before)) = self.update.as_ref().zip(self.before.as_ref()) else { return Ok(None) };
        let npz::Archive { arrays, provenance } = npz::read(path)?;
        let Some(provenance) = provenance else {
            return Err(Error::file(path, "does not say how it was made; bake once without --update"));
        };
        let arrays = match provenance.sh_phase {
            Phase::Plain => arrays,
            Phase::CondonShortley => flip_phase(arrays, 1)?,
        };
        let changes = Changes::between(&scene(Some(before))?.geometry, now);
        Ok(Some(Earlier { path: path.clone(), arrays, provenance, changes }))
    }
}

impl Earlier {
    /// By what method it was made.
    ///
    /// # Errors
    /// When it does not say so.
    pub fn method(&self) -> Result<Method> {
        let method = self.provenance.integrated_by();
        method.ok_or_else(|| Error::file(&self.path, "does not say by what method it was made; bake without --update"))
    }

    /// What of it still holds for a run with this provenance, and says how much that is unless `quiet`.
    ///
    /// # Errors
    /// When it was made with other settings, or is not the result of a bake.
    pub fn part(&self, receivers: &Receivers, expected: &Provenance, quiet: bool) -> Result<Partial> {
        let of_scene = |provenance: &Provenance| {
            let mut provenance = provenance.clone();
            provenance.parameters.retain(|(name, _)| name != "scene");
            provenance
        };
        if let Some((name, wanted, found)) = of_scene(expected).disagreement(&of_scene(&self.provenance)) {
            let message = format!("was made with {name} = {found}, not {wanted}; bake without --update");
            return Err(Error::file(&self.path, message));
        }
        let part = self.changes.still_valid(&self.arrays, receivers, expected);
        let part = part.map_err(|error| Error::file(&self.path, error))?;
        if !quiet {
            let (kept, all) = (part.finished(), receivers.len());
            say(format_args!("{kept} of {all} receivers are kept, {} are computed anew", all - kept));
        }
        Ok(part)
    }
}
