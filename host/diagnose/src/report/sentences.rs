//! A diagnosis in plain words, for a person with a screwdriver.

use darm_core::effect::Effect;
use darm_core::effect::anchor_offset::{AnchorOffset, Plate};
use darm_core::effect::drift::Drift;

use crate::linearise::arm_candidates::{along_name, place_name};
use crate::outcome::{Diagnosis, Verdict};
use darm_arm::arm::Arm;

/// The sentences.
pub(crate) fn sentences(arm: &Arm, diagnosis: &Diagnosis, effects: &[Effect<f64>]) -> Vec<String> {
    let mut told = vec![verdict(diagnosis)];
    if diagnosis.verdict == Verdict::EffectFound {
        told.extend(effects.iter().map(|effect| capitalised(&effect_sentence(arm, effect))));
        told.push(error_sentence(diagnosis));
    }
    if diagnosis.verdict == Verdict::NotIdentifiable {
        for other in &diagnosis.alternatives {
            told.push(format!("It may be {} at {}.", other.law, other.place_name));
        }
    }
    if diagnosis.verdict == Verdict::UnexplainedStructure {
        let names: Vec<String> = diagnosis.remaining.depends_on.iter().take(3).map(ToString::to_string).collect();
        if !names.is_empty() {
            told.push(format!("It depends on: {}.", names.join("; ")));
        }
        told.extend(terms_sentence(arm, diagnosis));
    }
    if let Some(next) = &diagnosis.next_measurement {
        let conditions = next.conditions.as_ref().map_or(String::new(), |conditions| format!(" {conditions}"));
        let words = next.words.join(" ");
        told.push(format!("Measure next{conditions}, in this order: {words}. That tells {}.", next.tells));
    }
    if !diagnosis.outliers.is_empty() {
        let lines: Vec<String> = diagnosis.outliers.iter().take(8).map(|outlier| outlier.line.to_string()).collect();
        told.push(format!(
            "{} rows fit nothing and were given little weight: lines {}.",
            diagnosis.outliers.len(),
            lines.join(", ")
        ));
    }
    told
}

/// What fitted terms would gain.
fn terms_sentence(arm: &Arm, diagnosis: &Diagnosis) -> Option<String> {
    let with_terms = diagnosis.with_terms.as_ref()?;
    let terms = with_terms.effects.iter().filter_map(|effect| match effect {
        Effect::FittedTerm(term) => Some(along_name(arm, term)),
        _ => None,
    });
    Some(format!(
        "Kept in the model as fitted terms ({}), which tell nothing outside of what was measured, it leaves {:.2} mm on rows \
         that no fit saw in place of {:.2} mm: --keep-terms writes them.",
        terms.collect::<Vec<_>>().join("; "),
        with_terms.unseen_m * 1e3,
        diagnosis.error.after.unseen().distance_m * 1e3
    ))
}

/// The sentence with its first letter large.
fn capitalised(sentence: &str) -> String {
    let mut letters = sentence.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}

fn verdict(diagnosis: &Diagnosis) -> String {
    match diagnosis.verdict {
        Verdict::EffectFound => "The model lacks an effect, and it was found.".into(),
        Verdict::NoEffect => "The model predicts as well as the measurement repeats: nothing is missing.".into(),
        Verdict::UnexplainedStructure => {
            "The arm departs from its model by more than the noise, and no effect that is known here explains it."
                .into()
        }
        Verdict::NotIdentifiable => {
            "Something is missing, but these measurements cannot tell which of several effects it is.".into()
        }
    }
}

fn error_sentence(diagnosis: &Diagnosis) -> String {
    let [before, after] =
        [&diagnosis.error.before, &diagnosis.error.after].map(|errors| errors.unseen().distance_m * 1e3);
    let noise = match &diagnosis.repeatability {
        Some(repeatability) => format!("; the measurement repeats to {:.2} mm", repeatability.distance_m * 1e3),
        None => String::new(),
    };
    let rows = &diagnosis.held_out;
    format!("On rows that no fit saw ({rows}), the error falls from {before:.2} mm to {after:.2} mm{noise}.")
}

