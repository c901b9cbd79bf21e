//! A search's result put in the shape of a [`Diagnosis`].

use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

use crate::diagnosis::Options;
use crate::judge::next_words;
use crate::judge::structure::Structure;
use crate::linearise::arm_candidates::{place_code, place_name};
use crate::measurement::{Run, median, root_mean_square};
use crate::outcome::{
    Alternative, AxisFigure, BeforeAfter, Diagnosis, ErrorFigure, Errors, Found, Outlier, Parameter, Point, Rows,
    Verdict, axis_name,
};
use crate::prepare::observations::{NoPose, Observations, Value, axes};
use crate::prepare::repeatability::{Noise, Repeatability};
use crate::select::forward::Search;
use crate::select::problem::{Kind, Trial};
use crate::select::robust_fit::{FOLDS, covariance, size};
use crate::select::significance::quantile_975;
use crate::select::tool_pose::{ToolPose, values};
use darm_arm::arm::{Arm, ArmModel};

/// Chance that any row of a run without outliers is called one.
const OUTLIER_LEVEL: f64 = 0.01;

/// What a summary draws on.
pub(crate) struct Summary<'a> {
    pub(crate) arm: &'a Arm,
    pub(crate) run: &'a Run,
    pub(crate) search: &'a mut Search<ToolPose>,
    pub(crate) best: &'a Trial<ToolPose>,
    pub(crate) n_known: usize,
}

