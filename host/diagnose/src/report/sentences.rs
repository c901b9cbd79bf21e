//! A diagnosis in sentences, for a person with a screwdriver.

use darm_core::effect::{Effect, Plate};

use crate::judge::far_rows::are_too_many;
use crate::judge::fitted_terms::WithTerms;
use crate::linearise::arm_candidates::{place_name, site, term_name};
use crate::outcome::{
    self, Alternative, BeforeAfter, Dependence, Diagnosis, ErrorFigure, NextMeasurement, Number, OtherReading,
    Regressor, RepeatedIn, Verdict,
};
use crate::prepare::repeatability::MIN_DOF;
use crate::rejection::Rejection;
use crate::report::numbers::{four_decimals as short, named, readable};
use darm_arm::arm::Arm;

/// An error that an effect changes falls below this share of itself.
const SHOWN: f64 = 0.9;
/// Outliers that are listed by line.
const MAX_LINES: usize = 8;

/// The sentences on tool poses; `effects` are those selected.
pub(crate) fn of_poses(
    arm: &Arm,
    diagnosis: &Diagnosis,
    effects: &[Effect<f64>],
    with_terms: Option<&WithTerms>,
) -> Vec<String> {
    let mut sentences = vec![verdict(diagnosis)];
    if diagnosis.verdict == Verdict::WrongModelOrLog {
        return sentences;
    }
    if diagnosis.verdict.names_effects() {
        let is_named = |effect: &&Effect<f64>| {
            let site = site(arm, effect);
            diagnosis.effects.iter().any(|named| named.law == effect.name() && named.site == site)
        };
        let named = effects.iter().filter(is_named);
        sentences.extend(named.map(|effect| capitalised(&effect_sentence(arm, effect))));
        sentences.extend(error_sentence(diagnosis));
        sentences.extend(unconfirmed_sentence(diagnosis));
    }
    if diagnosis.verdict == Verdict::NotIdentifiable {
        let candidates = diagnosis.alternatives.iter().map(|other| format!("{} at {}", other.law, other.site.name));
        sentences.push(format!("Candidates: {}.", candidates.collect::<Vec<_>>().join("; ")));
    }
    if matches!(diagnosis.verdict, Verdict::UnexplainedStructure | Verdict::PartlyExplained) {
        let name = |one: &Dependence| format!("{one}, in {}", one.direction());
        let names: Vec<String> = diagnosis.remaining.depends_on.iter().take(3).map(name).collect();
        if !names.is_empty() {
            sentences.push(format!("The residual correlates with: {}.", names.join("; ")));
        }
        sentences.extend(with_terms.map(|with_terms| terms_sentence(arm, diagnosis, with_terms)));
    }
    sentences.extend(diagnosis.next_measurement.as_ref().map(next_sentence));
    sentences.extend(outlier_sentence(diagnosis));
    sentences
}

