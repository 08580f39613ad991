use std::fmt;

use crate::bake::Method;

/// What a case came to by one method.
#[derive(Clone, Debug)]
pub struct Row {
    /// The case.
    pub case: String,
    /// How it was solved.
    pub method: Method,
    /// Number of receivers.
    pub receivers: usize,
    /// Receivers that raised an alarm.
    pub alarms: u64,
    /// Attempts after the first, over all receivers.
    pub fallbacks: u64,
    /// Largest difference from the truth in any coefficient or in the ambient occlusion; from rays where they are the truth.
    pub worst: f64,
    /// The receiver that came nearest to being wrong.
    pub receiver: Option<usize>,
    /// How near: its difference as a share of what is allowed.
    pub strain: f64,
    /// Whether all receivers are right.
    pub verdict: Verdict,
}

impl Row {
    /// Keeps the receiver that is worst.
    pub(super) fn strain_by(&mut self, receiver: usize, strain: f64) {
        if strain > self.strain {
            (self.strain, self.receiver) = (strain, Some(receiver));
        }
    }
}

/// Whether a case passed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Every receiver agrees with the truth and with rays.
    Good,
    /// What is wrong, and where.
    Bad(String),
}

/// All rows; displays as text, with the worst things said below.
#[derive(Clone, Debug, Default)]
pub struct Table(pub Vec<Row>);

impl Table {
    /// Whether every row is good.
    pub fn is_good(&self) -> bool {
        self.0.iter().all(|row| row.verdict == Verdict::Good)
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = self.0.iter().map(|row| row.case.chars().count()).max().unwrap_or(0).max("total".len());
        writeln!(f, "{:<width$}  method    receivers  alarms  fallbacks  worst error  verdict", "case")?;
        for row in &self.0 {
            let Row { case, method, receivers, alarms, fallbacks, worst, .. } = row;
            let verdict = if row.verdict == Verdict::Good { "good" } else { "BAD" };
            let method = method.to_string();
            writeln!(
                f,
                "{case:<width$}  {method:<8} {receivers:>10} {alarms:>7} {fallbacks:>10} {worst:>12.1e}  {verdict}"
            )?;
        }
        let sum = |number: fn(&Row) -> u64| self.0.iter().map(number).sum::<u64>();
        let (receivers, alarms, fallbacks) =
            (sum(|row| row.receivers as u64), sum(|row| row.alarms), sum(|row| row.fallbacks));
        let bad = self.0.iter().filter(|row| row.verdict != Verdict::Good).count();
        writeln!(
            f,
            "{:<width$}  {:<8} {receivers:>10} {alarms:>7} {fallbacks:>10} {:>12}  {bad} bad",
            "total", "", ""
        )?;
        for row in &self.0 {
            if let Verdict::Bad(why) = &row.verdict {
                writeln!(f, "{}, {}: {why}", row.case, row.method)?;
            }
        }
        Ok(())
    }
}