/// One effect: which part, which way, how much.
pub fn effect_sentence(arm: &Arm, effect: &Effect<f64>) -> String {
    let place = place_name(arm, effect);
    match effect {
        Effect::StrokeLoss(law) => {
            let way = if law.loss_m > 0.0 { "short of" } else { "beyond" };
            format!("{place}: in state {} it stops {:.2} mm {way} its stop.", law.state, law.loss_m.abs() * 1e3)
        }
        Effect::AnchorOffset(law) => anchor_sentence(&place, law, arm.model.chain.is_planar()),
        Effect::GravitySag(law) => {
            format!("{place}: the legs give way under load by {:.3} mm for each 100 N.", law.compliance_m_per_n * 1e5)
        }
        Effect::Play(law) => {
            format!("{place}: an actuator that was not moved stands {:.2} mm off its stop.", law.width_m * 1e3)
        }
        Effect::SupplyStroke(law) => {
            let way = if law.gain > 0.0 { "shorter" } else { "longer" };
            format!(
                "{place}: the stroke gets {:.2} % {way} for each 10 % of supply that is missing.",
                law.gain.abs() * 10.0
            )
        }
        Effect::ThermalGrowth(law) => {
            format!("{place}: the legs grow by {:.1} µm per metre and kelvin.", law.expansion_per_k * 1e6)
        }
        Effect::Step(law) => {
            let (way, since_s) = (longer(law.shift_m), law.since_s);
            format!("{place}: since {since_s:.1} s after the start it is {:.2} mm {way}.", law.shift_m.abs() * 1e3)
        }
        Effect::Drift(law) => drift_sentence(&place, law),
        Effect::Wear(law) => {
            let way = if law.per_switch_m > 0.0 { "farther" } else { "less far" };
            format!("{place}: its stops let it {:.2} mm {way} for each 100 switches.", law.per_switch_m.abs() * 1e5)
        }
        Effect::Crowding(law) => {
            let [short_mm, more_mm] = [law.values[0] * 1e3, law.values[1] * -1e2];
            format!(
                "{place}: an actuator stays {short_mm:.2} mm short for each other that its module switches with it, and \
                 {more_mm:.2} mm more for each 10 % of supply that is missing."
            )
        }
        Effect::FrameOffset(law) => frame_sentence(&place, &law.values, arm.model.chain.is_planar()),
        Effect::Scale(law) => {
            let way = if law.stretch > 0.0 { "long" } else { "short" };
            format!("{place}: it tells lengths {:.3} % too {way}.", law.stretch.abs() * 100.0)
        }
        Effect::FittedTerm(term) => {
            format!("{place}: it moves along {}, which no law explains.", along_name(arm, term))
        }
        Effect::JointOffset(law) => {
            format!("{place}: its joint stands {:+.3}° from where the servo tells.", law.offset_rad.to_degrees())
        }
    }
}

fn drift_sentence(place: &str, law: &Drift<f64>) -> String {
    let [rate, change] = [law.values[0] * 6e4, law.values[1] * 3.6e6];
    let then = if rate * change < 0.0 { "less" } else { "more" };
    format!(
        "{place}: it creeps {:.2} mm {} in the first minute, and {:.2} mm {then} in each minute after.",
        (rate + 0.5 * change).abs(),
        longer(rate + 0.5 * change),
        change.abs()
    )
}

fn anchor_sentence(place: &str, law: &AnchorOffset<f64>, is_planar: bool) -> String {
    let plate = match law.plate {
        Plate::Base => "lower",
        Plate::Top => "upper",
    };
    let d = law.offset * 1e3;
    let depth = if is_planar { String::new() } else { format!(", {:+.2} mm in z", d.z) };
    format!(
        "{place}: its anchor on the {plate} plate sits {:+.2} mm in x, {:+.2} mm in y{depth} from its place.",
        d.x, d.y
    )
}

fn longer(growth: f64) -> &'static str {
    if growth > 0.0 { "longer" } else { "shorter" }
}

/// Where a frame sits: turned by the first three (rad), shifted by the others (m).
fn frame_sentence(place: &str, values: &[f64; 6], planar: bool) -> String {
    let [rx, ry, rz] = [values[0], values[1], values[2]].map(f64::to_degrees);
    let [x, y, z] = [values[3], values[4], values[5]].map(|shift| shift * 1e3);
    if planar {
        return format!("{place} sits {x:+.2} mm in x, {y:+.2} mm in y from its place, turned by {rz:+.3}°.");
    }
    format!(
        "{place} sits {x:+.2} mm in x, {y:+.2} mm in y, {z:+.2} mm in z from its place, turned by {rx:+.3}°, {ry:+.3}° and \
         {rz:+.3}° about them."
    )
}