/// The sentences on signals.
pub(crate) fn of_signals(diagnosis: &Diagnosis) -> Vec<String> {
    let mut sentences = vec![verdict(diagnosis)];
    if diagnosis.verdict == Verdict::WrongModelOrLog {
        return sentences;
    }
    sentences.extend(diagnosis.effects.iter().map(effect_of_signals));
    sentences.extend(error_sentence(diagnosis));
    if !diagnosis.unobservable.is_empty() {
        sentences.push(format!("Not identifiable from these data: {}.", diagnosis.unobservable.join("; ")));
    }
    if diagnosis.verdict.names_effects() {
        sentences.extend(unconfirmed_sentence(diagnosis));
    }
    if !diagnosis.alternatives.is_empty() {
        let name = |other: &Alternative| format!("{} at {}", other.law, other.site);
        let all: Vec<String> = diagnosis.alternatives.iter().map(name).collect();
        sentences.push(format!("These rows do not distinguish: {}.", all.join("; ")));
    }
    sentences.extend(diagnosis.next_measurement.as_ref().map(next_sentence));
    for dependence in &diagnosis.remaining.depends_on {
        if dependence.regressor == Regressor::Condition {
            let share = 100.0 * dependence.share;
            sentences.push(format!(
                "Rows under the same conditions differ by far less than the residual, and no channel that was tried explains the rest, \
                 {share:.0} % of its mean square: an error of each condition by itself, or of something that was not recorded."
            ));
            continue;
        }
        if dependence.axis.is_none() {
            sentences.push(format!(
                "Residual changes with {dependence}: one cause, such as what the tool carries. Add a column `payload`, 0 before and 1 \
                 from then on, and diagnose again."
            ));
            continue;
        }
        let axis = dependence.axis.as_deref().unwrap_or_default();
        let share = 100.0 * dependence.share;
        sentences.push(format!("Residual of {axis} correlates with {dependence} ({share:.0} % of its mean square)."));
    }
    let lasts = diagnosis.remaining.depends_on.iter().any(|dependence| dependence.regressor == Regressor::RowBefore);
    if lasts && !diagnosis.kind.is_of_tool() {
        sentences.push(
            "A log that was filtered as it was recorded looks the same: record it unfiltered to exclude that.".into(),
        );
    }
    sentences.extend(outlier_sentence(diagnosis));
    sentences
}

/// The effects that the corrected model has for its prediction alone.
fn unconfirmed_sentence(diagnosis: &Diagnosis) -> Option<String> {
    let all = diagnosis.unconfirmed.join("; ");
    (!all.is_empty())
        .then(|| format!("In the corrected model too, though these data do not confirm each by itself: {all}."))
}

/// The effects that the user rejected, with the reasons.
pub(crate) fn of_rejections(rejected: &[Rejection]) -> Option<String> {
    let all: Vec<String> = rejected.iter().map(ToString::to_string).collect();
    (!all.is_empty()).then(|| format!("Rejected by the user, so not tried: {}.", all.join("; ")))
}

/// What the verdict says.
fn verdict(diagnosis: &Diagnosis) -> String {
    match diagnosis.verdict {
        Verdict::EffectFound => "The model is missing an effect, and it was found.".into(),
        Verdict::PartlyExplained => {
            let [before, after] =
                [&diagnosis.error.before, &diagnosis.error.after].map(|errors| errors.held_out_or_train().norm.value);
            let share = 100.0 * (1.0 - (after / before).powi(2)).max(0.0);
            let rest = match diagnosis.is_more_left {
                true => "and more than noise is left".into(),
                false => format!("and whether more is missing is not known: {}", unknown_noise(diagnosis)),
            };
            format!("The model is missing an effect that was found; it takes {share:.0} % of the mean square error, {rest}.")
        }
        Verdict::NoEffect => {
            "No missing effect found: the error exceeds the noise on no axis, as well as the noise is known, and no effect that was \
             tried predicts held-out rows better."
                .into()
        }
        Verdict::UnexplainedStructure => {
            "The measurement differs from the model by more than noise, and no known effect explains it.".into()
        }
        Verdict::NotIdentifiable => {
            "The model is missing an effect, but these data do not identify which of several it is.".into()
        }
        Verdict::WrongModelOrLog => wrong_model_or_log(diagnosis),
        Verdict::TooLittleData if diagnosis.is_noise_known => {
            "No missing effect found: effects that fit the training rows do not lower the error on the held-out rows."
                .into()
        }
        Verdict::TooLittleData => format!(
            "No missing effect found, and these data cannot show that there is none: {}.",
            unknown_noise(diagnosis)
        ),
    }
}

