//! The table of runs, and their outcome in a sentence: the words and signs of `ilc`, in ASCII.

use std::collections::VecDeque;
use std::fmt::Write as _;

use super::quantity::{Unit, change, digits, less};
use crate::record::{AxisKinds, Figures};

/// Share of the last run's error below which a better run is mentioned.
const BEST_SHARE: f64 = 0.9;

/// Number of runs that are kept of a campaign without an end.
const RUNS_KEPT: usize = 200;

/// The runs of a campaign as they arrive.
#[derive(Default)]
pub(super) struct Runs {
    kinds: Option<AxisKinds>,
    /// All runs; of a campaign without an end the first one and the newest ones.
    ended: VecDeque<(u32, Figures)>,
    n_ended: usize,
    is_endless: bool,
    /// Head of the table.
    heading: String,
    /// Latest remark, printed once.
    remark: Option<String>,
}

impl Runs {
    /// Starts a campaign with the units of its inputs and the number of its runs.
    pub(super) fn begin(&mut self, input_units: &[String], n_axes: usize, iterations: u32) {
        self.kinds = Some(AxisKinds::new(input_units, n_axes));
        self.is_endless = iterations == u32::MAX;
    }

    /// Returns a row of the table, with the heading before the first one and a remark after it.
    pub(super) fn row(&mut self, index: u32, figures: &Figures) -> String {
        self.ended.push_back((index, figures.clone()));
        self.n_ended += 1;
        if self.is_endless && self.ended.len() > RUNS_KEPT {
            self.ended.remove(1);
        }
        let heading = heading(&self.columns());
        // Once, and again if the errors have outgrown their unit.
        let mut text = if heading == self.heading { String::new() } else { heading.clone() };
        self.heading = heading;
        let _ = write!(text, "{index:>4}");
        for column in self.columns() {
            let value = (column.of)(figures);
            let _ =
                write!(text, "{:>14}", value.map_or_else(|| "-".to_owned(), |v| column.unit.of(v)));
        }
        let (first_index, first) = &self.ended[0];
        // A run that only measures is not compared: its purpose stands there.
        let compared = figures.phase.clone().or_else(|| {
            let (before, after) = (self.compared(first), self.compared(figures));
            (index != *first_index).then(|| change(before, after)).flatten()
        });
        let _ = write!(
            text,
            "{:>11}{:>10}{:>10}",
            compared.unwrap_or_default(),
            figures.overruns,
            digits(figures.update_ms)
        );
        if figures.remark != self.remark
            && let Some(remark) = &figures.remark
        {
            let _ = write!(text, "\n     {remark}");
        }
        self.remark.clone_from(&figures.remark);
        text
    }

    /// Returns the line for a remark on a run whose row is printed already.
    pub(super) fn judged(&mut self, index: u32, remark: Option<&str>) -> Option<String> {
        let is_new = remark != self.remark.as_deref();
        self.remark = remark.map(str::to_owned);
        remark.filter(|_| is_new).map(|remark| format!("     run {index}: {remark}"))
    }

    /// Returns the result of learning as a sentence.
    pub(super) fn sentence(&self) -> Option<String> {
        let (first, last) = (&self.ended.front()?.1, &self.learned().last()?.1);
        let n = self.n_ended;
        if self.by_contour() {
            return Some(format!(
                "Contour error {}.",
                self.course(|f| f.contour_inf_m, Unit::LENGTH)
            ));
        }
        let kinds = self.kinds.as_ref()?;
        if !kinds.is_mixed() {
            let unit = if kinds.all_rotary() { Unit::ANGLE } else { Unit::LENGTH };
            return Some(format!(
                "Tracking error {}.",
                self.course(|f| Some(f.tracking_inf_m), unit)
            ));
        }
        let part = |rotary: bool| {
            let unit = if rotary { Unit::ANGLE } else { Unit::LENGTH };
            let unit = unit.for_size(self.size(|figures| largest(figures, kinds, rotary)));
            let of = |figures| largest(figures, kinds, rotary).unwrap_or(0.0);
            let what = if rotary { "rotary" } else { "linear" };
            let (before, after) = (of(first), of(last));
            let less = less(before, after).map_or_else(String::new, |less| format!(" ({less})"));
            format!("of the {what} axes from {} to {}{less}", unit.with(before), unit.with(after))
        };
        Some(format!("Tracking error {}, {} within {n} runs.", part(false), part(true)))
    }

