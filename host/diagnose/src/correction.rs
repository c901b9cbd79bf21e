//! The corrected model: what a diagnosis adds to the model that it was made with.

use std::path::{Path, PathBuf};

use darm_core::effect::Effect;

use crate::judge::fitted_terms::WithTerms;
use crate::linearise::model::is_robot_file;
use crate::linearise::model_effects::ModelEffect;
use crate::linearise::model_error::ModelError;
use crate::measurement::Run;
use crate::outcome::{Diagnosis, Measured};
use crate::prepare::observations::Observations;
use darm_arm::arm::{Arm, ZERO_CELSIUS};

/// A diagnosis, and what it adds to the model.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome<C> {
    /// The diagnosis.
    pub diagnosis: Diagnosis,
    /// What it adds to the model.
    pub correction: C,
}

/// What of a diagnosis a corrected model keeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Keep {
    /// The effects that are named.
    Effects,
    /// Also what no law explains, as fitted terms.
    EffectsAndTerms,
}

/// What a diagnosis of tool poses adds to an arm.
#[derive(Clone, Debug, PartialEq)]
pub struct ArmCorrection {
    /// The effects of the best model, whether they are named or not, after those that the model had.
    pub best_effects: Vec<Effect<f64>>,
    /// Whether they are named.
    pub(crate) is_named: bool,
    /// The same with what no law explains as fitted terms; `None` where there is nothing to keep.
    pub with_terms: Option<WithTerms>,
}

impl ArmCorrection {
    /// The arm with the effects that were found, the next model number and the conditions that it had settled to at the end
    /// of `run`; `None` where there is nothing to add.
    pub fn corrected(&self, arm: &Arm, run: &Run, keep: Keep) -> Option<Arm> {
        let terms = self.with_terms.as_ref().filter(|_| keep == Keep::EffectsAndTerms).map(|terms| &terms.effects);
        let effects = terms.or(self.is_named.then_some(&self.best_effects))?;
        let (end_s, switches) = Observations::new(arm, run, [1.0; 6], |_| true).last();
        let mut corrected = arm.clone();
        corrected.model.effects = effects.iter().copied().collect();
        corrected.model.effects.iter_mut().for_each(|effect| effect.law_mut().settle(end_s, &switches));
        corrected.model.number += 1;
        let (supply, temperature_c) = run.settled();
        corrected.model.working_supply = supply.unwrap_or(corrected.model.working_supply);
        let temperature_k = temperature_c.map(|celsius| celsius + ZERO_CELSIUS);
        corrected.model.working_temperature_k = temperature_k.unwrap_or(corrected.model.working_temperature_k);
        Some(corrected)
    }
}

/// What a diagnosis of signals adds to a model.
#[derive(Clone, Debug, PartialEq)]
pub struct SignalCorrection {
    /// The effects of the model with those that were selected: all values, those that are not identified among them.
    pub effects: Vec<ModelEffect>,
    /// What no law explains, as fitted terms.
    pub terms: Vec<ModelEffect>,
}

/// A joint of a model that does not move: its name, and its position in deg or mm.
#[derive(Clone, Debug, PartialEq)]
pub struct LockedJoint {
    /// Its name.
    pub name: String,
    /// Whether it turns: the position is in deg, else in mm.
    pub is_revolute: bool,
    /// Its position, deg or mm.
    pub position: f64,
}

impl SignalCorrection {
    /// Writes the model of a file with the effects of a diagnosis in it, and the next number; what a robot's file names
    /// stays where it is. `false`, and no file, where there is nothing to add.
    ///
    /// # Errors
    ///
    /// A file that cannot be read or written.
    pub fn write(&self, model: &Path, output: &Path, found: &Diagnosis, keep: Keep) -> Result<bool, ModelError> {
        self.write_locked(model, output, found, keep, &[])
    }

    /// The same of a model some joints of which were locked besides those that its file locks.
    ///
    /// # Errors
    ///
    /// As [`SignalCorrection::write`].
    pub fn write_locked(
        &self,
        model: &Path,
        output: &Path,
        found: &Diagnosis,
        keep: Keep,
        locked: &[LockedJoint],
    ) -> Result<bool, ModelError> {
        let terms = match keep {
            Keep::Effects => &[][..],
            Keep::EffectsAndTerms => &self.terms,
        };
        let nothing = found.effects.is_empty() && terms.is_empty();
        let holds = found.verdict.names_effects() || keep == Keep::EffectsAndTerms && !terms.is_empty();
        if nothing || !holds {
            return Ok(false);
        }
        let mut table = model_table(model, found.kind)?;
        keep_urdf_where_it_is(&mut table, model, output)?;
        keep_locks(&mut table, locked);
        let number = table.get("number").and_then(toml::Value::as_integer).unwrap_or(0);
        table.insert("number".into(), toml::Value::Integer(number + 1));
        let effects = self.effects.iter().chain(terms).filter_map(|effect| toml::Value::try_from(effect).ok());
        table.insert("effect".into(), toml::Value::Array(effects.collect()));
        let name = output.display().to_string();
        let text = toml::to_string(&table).map_err(|error| ModelError::Value(name.clone(), error.to_string()))?;
        std::fs::write(output, text).map_err(|error| ModelError::Io(name, error))?;
        Ok(true)
    }
}

/// The keys of a model's file; of a robot's file those of a model that names it.
fn model_table(model: &Path, kind: Measured) -> Result<toml::Table, ModelError> {
    if is_robot_file(model) {
        let observed = if kind == Measured::ContactWrench { "wrench" } else { "torque" };
        let own = model.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let keys = [("kind", "robot".to_string()), ("urdf", own), ("observed", observed.into())];
        return Ok(keys.map(|(key, value)| (key.to_string(), toml::Value::String(value))).into_iter().collect());
    }
    let name = model.display().to_string();
    let text = std::fs::read_to_string(model).map_err(|error| ModelError::Io(name.clone(), error))?;
    text.parse().map_err(|error| ModelError::Toml(name, error))
}

/// Adds the joints that were locked.
fn keep_locks(table: &mut toml::Table, locked: &[LockedJoint]) {
    for joint in locked {
        let key = if joint.is_revolute { "lock_deg" } else { "lock_mm" };
        let locks = table.entry(key).or_insert_with(|| toml::Value::Table(toml::Table::new()));
        if let Some(locks) = locks.as_table_mut() {
            locks.insert(joint.name.clone(), toml::Value::Float(joint.position));
        }
    }
}

/// The path of the URDF, absolute where the output lies in another folder than the model.
fn keep_urdf_where_it_is(table: &mut toml::Table, model: &Path, output: &Path) -> Result<(), ModelError> {
    let folder = |path: &Path| path.parent().map_or(PathBuf::new(), Path::to_path_buf).canonicalize().ok();
    if let Some(toml::Value::String(urdf)) = table.get_mut("urdf")
        && folder(model) != folder(output)
    {
        let path = model.parent().unwrap_or(Path::new("")).join(&*urdf);
        let absolute = path.canonicalize().map_err(|error| ModelError::Io(path.display().to_string(), error))?;
        *urdf = absolute.display().to_string();
    }
    Ok(())
}