/// Why the noise is not known, and what to do.
fn unknown_noise(diagnosis: &Diagnosis) -> String {
    match &diagnosis.repeatability {
        None => "no rows repeat each other, so that the noise is not known. Repeat some of the rows".into(),
        Some(noise) if noise.repeated_in == RepeatedIn::Neighbours => {
            let (error, unit) = readable(&diagnosis.error.after.held_out_or_train().norm);
            format!(
                "the error of {} {unit} is larger than the scatter of neighbouring rows, {} {unit}, which may not have all of \
                 the noise. Repeat the motion, or some of the rows",
                short(error),
                short(readable(&noise.norm).0)
            )
        }
        Some(noise) => format!(
            "the repeatability rests on {} degrees of freedom, {MIN_DOF} are needed. Repeat some of the rows",
            noise.dof
        ),
    }
}

/// What has to be so for model and log to agree.
fn wrong_model_or_log(diagnosis: &Diagnosis) -> String {
    let before = readable(&diagnosis.error.before.train.norm);
    match &diagnosis.other_reading {
        Some(OtherReading { misreading, as_read, error }) => {
            let before = as_read.as_ref().map_or(before, readable);
            let after = readable(error);
            format!(
                "The model or the log is wrong, so no effect is named. They agree if {misreading}: the error falls from {} {} \
                 to {} {}. Correct the log or the model and diagnose again.",
                short(before.0),
                before.1,
                short(after.0),
                after.1
            )
        }
        None => format!(
            "The model or the log is wrong, so no effect is named: the model explains too little of what was measured (error \
             {} {}), and no other reading that was tried explains more. Check that the model is of this robot, that the columns \
             are what their names say, and that rows of different sources belong together.",
            short(before.0),
            before.1
        ),
    }
}

/// `Held-out error 11.2 → 0.30 mm (repeatability 0.31 mm, 120 degrees of freedom; held out: …)`; of rows that chose the effects,
/// each left out in turn, `Cross-validated error …`.
fn error_sentence(diagnosis: &Diagnosis) -> Option<String> {
    let [before, after] = [&diagnosis.error.before, &diagnosis.error.after].map(|errors| errors.held_out.as_ref());
    let (before, after) = (before?, after?);
    let fall = |of: fn(&ErrorFigure) -> &Number| {
        let [(before, _), (after, unit)] = [before, after].map(|figure| readable(of(figure)));
        format!("{} → {} {unit}", short(before), short(after))
    };
    let noise = diagnosis.repeatability.as_ref().map_or(String::new(), |repeatability| {
        let (value, unit) = readable(&repeatability.norm);
        format!("repeatability {} {unit} with {} degrees of freedom; ", short(value), repeatability.dof)
    });
    let without = match after.without_farthest.value < SHOWN * after.norm.value {
        true => format!("without the farthest hundredth of the rows {}; ", fall(|figure| &figure.without_farthest)),
        false => String::new(),
    };
    let hardly = if is_hardly_shown(diagnosis) {
        " The held-out rows show little of these effects: hold out rows with the states and conditions in which they act."
    } else {
        ""
    };
    let error = if diagnosis.is_cross_validated { "Cross-validated error" } else { "Held-out error" };
    let rows = diagnosis.unseen();
    Some(format!("{error} {} ({without}{noise}{rows}: {}).{hardly}", fall(|figure| &figure.norm), diagnosis.held_out))
}

/// Whether effects that are named lower the error on the training rows, and that on the held-out rows by little.
fn is_hardly_shown(diagnosis: &Diagnosis) -> bool {
    let falls = |before: &ErrorFigure, after: &ErrorFigure| after.norm.value < SHOWN * before.norm.value;
    let BeforeAfter { before, after } = &diagnosis.error;
    let held_out = before.held_out.as_ref().zip(after.held_out.as_ref());
    diagnosis.verdict.names_effects()
        && falls(&before.train, &after.train)
        && held_out.is_some_and(|(before, after)| !falls(before, after))
}

fn next_sentence(next: &NextMeasurement) -> String {
    if next.words.is_empty() {
        let lines: Vec<String> = next.rows.iter().map(|row| row.line.to_string()).collect();
        return format!(
            "Measure next: repeat the conditions of lines {} to distinguish {}.",
            lines.join(", "),
            next.distinguishes
        );
    }
    let conditions = next.conditions.as_ref().map_or(String::new(), |conditions| format!(" {conditions}"));
    format!(
        "Measure next{conditions}, in this order: {}. This distinguishes {}.",
        next.words.join(" "),
        next.distinguishes
    )
}