    /// Describes a figure from the first run to the last.
    fn course(&self, of: impl Fn(&Figures) -> Option<f64> + Copy, unit: Unit) -> String {
        let values: Vec<(u32, f64)> =
            self.learned().map(|(index, f)| (*index, of(f).unwrap_or(0.0))).collect();
        let (before, after) = (values[0].1, values[values.len() - 1].1);
        let unit = unit.for_size(self.size(of));
        if self.n_ended == 1 {
            return format!("{} at most in 1 run", unit.with(before));
        }
        let less = less(before, after).map_or_else(String::new, |less| format!(" ({less})"));
        let (index, best) = values
            .iter()
            .copied()
            .fold(values[0], |best, run| if run.1 < best.1 { run } else { best });
        let aside = if best < BEST_SHARE * after {
            format!("; best {} in run {index}", unit.with(best))
        } else {
            String::new()
        };
        format!(
            "from {} to {}{less} within {} runs{aside}",
            unit.with(before),
            unit.with(after),
            self.n_ended
        )
    }

    /// Returns the runs whose error counts: all but those that only measured; of several that only measured
    /// the first one stands for them.
    fn learned(&self) -> impl Iterator<Item = &(u32, Figures)> {
        let runs = self.ended.iter().enumerate();
        runs.filter(|(place, (_, figures))| *place == 0 || !figures.only_measures())
            .map(|(_, run)| run)
    }

    /// Returns the largest value of an error over the runs, which determines its unit.
    fn size(&self, of: impl Fn(&Figures) -> Option<f64>) -> f64 {
        let errors = self.ended.iter().filter_map(|(_, figures)| of(figures));
        errors.filter(|error| error.is_finite()).fold(0.0, f64::max)
    }

    /// Returns true if runs are compared by their contour error, i.e. if every run has one.
    fn by_contour(&self) -> bool {
        self.ended.iter().all(|(_, figures)| figures.contour_inf_m.is_some())
            && self.ended.front().is_some_and(|(_, first)| first.contour_inf_m > Some(0.0))
    }

    fn compared(&self, figures: &Figures) -> f64 {
        let contour_m = figures.contour_inf_m.filter(|_| self.by_contour());
        contour_m.unwrap_or(figures.tracking_inf_m)
    }

    fn columns(&self) -> Vec<Column<'_>> {
        let Some((_, first)) = self.ended.front() else { return Vec::new() };
        let Some(kinds) = &self.kinds else { return Vec::new() };
        let mut columns: Vec<Column<'_>> = Vec::new();
        if kinds.is_mixed() {
            for rotary in [false, true] {
                let unit = if rotary { Unit::ANGLE } else { Unit::LENGTH };
                columns.push(Column {
                    name: "max tracking",
                    unit: unit.for_size(self.size(|figures| largest(figures, kinds, rotary))),
                    of: Box::new(move |figures| largest(figures, kinds, rotary)),
                });
            }
        } else {
            let unit = if kinds.all_rotary() { Unit::ANGLE } else { Unit::LENGTH };
            let unit = unit.for_size(self.size(|figures| Some(figures.tracking_inf_m)));
            let max = Box::new(|figures: &Figures| Some(figures.tracking_inf_m));
            let rms = Box::new(|figures: &Figures| Some(figures.tracking_rms_m));
            columns.push(Column { name: "max tracking", unit, of: max });
            columns.push(Column { name: "RMS tracking", unit, of: rms });
        }
        if first.contour_inf_m.is_some() {
            let sizes = self.size(|f| f.contour_inf_m).max(self.size(|f| Some(f.tracking_inf_m)));
            let unit = Unit::LENGTH.for_size(sizes);
            let of = Box::new(|figures: &Figures| figures.contour_inf_m);
            columns.push(Column { name: "max contour", unit, of });
        }
        columns
    }
}

/// Value of a column for a run, if the run has it.
type Shown<'a> = Box<dyn Fn(&Figures) -> Option<f64> + 'a>;

struct Column<'a> {
    name: &'static str,
    unit: Unit,
    of: Shown<'a>,
}

