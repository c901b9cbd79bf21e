//! The numbers of a diagnosis or of a model as lines, so that two of them can be compared: a line each for what has the same name.

use std::path::Path;

use darm_arm::arm::Arm;
use darm_core::effect::{Effect, Quantity};
use darm_diagnose::linearise::arm_candidates::site;
use darm_diagnose::outcome::EffectValue;
use darm_diagnose::report::numbers::shown;
use serde::Serialize;
use serde_json::Value;

use super::read::Kind;
use super::{History, HistoryError};

/// A number with its name.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(super) struct Line {
    /// What it is, the same in each entry.
    name: String,
    /// The number with its unit, and its 95 % confidence interval where it has one.
    text: String,
}

/// Those of an entry; `None` where there is none, or of a kind without such numbers.
pub(super) fn lines(history: &History, of: Kind, entry: &str) -> Result<Option<Vec<Line>>, HistoryError> {
    match of {
        Kind::Diagnoses => {
            let report = entry.parse().map_or(Ok(None), |id| history.report(id))?;
            Ok(report.as_deref().and_then(parsed).map(|report| of_diagnosis(&report)))
        }
        Kind::Models => {
            let Some(text) = history.model_file(entry)? else { return Ok(None) };
            let corrected = history.correction(entry)?;
            let report = corrected.as_ref().and_then(|(_, _, report)| parsed(report));
            let data = corrected.as_ref().map(|(_, data, _)| data.as_str());
            Ok(Some(of_model(&text, data, report.as_ref())))
        }
        Kind::Runs | Kind::Tables | Kind::Uploads => Ok(None),
    }
}

fn parsed(report: &str) -> Option<Value> {
    serde_json::from_str(report).ok()
}

fn line(name: impl Into<String>, text: impl Into<String>) -> Line {
    Line { name: name.into(), text: text.into() }
}

fn of_diagnosis(report: &Value) -> Vec<Line> {
    let mut lines = Vec::new();
    lines.extend(report["verdict"].as_str().map(|verdict| line("verdict", verdict)));
    let rows = [("rows of the fit", "train"), ("rows held out", "held_out")];
    lines.extend(rows.iter().filter_map(|(name, key)| Some(line(*name, report["rows"][key].as_u64()?.to_string()))));
    lines.extend(errors(report));
    lines.extend(effects(report));
    lines
}

/// The effects of an arm file, with the intervals of the diagnosis that it was corrected after. Of another model those of the diagnosis.
fn of_model(text: &str, data: Option<&str>, report: Option<&Value>) -> Vec<Line> {
    let arm = Arm::parse(Path::new("model.toml"), text).ok();
    let mut lines: Vec<Line> = arm.iter().map(|arm| line("number", arm.model.number.to_string())).collect();
    lines.push(line("corrected after", data.unwrap_or("no diagnosis of this history")));
    lines.extend(report.into_iter().flat_map(errors));
    let found: Vec<Line> = report.map(effects).unwrap_or_default();
    match &arm {
        Some(arm) => {
            let own = arm.model.effects.iter().flat_map(|effect| of_effect(arm, effect));
            lines.extend(own.map(|own| found.iter().find(|found| found.name == own.name).cloned().unwrap_or(own)));
        }
        None => lines.extend(found),
    }
    lines
}

/// Before and after, on the rows that no fit has seen where there are any, and the repeatability.
fn errors(report: &Value) -> impl Iterator<Item = Line> {
    let norm = |side: &str| {
        let error = &report["error"][side];
        let (name, figure) = match &error["held_out"] {
            Value::Null => ("error", &error["train"]),
            held_out => ("held-out error", held_out),
        };
        Some(line(format!("{name} {side}"), number(&figure["norm"])?))
    };
    let repeatability = number(&report["repeatability"]["norm"]).map(|text| line("repeatability", text));
    [norm("before"), norm("after"), repeatability].into_iter().flatten()
}

fn number(of: &Value) -> Option<String> {
    let value = EffectValue {
        name: String::new(),
        value: of["value"].as_f64()?,
        unit: of["unit"].as_str()?.to_owned(),
        ci95: None,
        nominal: None,
    };
    Some(shown(&value, value.value))
}

/// The effects of a report, a line for each value.
fn effects(report: &Value) -> Vec<Line> {
    let all = report["effects"].as_array().into_iter().flatten();
    let values = |effect: &Value| -> Option<Vec<Line>> {
        let of = name(effect["law"].as_str()?, effect["where"].as_str()?);
        let values = effect["parameters"].as_array()?.iter().filter_map(value);
        Some(values.map(|value| of_value(&of, &value)).collect())
    };
    all.filter_map(values).flatten().collect()
}

fn value(of: &Value) -> Option<EffectValue> {
    Some(EffectValue {
        name: of["name"].as_str()?.to_owned(),
        value: of["value"].as_f64()?,
        unit: of["unit"].as_str()?.to_owned(),
        ci95: of["ci95"][0].as_f64().zip(of["ci95"][1].as_f64()).map(|(low, high)| [low, high]),
        nominal: of["nominal"].as_f64(),
    })
}

/// An effect of a model, without intervals.
fn of_effect(arm: &Arm, effect: &Effect<f64>) -> Vec<Line> {
    let of = name(effect.name().as_str(), &site(arm, effect).code);
    let values = effect.quantities().iter().zip(effect.values());
    let value = |(quantity, value): (&Quantity, &f64)| EffectValue {
        name: quantity.name.into(),
        value: *value,
        unit: quantity.unit.into(),
        ci95: None,
        nominal: None,
    };
    values.map(value).map(|value| of_value(&of, &value)).collect()
}

fn name(law: &str, place: &str) -> String {
    format!("{law}, {place}")
}

/// As in the report: of a quantity that the model has, what it is after the change.
fn of_value(effect: &str, value: &EffectValue) -> Line {
    let text = |size: f64| shown(value, value.nominal.map_or(size, |from| from + size));
    let interval = value.ci95.map(|[low, high]| format!(" (95 % CI {} to {})", text(low), text(high)));
    line(format!("{effect}: {}", value.name), text(value.value) + &interval.unwrap_or_default())
}
