//! One image of differences, as part of a larger picture.

use plotters::prelude::{BLACK, Color, IntoFont, Rectangle, Text, TextStyle};

use crate::Result;

use super::Picture;
use super::picture::{Decades, colour};

/// Height of a line of text, and of the colour bar.
pub(super) const LINE: usize = 20;
/// Panels are magnified to at least this many pixels, so that their text fits.
const LEAST: usize = 240;
/// Images are reduced to at most this many pixels a side.
const MOST: usize = 1024;

/// Values, none negative, of a `width` x `height` image in false colour, with title and colour bar.
///
/// # Errors
/// When drawing fails.
pub(super) fn panel(name: &str, width: usize, height: usize, values: &[Option<f64>]) -> Result<Picture> {
    let greatest = values.iter().flatten().copied().fold(0.0, f64::max);
    let scale = Decades { greatest };

    // Reduced by keeping the worst of every block: a single bad pixel stays visible.
    let reduce = width.max(height).div_ceil(MOST).max(1);
    let magnify = LEAST.div_ceil(width).max(1);
    let (shown_width, shown_height) = (width.div_ceil(reduce) * magnify, height.div_ceil(reduce) * magnify);
    let worst = |x: usize, y: usize| {
        let rows = y * reduce..((y + 1) * reduce).min(height);
        let block = rows.flat_map(|y| (x * reduce..((x + 1) * reduce).min(width)).map(move |x| (x, y)));
        block.filter_map(|(x, y)| values[y * width + x]).reduce(f64::max)
    };
    let shown: Vec<_> =
        (0..shown_width * shown_height).map(|i| worst(i % shown_width / magnify, i / shown_width / magnify)).collect();

    let mut picture = Picture::filled(shown_width + LINE, shown_height + 4 * LINE, [255; 3]);
    picture.paste(&Picture::false_colour(shown_width, shown_height, &shown, scale), LINE / 2, LINE + LINE / 2);
    picture.draw(|area| {
        let style = TextStyle::from(("sans-serif", 14).into_font()).color(&BLACK);
        let left = LINE as i32 / 2;
        let below = (shown_height + 2 * LINE) as i32;
        area.draw(&Text::new(name.to_owned(), (left, left), style.clone()))?;
        if greatest == 0.0 {
            area.draw(&Text::new("no difference", (left, below), style))?;
            return Ok(());
        }
        for x in 0..shown_width as i32 {
            let fill = colour(f64::from(x) / shown_width as f64).filled();
            area.draw(&Rectangle::new([(left + x, below), (left + x + 1, below + LINE as i32 / 2)], fill))?;
        }
        let label = |x: f64| format!("{x:.1e}");
        let numbers = below + 3 * LINE as i32 / 4;
        area.draw(&Text::new(label(scale.least()), (left, numbers), style.clone()))?;
        area.draw(&Text::new(label(greatest), (left + shown_width as i32 - 56, numbers), style))?;
        Ok(())
    })?;
    Ok(picture)
}