fn outlier_sentence(diagnosis: &Diagnosis) -> Option<String> {
    let n = diagnosis.outliers.len();
    let lines: Vec<String> = diagnosis.outliers.iter().take(MAX_LINES).map(|row| row.line.to_string()).collect();
    let more = if n > MAX_LINES { ", …" } else { "" };
    let why = match diagnosis.kind.is_of_tool() && are_too_many(n, diagnosis.rows.train) {
        true => " They are not isolated outliers: an effect acts now and then, or the log is wrong in these rows.",
        false => "",
    };
    (n > 0).then(|| format!("{n} outliers, with little weight: lines {}{more}.{why}", lines.join(", ")))
}

/// What fitted terms would gain.
fn terms_sentence(arm: &Arm, diagnosis: &Diagnosis, with_terms: &WithTerms) -> String {
    let terms = with_terms.effects.iter().filter_map(|effect| match effect {
        Effect::FittedTerm(term) => Some(term_name(arm, term)),
        _ => None,
    });
    format!(
        "Fitted terms ({}) would lower the held-out error from {:.2} to {:.2} mm; they do not extrapolate. \
         --keep-terms writes them.",
        terms.collect::<Vec<_>>().join("; "),
        diagnosis.error.after.held_out_or_train().norm.value * 1e3,
        with_terms.held_out_m * 1e3
    )
}

fn effect_of_signals(effect: &outcome::Effect) -> String {
    let values: Vec<String> = effect.values.iter().map(named).collect();
    let gain = match &effect.held_out_gain {
        Some(gain) if gain.value > 0.0 => {
            let (gain, unit) = readable(gain);
            format!("; removing it raises the held-out error by {} {unit}", short(gain))
        }
        _ => String::new(),
    };
    format!("{} at {}: {}{gain}.", effect.law, effect.site, values.join(", "))
}

/// The sentence with its first letter large.
fn capitalised(sentence: &str) -> String {
    let mut letters = sentence.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}

