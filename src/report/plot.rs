use std::path::Path;

use plotters::coord::Shift;
use plotters::prelude::{
    BLACK, ChartBuilder, Color, DrawingArea, DrawingBackend, IntoDrawingArea, IntoFont, IntoLogRange, LineSeries,
    Palette, Palette99, PathElement, SVGBackend, SeriesLabelPosition, WHITE,
};

use crate::bake::writers::atomically;
use crate::{Error, Result};

use super::Picture;
use super::picture::load_font;

/// Curves over two logarithmic axes, such as error against cost.
#[derive(Clone, Debug, PartialEq)]
pub struct Plot {
    /// Written above.
    pub title: String,
    /// Written below the horizontal axis.
    pub x: String,
    /// Written beside the vertical axis.
    pub y: String,
    /// What is drawn, each in its own colour.
    pub curves: Vec<Curve>,
}

/// One curve of a [`Plot`].
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Written in the legend.
    pub name: String,
    /// Its points. Those with a coordinate that is not positive, or twenty decades below the greatest, have no place on
    /// the logarithmic axes and are left out.
    pub points: Vec<(f64, f64)>,
}

impl Plot {
    /// Pixels in width and height.
    const SIZE: (u32, u32) = (960, 600);

    /// Draws the plot into `path`: `.png` or `.svg`.
    ///
    /// # Errors
    /// When the extension is another, drawing fails, or the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        match path.extension().unwrap_or_default().to_string_lossy().to_lowercase().as_str() {
            "png" => {
                let mut picture = Picture::filled(Self::SIZE.0 as usize, Self::SIZE.1 as usize, [255; 3]);
                picture.draw(|area| Ok(self.draw(area).map_err(|error| error.to_string())?))?;
                picture.write(path)
            }
            "svg" => {
                load_font();
                let mut text = String::new();
                let area = SVGBackend::with_string(&mut text, Self::SIZE).into_drawing_area();
                self.draw(&area).map_err(|error| Error::file(path, error))?;
                area.present().map_err(|error| Error::file(path, error))?;
                drop(area);
                use std::io::Write;
                atomically(path, |file| file.write_all(text.as_bytes()).map_err(|error| Error::file(path, error)))
            }
            _ => Err(Error::file(path, "a plot is written as .png or .svg")),
        }
    }

    fn draw<B: DrawingBackend>(
        &self,
        area: &DrawingArea<B, Shift>,
    ) -> std::result::Result<(), plotters::drawing::DrawingAreaErrorKind<B::ErrorType>> {
        let curves: Vec<(&str, Vec<(f64, f64)>)> =
            self.curves.iter().map(|curve| (curve.name.as_str(), curve.positive())).collect();
        let points = || curves.iter().flat_map(|(_, points)| points);
        let (x, y) = (range(points().map(|p| p.0)), range(points().map(|p| p.1)));
        let inside = |p: &(f64, f64)| p.0 >= x.start && p.1 >= y.start;

        area.fill(&WHITE)?;
        let mut chart = ChartBuilder::on(area)
            .caption(&self.title, ("sans-serif", 22))
            .margin(16)
            .x_label_area_size(48)
            .y_label_area_size(72)
            .build_cartesian_2d(x.clone().log_scale(), y.clone().log_scale())?;
        let tick = |x: &f64| format!("{x:.0e}");
        chart
            .configure_mesh()
            .x_desc(&self.x)
            .y_desc(&self.y)
            .x_label_formatter(&tick)
            .y_label_formatter(&tick)
            .label_style(("sans-serif", 14).into_font())
            .axis_desc_style(("sans-serif", 16).into_font())
            .light_line_style(BLACK.mix(0.05))
            .draw()?;
        for (i, (name, points)) in curves.iter().enumerate() {
            let style = Palette99::pick(i).stroke_width(2);
            chart
                .draw_series(LineSeries::new(points.iter().copied().filter(inside), style))?
                .label(*name)
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 20, y)], style));
        }
        if !curves.is_empty() {
            chart
                .configure_series_labels()
                .position(SeriesLabelPosition::LowerLeft)
                .background_style(WHITE.mix(0.8))
                .border_style(BLACK.mix(0.3))
                .label_font(("sans-serif", 14).into_font())
                .draw()?;
        }
        Ok(())
    }
}

impl Curve {
    fn positive(&self) -> Vec<(f64, f64)> {
        self.points.iter().copied().filter(|&(x, y)| x > 0.0 && y > 0.0 && x.is_finite() && y.is_finite()).collect()
    }
}

/// Decades that an axis spans at most: what lies further below the greatest value is rounding.
const DECADES: i32 = 20;

/// From the least to the greatest value, widened where they are the same.
fn range(values: impl Iterator<Item = f64>) -> std::ops::Range<f64> {
    let (least, greatest) =
        values.fold((f64::INFINITY, 0.0f64), |(least, greatest), x| (least.min(x), greatest.max(x)));
    if greatest == 0.0 {
        return 0.1..1.0;
    }
    let least = least.max(greatest * 10f64.powi(-DECADES));
    if greatest > 1.5 * least { least..greatest } else { least / 2.0..(greatest * 2.0).min(f64::MAX) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plot(points: &[(f64, f64)]) -> Plot {
        let curves = vec![Curve { name: "isolines".into(), points: points.to_vec() }];
        Plot { title: "Error".into(), x: "lines".into(), y: "RMSE".into(), curves }
    }

    fn svg(plot: &Plot) -> String {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.svg");
        plot.write(&path).unwrap();
        std::fs::read_to_string(path).unwrap()
    }

    #[test]
    fn a_power_law_is_a_straight_line() {
        let text = svg(&plot(&[(16.0, 1e-2), (64.0, 1.25e-3), (256.0, 1.5625e-4)]));
        assert!(text.contains("isolines") && text.contains("RMSE"));
        let line = text.split("<polyline").find(|element| element.contains("stroke-width=\"2\"")).unwrap();
        let points: Vec<f64> = line
            .split('"')
            .find(|part| part.contains(',') && !part.contains('#'))
            .unwrap()
            .split([' ', ','])
            .filter(|part| !part.is_empty())
            .map(|x| x.parse().unwrap())
            .collect();
        let [x0, y0, x1, y1, x2, y2] = points[..] else { panic!("{points:?}") };
        assert!((x1 - x0 - (x2 - x1)).abs() <= 1.0 && (y1 - y0 - (y2 - y1)).abs() <= 1.0, "{points:?}");
        assert!(x1 > x0 && y1 > y0);
    }

    #[test]
    fn degenerate_curves_are_drawn_all_the_same() {
        for points in [&[][..], &[(1.0, 1.0)], &[(0.0, -1.0), (f64::NAN, 1.0)], &[(1.0, 1e-300), (2.0, 1e300)]] {
            svg(&plot(points));
        }
        svg(&Plot { curves: vec![], ..plot(&[]) });
    }
}
