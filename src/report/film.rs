use crate::proxy::FrameStatistics;
use crate::{Error, Result};
use std::fmt::Write;
use std::path::Path;

use super::{Curve, Picture, Plot};
use crate::bake::writers::atomically;

/// The frames of a film: their pictures share one exposure, their times go into tables and a plot.
#[derive(Clone, Debug, Default)]
pub struct Film {
    exposure: Option<f64>,
    frames: Vec<FrameStatistics>,
    thumbnails: Vec<Picture>,
}

/// Pixels of the longer side of a picture on the contact sheet.
const THUMBNAIL: usize = 256;

impl Film {
    /// Takes a frame in, of `width` x `height` linear colours, and gives its picture.
    ///
    /// # Panics
    /// If there are not that many colours.
    pub fn add(&mut self, width: usize, height: usize, radiance: &[[f32; 3]], statistics: FrameStatistics) -> Picture {
        let colours: Vec<[f64; 3]> = radiance.iter().map(|colour| colour.map(f64::from)).collect();
        // That of the first frame: a film that adapts to every frame flickers.
        let exposure = *self.exposure.get_or_insert_with(|| Picture::exposure(&colours));
        self.frames.push(statistics);
        let shrink = width.max(height).div_ceil(THUMBNAIL);
        let (w, h) = (width / shrink, height / shrink);
        let mean = |i: usize| {
            let (x, y) = (i % w * shrink, i / w * shrink);
            let block = (y..y + shrink).flat_map(|y| (x..x + shrink).map(move |x| y * width + x));
            let sum = block.fold([0.0; 3], |sum: [f64; 3], i| std::array::from_fn(|c| sum[c] + colours[i][c]));
            sum.map(|x| x / (shrink * shrink) as f64)
        };
        let small: Vec<[f64; 3]> = (0..w * h).map(mean).collect();
        self.thumbnails.push(Picture::exposed(w, h, &small, exposure));
        Picture::exposed(width, height, &colours, exposure)
    }

    /// The statistics of the frames so far.
    pub fn frames(&self) -> &[FrameStatistics] {
        &self.frames
    }

    /// All frames side by side, row after row; of long films every second, third, ... one, 36 at most.
    pub fn contact_sheet(&self) -> Picture {
        let step = self.thumbnails.len().div_ceil(36).max(1);
        let shown: Vec<&Picture> = self.thumbnails.iter().step_by(step).collect();
        let columns = (1..).find(|n| n * n >= shown.len()).unwrap_or(1);
        let (w, h) = shown.first().map_or((1, 1), |picture| (picture.width(), picture.height()));
        let mut sheet = Picture::filled(columns * w, shown.len().div_ceil(columns).max(1) * h, [255; 3]);
        for (i, picture) in shown.into_iter().enumerate() {
            sheet.paste(picture, i % columns * w, i / columns * h);
        }
        sheet
    }

    /// Writes the statistics of all frames into `folder`: `frames.csv`, `frames.json` and a plot, `frames.png`.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn write_statistics(&self, folder: &Path) -> Result<()> {
        let path = folder.join("frames.json");
        let json = serde_json::to_string_pretty(&self.frames).map_err(|error| Error::file(&path, error))?;
        write(&path, &json)?;
        write(&folder.join("frames.csv"), &self.table())?;
        self.plot().write(&folder.join("frames.png"))
    }

    fn table(&self) -> String {
        let mut table = String::from("frame");
        for (frame, statistics) in self.frames.iter().enumerate() {
            let Ok(serde_json::Value::Object(values)) = serde_json::to_value(statistics) else { continue };
            if frame == 0 {
                values.keys().for_each(|name| _ = write!(table, ",{name}"));
                table.push('\n');
            }
            _ = write!(table, "{frame}");
            values.values().for_each(|value| _ = write!(table, ",{value}"));
            table.push('\n');
        }
        table
    }

    fn plot(&self) -> Plot {
        let curve = |name: &str, seconds: fn(&FrameStatistics) -> f64| {
            let point = |(i, frame): (usize, &FrameStatistics)| ((i + 1) as f64, 1e3 * seconds(frame));
            Curve { name: name.into(), points: self.frames.iter().enumerate().map(point).collect() }
        };
        Plot {
            title: "Time of the frames".into(),
            x: "frame".into(),
            y: "milliseconds".into(),
            curves: vec![
                curve("frame", |f| f.seconds),
                curve("receiver set-up", |f| f.setup_seconds),
                curve("splat", |f| f.splat_seconds),
                curve("exponentiate", |f| f.exponentiate_seconds),
                curve("indirect", |f| f.indirect_seconds),
                curve("shade", |f| f.shade_seconds),
                curve("upsample", |f| f.upsample_seconds),
            ],
        }
    }
}

fn write(path: &Path, text: &str) -> Result<()> {
    use std::io::Write;
    atomically(path, |file| file.write_all(text.as_bytes()).map_err(|error| Error::file(path, error)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn films_come_with_tables_and_a_contact_sheet() {
        let mut film = Film::default();
        for frame in 0..5u64 {
            let statistics = FrameStatistics { seconds: 0.01 * (frame + 1) as f64, pairs: frame, ..Default::default() };
            // Each frame twice as bright as the last: the exposure stays.
            let picture = film.add(300, 200, &vec![[0.1 * (1 << frame) as f32; 3]; 60_000], statistics);
            assert_eq!(picture.width(), 300);
            assert!(frame > 0 || (100..140).contains(&picture.pixel(0, 0)[0]));
        }
        let sheet = film.contact_sheet();
        assert_eq!((sheet.width(), sheet.height()), (3 * 150, 2 * 100));
        assert!(sheet.pixel(10, 10)[0] < sheet.pixel(310, 10)[0]);
        let folder = tempfile::tempdir().unwrap();
        film.write_statistics(folder.path()).unwrap();
        let table = std::fs::read_to_string(folder.path().join("frames.csv")).unwrap();
        assert_eq!(table.lines().count(), 6);
        let columns = |line: usize| table.lines().nth(line).unwrap().split(',').collect::<Vec<_>>();
        assert_eq!(columns(0).len(), columns(3).len());
        let pairs = columns(0).iter().position(|name| *name == "pairs").unwrap();
        assert_eq!((columns(3)[0], columns(3)[pairs]), ("2", "2"));
        assert!(folder.path().join("frames.png").exists() && folder.path().join("frames.json").exists());
    }
}
