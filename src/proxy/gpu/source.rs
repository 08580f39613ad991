//! Shader sources for a number of bands: WGSL has no parameters for sizes, and loops that are written out stay in registers.

use std::fmt::Write;

use crate::proxy::basis::factors;
use crate::proxy::{Exponentiator, SquareTerm};

/// What is known when a shader is made.
///
/// Sources may hold lines of these forms, in which `$` is a number and `@` its band:
///
/// ```text
/// //#each NAME| text              text for $ = 0, 1, ..., below the count of that name
/// //#each FIRST NAME| text        the same from FIRST on
/// //#basis NAME axis| text        text for every harmonic $ of so many bands, whose value for the direction is y$
/// //#square                       g.f$ of the square of f, coefficient by coefficient
/// //#product                      h.f$ of the product of f and g, likewise
/// ```
pub(super) struct Source<'a> {
    /// Constants and their values, as WGSL has them.
    pub(super) constants: Vec<(String, String)>,
    /// Counts, which are constants, too.
    pub(super) counts: Vec<(&'static str, usize)>,
    /// For squares.
    pub(super) exponentiator: Option<&'a Exponentiator>,
}

impl Source<'_> {
    /// Puts parts of a shader together.
    pub(super) fn expand(&self, parts: &[&str]) -> String {
        let mut out = String::new();
        for (name, value) in &self.constants {
            let kind = match value.as_str() {
                "true" | "false" => "bool",
                number if number.ends_with('u') => "u32",
                _ => "f32",
            };
            push(&mut out, format_args!("const {name}: {kind} = {value};"));
        }
        for (name, count) in &self.counts {
            push(&mut out, format_args!("const {name}: u32 = {count}u;"));
        }
        for line in parts.iter().flat_map(|part| part.lines()) {
            let directive = line.trim_start().strip_prefix("//#");
            match directive.and_then(|directive| directive.split_once('|')) {
                Some((head, text)) => match head.split(' ').collect::<Vec<_>>()[..] {
                    ["each", name] => self.each(&mut out, 0, name, text),
                    ["each", first, name] => self.each(&mut out, first.parse().unwrap_or(0), name, text),
                    ["basis", name, axis] => self.basis(&mut out, name, axis, text),
                    _ => push(&mut out, format_args!("{line}")),
                },
                None if directive == Some("square") => self.square(&mut out),
                None if directive == Some("product") => self.product(&mut out),
                None => push(&mut out, format_args!("{line}")),
            }
        }
        out
    }

    fn count(&self, name: &str) -> usize {
        self.counts.iter().find(|(known, _)| *known == name).map_or(0, |(_, count)| *count)
    }

    fn each(&self, out: &mut String, first: usize, name: &str, text: &str) {
        for k in first..self.count(name) {
            push(out, format_args!("{}", text.replace('$', &k.to_string())));
        }
    }

    /// The recurrence of [`basis`](crate::proxy::basis), written out.
    fn basis(&self, out: &mut String, name: &str, axis: &str, text: &str) {
        let bands = self.count(name);
        let (diagonal, steps) = factors();
        push(out, format_args!("{{"));
        for m in 0..bands {
            match m {
                0 => push(out, format_args!("let re0 = 1.0; let im0 = 0.0;")),
                _ => push(
                    out,
                    format_args!(
                        "let re{m} = {axis}.x * re{k} - {axis}.y * im{k}; let im{m} = {axis}.x * im{k} + {axis}.y * re{k};",
                        k = m - 1
                    ),
                ),
            }
            push(out, format_args!("let q{m}_{m} = f32({:e});", diagonal[m]));
            for (l, [a, b]) in steps[m].iter().enumerate().take(bands).skip(m) {
                if l > m {
                    let before = if l > m + 1 { format!(" - q{m}_{} * f32({b:e})", l - 2) } else { String::new() };
                    let k = l - 1;
                    push(out, format_args!("let q{m}_{l} = {axis}.z * q{m}_{k} * f32({a:e}){before};"));
                }
                let middle = l * l + l;
                push(out, format_args!("let y{} = q{m}_{l} * re{m};", middle + m));
                if m > 0 {
                    push(out, format_args!("let y{} = q{m}_{l} * im{m};", middle - m));
                }
            }
        }
        for k in 0..bands * bands {
            let text = text.replace('$', &k.to_string()).replace('@', &k.isqrt().to_string());
            push(out, format_args!("{text}"));
        }
        push(out, format_args!("}}"));
    }

    fn square(&self, out: &mut String) {
        self.sums(out, 'g', |SquareTerm { i, j, value }| format!("f.f{i} * f.f{j} * f32({value:e})"));
    }

    fn product(&self, out: &mut String) {
        self.sums(out, 'h', |SquareTerm { i, j, value }| match i == j {
            true => format!("f.f{i} * g.f{i} * f32({value:e})"),
            false => format!("(f.f{i} * g.f{j} + f.f{j} * g.f{i}) * f32({:e})", 0.5 * value),
        });
    }

    /// The sum over the terms of a square, coefficient by coefficient.
    fn sums(&self, out: &mut String, name: char, term: impl Fn(&SquareTerm) -> String) {
        let Some(exponentiator) = self.exponentiator else { return };
        let (first, terms) = exponentiator.square_terms();
        for k in 0..first.len() - 1 {
            let sum: Vec<String> = terms[first[k]..first[k + 1]].iter().map(&term).collect();
            push(out, format_args!("{name}.f{k} = {};", if sum.is_empty() { "0.0".into() } else { sum.join(" + ") }));
        }
    }
}

/// A line more. Writing to a string cannot fail.
fn push(out: &mut String, line: std::fmt::Arguments<'_>) {
    let _ = writeln!(out, "{line}");
}