/// One effect: which part, which way, how much.
pub fn effect_sentence(arm: &Arm, effect: &Effect<f64>) -> String {
    let place = place_name(arm, effect);
    let is_planar = arm.model.chain.is_planar();
    match *effect {
        Effect::StrokeLoss { state, loss_m, .. } => {
            let (way, short_mm) = (longer(-loss_m), loss_m.abs() * 1e3);
            format!("{place}: in state {state} it is {short_mm:.2} mm {way} than its stop sets it.")
        }
        Effect::AnchorOffset { plate, offset, .. } => {
            let plate = match plate {
                Plate::Base => "lower",
                Plate::Top => "upper",
            };
            let [x, y, z] = offset.map(|shift| shift * 1e3);
            let depth = if is_planar { String::new() } else { format!(", {z:+.2} mm in z") };
            format!(
                "{place}: its anchor on the {plate} plate sits {x:+.2} mm in x, {y:+.2} mm in y{depth} from its place."
            )
        }
        Effect::GravitySag { compliance_m_per_n, .. } => {
            format!("{place}: the legs deflect by {:.3} mm per 100 N of load.", compliance_m_per_n * 1e5)
        }
        Effect::Play { width_m, .. } => {
            format!("{place}: an actuator that was not moved is offset {:.2} mm from its stop.", width_m * 1e3)
        }
        Effect::SupplyStroke { gain, .. } => {
            let way = if gain > 0.0 { "shorter" } else { "longer" };
            format!("{place}: the stroke is {:.2} % {way} per 10 % drop in supply.", gain.abs() * 10.0)
        }
        Effect::ThermalGrowth { expansion_per_k, .. } => {
            format!("{place}: the legs grow by {:.1} µm per metre and kelvin.", expansion_per_k * 1e6)
        }
        Effect::Step { since_s, shift_m, .. } => {
            let way = longer(shift_m);
            format!("{place}: since {since_s:.1} s after the start it is {:.2} mm {way}.", shift_m.abs() * 1e3)
        }
        Effect::LengthOffset { offset_m, .. } => {
            let way = longer(offset_m);
            format!("{place}: it is {:.2} mm {way} in every state than its stops set it.", offset_m.abs() * 1e3)
        }
        Effect::Interaction { other, shift_m, .. } => {
            let (way, other) = (longer(shift_m), arm.actuator_name(other.into()));
            format!("{place}: while {other} is extended too, it is {:.2} mm {way}.", shift_m.abs() * 1e3)
        }
        Effect::Creep { values, .. } => {
            let [fast_mm, slow_mm] = values.map(|size| size * 1e3);
            format!(
                "{place}: an actuator that stays in its state creeps {fast_mm:+.2} mm onto its stop within a second, and \
                 {slow_mm:+.2} mm within ten seconds."
            )
        }
        Effect::Drift { values: [rate, change], .. } => {
            let [rate, change] = [rate * 6e4, change * 3.6e6];
            let then = if rate * change < 0.0 { "less" } else { "more" };
            format!(
                "{place}: it creeps {:.2} mm {} in the first minute, and {:.2} mm {then} in each minute after.",
                (rate + 0.5 * change).abs(),
                longer(rate + 0.5 * change),
                change.abs()
            )
        }
        Effect::Wear { per_switch_m, .. } => {
            let way = if per_switch_m > 0.0 { "farther" } else { "less far" };
            format!("{place}: its stops let it {:.2} mm {way} per 100 switches.", per_switch_m.abs() * 1e5)
        }
        Effect::Crowding { values: [short, by_supply], .. } => {
            let [short_mm, more_mm] = [short * 1e3, by_supply * -1e2];
            format!(
                "{place}: an actuator stays {short_mm:.2} mm short per other actuator of its module that switches with it, \
                 and {more_mm:.2} mm more per 10 % drop in supply."
            )
        }
        Effect::FrameOffset { values, .. } => frame_sentence(&place, &values, is_planar),
        Effect::Scale { stretch } => {
            let way = if stretch > 0.0 { "over-reads" } else { "under-reads" };
            format!("{place}: it {way} length by {:.3} %.", stretch.abs() * 100.0)
        }
        Effect::BaseDrift { values, .. } => base_drift_sentence(&place, &values, is_planar),
        Effect::BaseStep { since_s, values } => {
            format!("Since {since_s:.1} s after the start {}", frame_sentence(&place, &values, is_planar))
        }
        Effect::FittedTerm(term) => {
            format!("{place}: its error depends on {}, which no law explains (fitted term).", term_name(arm, &term))
        }
        Effect::JointOffset { offset_rad, .. } => {
            let offset_deg = offset_rad.to_degrees();
            format!("{place}: its joint is offset {offset_deg:+.3}° from the angle that the servo reports.")
        }
    }
}

fn base_drift_sentence(place: &str, values: &[f64; 6], planar: bool) -> String {
    let [turn_x, turn_y, turn_z, x, y, z] = values.map(|rate| 60.0 * rate);
    let [turn_x, turn_y, turn_z] = [turn_x, turn_y, turn_z].map(f64::to_degrees);
    let [x, y, z] = [x, y, z].map(|way| 1e3 * way);
    let (out, about) = match planar {
        true => (String::new(), format!("{turn_z:+.4}°")),
        false => (format!(", {z:+.3} mm in z"), format!("{turn_x:+.4}°, {turn_y:+.4}° and {turn_z:+.4}°")),
    };
    format!(
        "{place}, as the camera sees it, moves by {x:+.3} mm in x, {y:+.3} mm in y{out} and turns by {about} each minute: \
         fasten the camera."
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