/// Two lines: a machine's console may have 80 columns.
fn heading(columns: &[Column<'_>]) -> String {
    let (mut names, mut units) = (String::new(), String::new());
    for column in columns {
        let _ = write!(names, "{:>14}", column.name);
        let _ = write!(units, "{:>14}", column.unit.symbol);
    }
    format!(
        "    {names}{:>11}{:>10}{:>10}\n run{units}{:>11}{:>10}{:>10}\n",
        "", "", "learning", "change", "overruns", "ms"
    )
}

/// Returns the largest tracking error of the axes of a kind.
fn largest(figures: &Figures, kinds: &AxisKinds, rotary: bool) -> Option<f64> {
    let axes = kinds.of_kind(rotary);
    axes.iter()
        .map(|&axis| figures.axes_tracking_inf_m.get(axis).copied())
        .reduce(|a, b| a.zip(b).map(|(a, b)| f64::max(a, b)))?
}

#[cfg(test)]
mod tests {
    use super::*;

    fn runs(units: &[&str], figures: &[Figures]) -> (Runs, Vec<String>) {
        let units: Vec<_> = units.iter().map(|unit| (*unit).to_owned()).collect();
        let mut runs = Runs::default();
        runs.begin(&units, units.len(), 10);
        let rows = (0..).zip(figures).map(|(index, run)| runs.row(index, run)).collect();
        (runs, rows)
    }

    fn tracked(tracking_inf_m: f64, contour_inf_m: Option<f64>) -> Figures {
        Figures { tracking_inf_m, contour_inf_m, ..Figures::default() }
    }

    #[test]
    fn a_path_without_a_contour_is_told_by_its_tracking_error() {
        let (runs, rows) = runs(&["m"], &[tracked(2283e-6, None), tracked(134e-6, None)]);
        assert!(!rows[0].contains("contour") && rows[0].contains("max tracking"), "{}", rows[0]);
        assert!(rows[1].contains("-94.1 %"), "{}", rows[1]);
        assert_eq!(
            runs.sentence().unwrap(),
            "Tracking error from 2283 um to 134 um (94.1 % less) within 2 runs."
        );
    }

    #[test]
    fn nothing_is_compared_with_nothing() {
        let (at_zero, rows) =
            runs(&["m", "m"], &[tracked(0.0, Some(0.0)), tracked(95e-6, Some(95e-6))]);
        assert!(!rows[1].contains('%'), "{}", rows[1]);
        assert_eq!(
            at_zero.sentence().unwrap(),
            "Tracking error from 0.00 um to 95.0 um within 2 runs; best 0.00 um in run 0."
        );
        let (alone, _) = runs(&["m"], &[tracked(1e-3, None)]);
        assert_eq!(alone.sentence().unwrap(), "Tracking error 1000 um at most in 1 run.");
        assert_eq!(Runs::default().sentence(), None);
        let (far, rows) = runs(&["m"], &[tracked(1e-9, None), tracked(1e-3, None)]);
        assert!(!rows[1].contains('%') && !far.sentence().unwrap().contains('%'));
    }

    #[test]
    fn runs_that_only_measure_are_named_and_not_counted_as_results() {
        let measuring = |tracking_inf_m, phase: &str| Figures {
            phase: Some(phase.to_owned()),
            ..tracked(tracking_inf_m, None)
        };
        let (runs, rows) = runs(
            &["m"],
            &[
                tracked(1e-3, None),
                measuring(2e-3, "probing"),
                measuring(1e-5, "searching"),
                tracked(5e-4, None),
                measuring(9e-4, "probing"),
            ],
        );
        assert!(rows[1].contains("probing") && !rows[1].contains('%'), "{}", rows[1]);
        assert!(rows[2].contains("searching") && rows[3].contains("-50.0 %"), "{rows:?}");
        assert!(rows.iter().flat_map(|row| row.lines()).all(|line| line.len() <= 80), "{rows:?}");
        assert_eq!(
            runs.sentence().unwrap(),
            "Tracking error from 1000 um to 500 um (50.0 % less) within 5 runs."
        );
    }

    #[test]
    fn an_endless_campaign_keeps_its_first_run_and_the_newest() {
        let mut runs = Runs::default();
        runs.begin(&["m".to_owned()], 1, u32::MAX);
        runs.row(0, &tracked(1e-3, None));
        for index in 1..1000 {
            runs.row(index, &tracked(1e-4, None));
        }
        assert_eq!(runs.ended.len(), RUNS_KEPT);
        assert_eq!(
            runs.sentence().unwrap(),
            "Tracking error from 1000 um to 100 um (90.0 % less) within 1000 runs."
        );
    }

    #[test]
    fn angles_have_units_of_their_own() {
        let (turning, rows) = runs(&["rad", "rad/s"], &[tracked(0.025, None), tracked(1e-3, None)]);
        assert!(rows[0].contains("mrad") && !rows[0].contains("um"), "{}", rows[0]);
        assert_eq!(
            turning.sentence().unwrap(),
            "Tracking error from 25.0 mrad to 1.00 mrad (96.0 % less) within 2 runs."
        );
        let both = |linear_m, rotary| Figures {
            axes_tracking_inf_m: vec![linear_m, rotary],
            ..tracked(linear_m, None)
        };
        let (mixed, rows) = runs(&["m", "rad"], &[both(2e-3, 1e-3), both(1e-4, 5e-4)]);
        assert!(rows[0].contains("um") && rows[0].contains("urad"), "{}", rows[0]);
        assert_eq!(
            mixed.sentence().unwrap(),
            "Tracking error of the linear axes from 2000 um to 100 um (95.0 % less), of the rotary axes \
             from 1000 urad to 500 urad (50.0 % less) within 2 runs."
        );
    }

    #[test]
    fn the_table_fits_a_console_and_tells_a_remark_once() {
        let back = Figures { remark: Some("learning is off".into()), ..tracked(1e-3, Some(1e-4)) };
        let (_, rows) = runs(&["m", "m"], &[back.clone(), back]);
        assert!(rows.iter().flat_map(|row| row.lines()).all(|line| line.len() <= 80), "{rows:?}");
        assert!(rows[0].ends_with("learning is off") && !rows[1].contains("learning is off"));
    }
}