impl Summary<'_> {
    pub(crate) fn diagnosis(
        mut self,
        verdict: Verdict,
        repeats: Option<Noise>,
        (structure, remaining): (Structure, Structure),
        alternatives: Vec<Alternative>,
        options: &Options,
    ) -> Result<Diagnosis, NoPose> {
        let alternatives = self.with_best(verdict, alternatives);
        let per_axis = repeats.as_ref().map_or(self.search.kind.training.rows.len(), |noise| noise.dof);
        let noise_dof = (per_axis * self.search.kind.training.n_axes()) as f64;
        let named = verdict == Verdict::EffectFound;
        let nominal = self.search.kind.training.residuals(&self.arm.model, &mut self.search.kind.scratch)?;
        let after = self.errors(&self.best.fit.model.clone(), &self.best.predicted.clone())?;
        let error = BeforeAfter { before: self.errors(&self.arm.model, &nominal)?, after };
        let (train, own) = (self.search.kind.training.rows.len(), self.search.kind.heldout.rows.len());
        let effects = if named { self.found(&error)? } else { Vec::new() };
        let next_measurement = match verdict {
            Verdict::NotIdentifiable => {
                Some(next_words::proposal(self.arm, self.run, self.search, self.best, &alternatives, options)?)
            }
            _ => None,
        };
        Ok(Diagnosis {
            kind: "tool-pose",
            model: self.arm.model.number,
            rows: Rows { train, heldout: if own == 0 { train } else { own } },
            held_out: self.held_out(),
            repeatability: repeats.map(|noise| self.repeatability(&noise)),
            error,
            verdict,
            effects,
            alternatives,
            unobservable: self.unobservable(),
            outliers: self.outliers(noise_dof),
            structure,
            remaining,
            ladder: self.search.ladder.clone(),
            condition: 1.0,
            next_measurement,
            plain: Vec::new(),
            seed: options.seed,
            version: env!("CARGO_PKG_VERSION"),
            points: self.points()?,
            model_effects: self.best.fit.model.effects.iter().copied().collect(),
            with_terms: None,
            keeps_terms: false,
        })
    }

    fn repeatability(&self, noise: &Noise) -> Repeatability {
        let axes = axes(self.arm).iter().map(|&axis| axis_figure(axis, noise.sigma[axis])).collect();
        Repeatability { distance_m: noise.distance_m, axes, dof: noise.dof }
    }

    /// How the rows were chosen that the fit did not see.
    fn held_out(&self) -> String {
        let choice = &self.run.choice;
        match (self.search.kind.heldout.rows.is_empty(), &choice.parts) {
            (false, _) if choice.told.is_empty() => "the column held_out".into(),
            (false, _) => choice.told.clone(),
            (true, Some(_)) if choice.parts_in_turn().is_some() => choice.told.clone(),
            (true, Some(_)) => format!("{}, in {FOLDS} parts", choice.told),
            (true, None) => format!("each word in turn, in {FOLDS} parts"),
        }
    }

    /// Errors of a model; `unseen` are its cross-validated residuals, which serve where nothing is held out for good.
    fn errors(&mut self, model: &ArmModel, unseen: &[f64]) -> Result<Errors, NoPose> {
        let ToolPose { training, heldout, scratch, .. } = &mut self.search.kind;
        let train = error_figure(self.arm, training, &training.residuals(model, scratch)?);
        let heldout = match heldout.rows.is_empty() {
            true => error_figure(self.arm, training, unseen),
            false => error_figure(self.arm, heldout, &heldout.residuals(model, scratch)?),
        };
        Ok(Errors { train, heldout: Some(heldout) })
    }

    /// The effects found, with intervals of their values.
    fn found(&mut self, error: &BeforeAfter) -> Result<Vec<Found>, NoPose> {
        let fit = &self.best.fit;
        let covariance = covariance(fit, &self.search.kind.training);
        let wide = quantile_975(self.search.kind.training.n_groups.saturating_sub(fit.values.len()));
        let mut found = Vec::new();
        for (index, effect) in fit.model.effects.iter().enumerate().skip(self.n_known) {
            let law = effect.law();
            let parameter = |(column, &(_, value)): (usize, &Value)| {
                let half = wide * covariance[(column, column)].max(0.0).sqrt();
                let (quantity, value) = (law.quantities()[value], law.values()[value]);
                Parameter { name: quantity.name, value, unit: quantity.unit, ci95: [value - half, value + half] }
            };
            let of_effect = fit.values.iter().enumerate().filter(|(_, (owner, _))| *owner == index);
            found.push(Found {
                law: law.name(),
                place: place_code(effect),
                place_name: place_name(self.arm, effect),
                parameters: of_effect.map(parameter).collect(),
                heldout_gain_m: self.heldout_gain(index, error)?,
            });
        }
        Ok(found)
    }

    /// By how much the held-out error is larger without one of the effects.
    fn heldout_gain(&mut self, effect: usize, error: &BeforeAfter) -> Result<Option<f64>, NoPose> {
        let Some(after) = &error.after.heldout else {
            return Ok(None);
        };
        let without = if self.best.fit.model.effects.len() == self.n_known + 1 {
            error.before.heldout.as_ref().map(|figure| figure.distance_m)
        } else {
            let Trial { fit, predicted, .. } = self.search.kind.without(self.best, effect)?;
            self.errors(&fit.model, &predicted)?.heldout.map(|figure| figure.distance_m)
        };
        Ok(without.map(|without| without - after.distance_m))
    }

    /// Values of the effects found that no row tells anything of; on a planar arm, offsets out of the plane say.
    fn unobservable(&self) -> Vec<String> {
        let told = &self.best.fit.values;
        let all = values(&self.best.fit.model);
        all.iter()
            .filter(|value| !told.contains(value))
            .map(|&(effect, value)| {
                let effect = &self.best.fit.model.effects[effect];
                format!(
                    "{} of {} at {}",
                    effect.law().quantities()[value].name,
                    effect.law().name(),
                    place_code(effect)
                )
            })
            .collect()
    }

    /// Of several effects that explain the measurements as well, the best one stands among the alternatives too.
    fn with_best(&self, verdict: Verdict, alternatives: Vec<Alternative>) -> Vec<Alternative> {
        if verdict != Verdict::NotIdentifiable {
            return alternatives;
        }
        let own =
            self.best.fit.model.effects.iter().skip(self.n_known).enumerate().map(|(instead_of, effect)| Alternative {
                instead_of,
                law: effect.law().name(),
                place: place_code(effect),
                place_name: place_name(self.arm, effect),
                cross_validated: self.best.error,
                worse_with: 0.0,
            });
        own.chain(alternatives).collect()
    }

    /// Rows that are farther off than the noise, itself known by so many degrees of freedom only, would ever be.
    fn outliers(&self, noise_dof: f64) -> Vec<Outlier> {
        let training = &self.search.kind.training;
        let (n_axes, residuals) = (training.n_axes(), &self.best.fit.residuals);
        let (Ok(chi), Ok(f)) = (ChiSquared::new(n_axes as f64), FisherSnedecor::new(n_axes as f64, noise_dof)) else {
            return Vec::new();
        };
        let squares: Vec<f64> = residuals.chunks(n_axes).map(|row| size(row).powi(2)).collect();
        let usual = median(squares.iter().copied()).unwrap_or(1.0) / chi.inverse_cdf(0.5);
        let rare = 1.0 - OUTLIER_LEVEL / squares.len().max(1) as f64;
        let limit = n_axes as f64 * f.inverse_cdf(rare) * usual.max(1.0);
        let distances = training.distances_m(residuals);
        let far = squares.iter().enumerate().filter(|(_, square)| **square > limit);
        far.map(|(row, square)| Outlier {
            line: self.run.line(training.rows[row].sample),
            distance_m: distances[row],
            sigmas: square.sqrt(),
        })
        .collect()
    }

    fn points(&mut self) -> Result<Vec<Point>, NoPose> {
        let mut points = Vec::new();
        let ToolPose { training, heldout, scratch, .. } = &mut self.search.kind;
        for (held_out, observations) in [(false, &*training), (true, &*heldout)] {
            let before = observations.residuals(&self.arm.model, scratch)?;
            let after = observations.residuals(&self.best.fit.model, scratch)?;
            let (before_m, after_m) = (observations.distances_m(&before), observations.distances_m(&after));
            for (k, row) in observations.rows.iter().enumerate() {
                let sample = &self.run.samples[row.sample];
                points.push(Point {
                    time_s: sample.time_s,
                    word: sample.word.to_string(),
                    servos_rad: sample.servos_rad.clone(),
                    supply: sample.supply,
                    temperature_c: sample.temperature_c,
                    held_out,
                    before_m: before_m[k],
                    after_m: after_m[k],
                    before: observations.components(&before, k),
                    after: observations.components(&after, k),
                });
            }
        }
        points.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        Ok(points)
    }
}

fn error_figure(arm: &Arm, observations: &Observations, residuals: &[f64]) -> ErrorFigure {
    let distances = observations.distances_m(residuals);
    let axes = axes(arm).iter().zip(observations.rms(residuals)).map(|(&axis, rms)| axis_figure(axis, rms)).collect();
    ErrorFigure {
        axes,
        distance_m: root_mean_square(&distances),
        largest_m: distances.iter().copied().fold(0.0, f64::max),
    }
}

fn axis_figure(axis: usize, value: f64) -> AxisFigure {
    let (axis, unit) = axis_name(axis);
    AxisFigure { axis: axis.into(), value, unit }
}
