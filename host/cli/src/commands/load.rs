//! `darm load`: what each actuator bears under gravity and a payload, and what the arm carries.

use std::path::PathBuf;

use darm_arm::arm::Arm;
use darm_arm::load::capacity::{Capacity, Usage, gives, usage, worst};
use darm_arm::load::{Laden, Load as ActuatorLoad, LoadRange};
use darm_core::units::Word;
use serde::Serialize;

use super::path::word;
use super::servos::ServoArgs;
use crate::failure;
use crate::ui::{Answer, Ui, columns, number, six_digits};

const EXAMPLES: &str = "\
Examples:
  darm load pneumatic9.toml                               # what it carries at its supply
  darm load pneumatic9.toml --payload 2 --supply 5        # loads with 2 kg, at 5 bar
  darm load pneumatic9.toml --payload 2 --word 010110011  # in one word
  darm --json load spatial6.toml --payload 2              # over 64^6 words

Statics of the arm at rest in its geometry: without effects, friction and inertia, and with the masses of the arm file. Loads \
are those of the worst of all words, exact to 1e-6; words that cannot be assembled are left out. What an actuator gives is \
`cylinder`, `force` or `torque_nm` in the arm file. It pushes against compression unless it is in its first state, and pulls \
against tension unless it is in its last one: there a mechanical stop bears the load.";

/// Heaviest payload that can be given, kg.
const MAX_PAYLOAD_KG: f64 = 1e6;
const BAR_PA: f64 = 1e5;

/// Compute the largest load of each actuator over all words, and the payload that the arm carries
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Load {
    /// The arm
    #[arg(value_name = "ARM.toml")]
    arm: PathBuf,
    /// Mass that the tool carries in addition to `mass_kg` of the arm file, at the same centre, in kg
    #[arg(long, value_name = "KG", default_value_t = 0.0, allow_negative_numbers = true)]
    payload: f64,
    /// Loads in this word only
    #[arg(long, value_name = "WORD")]
    word: Option<String>,
    /// Supply pressure in bar [default: `working_supply_bar` of the arm file]
    #[arg(long, value_name = "BAR")]
    supply: Option<f64>,
    #[command(flatten)]
    servos: ServoArgs,
}

/// A force, or a torque of a revolute joint.
#[derive(Clone, Copy, Serialize)]
#[serde(untagged)]
enum Amount {
    Force { force_n: f64 },
    Torque { torque_nm: f64 },
}

impl Amount {
    /// The load of an actuator.
    fn of(arm: &Arm, actuator: usize, value: f64) -> Self {
        if arm.turns(actuator) { Self::Torque { torque_nm: value } } else { Self::Force { force_n: value } }
    }

    fn value(self) -> f64 {
        match self {
            Self::Force { force_n: value } | Self::Torque { torque_nm: value } => value,
        }
    }

    /// What the actuator does against the load.
    fn direction(self) -> &'static str {
        match self {
            Self::Force { force_n } if force_n < 0.0 => "pulling",
            Self::Force { .. } => "pushing",
            Self::Torque { torque_nm } if torque_nm < 0.0 => "turning down",
            Self::Torque { .. } => "turning up",
        }
    }

    fn unit(self) -> &'static str {
        match self {
            Self::Force { .. } => "N",
            Self::Torque { .. } => "N m",
        }
    }
}

/// The actuator that is used the most.
#[derive(Serialize)]
struct WorstReport {
    actuator: usize,
    name: String,
    word: String,
    load: Amount,
    gives: Amount,
    share: f64,
}

#[derive(Serialize)]
struct WordReport {
    payload_kg: f64,
    supply_pa: f64,
    word: String,
    worst: Option<WorstReport>,
    actuators: Vec<WordLine>,
}

#[derive(Serialize)]
struct WordLine {
    actuator: usize,
    name: String,
    state: u8,
    /// Positive in compression, or where the joint drives its angle up.
    load: Amount,
    /// What the actuator gives against the load; `None` where a stop bears it or the arm file does not say it.
    gives: Option<Amount>,
    is_on_stop: bool,
}

#[derive(Serialize)]
struct LoadReport {
    payload_kg: f64,
    supply_pa: f64,
    /// Largest payload in addition to the tool; `None` where the actuators bear any, or the arm file does not say what they give.
    carries_kg: Option<f64>,
    is_unlimited: bool,
    at_capacity: Option<WorstReport>,
    worst: Option<WorstReport>,
    actuators: Vec<RangeLine>,
}

/// The largest loads of an actuator over all words, all above zero.
#[derive(Serialize)]
struct RangeLine {
    actuator: usize,
    name: String,
    /// Against which the actuator has to push and to pull.
    push: Option<Extreme>,
    pull: Option<Extreme>,
    /// That presses it on its first or last stop.
    on_stop: Option<Extreme>,
    gives_push: Option<Amount>,
    gives_pull: Option<Amount>,
}

#[derive(Clone, Serialize)]
struct Extreme {
    #[serde(flatten)]
    load: Amount,
    word: String,
}

impl Load {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        let mut arm = Arm::read(&self.arm)?;
        if !(0.0..=MAX_PAYLOAD_KG).contains(&self.payload) {
            let text = format!("--payload {}: give a mass of 0 to {MAX_PAYLOAD_KG} kg", self.payload);
            return Err(failure::Usage(text).into());
        }
        if let Some(bar) = self.supply {
            if !(1e-3..=1e3).contains(&bar) {
                return Err(failure::Usage(format!("--supply {bar}: give a pressure of 0.001 to 1000 bar")).into());
            }
            arm.model.working_supply = bar * BAR_PA;
        }
        let laden = Laden { arm: &arm, servos_rad: self.servos.rad(&arm)?, payload_kg: self.payload };
        match &self.word {
            Some(text) => ui.print(&word_report(&laden, word(&arm, text)?)?),
            None => {
                let spinner = ui.spinner("searching for the worst words");
                let report = load_report(&laden);
                spinner.finish_and_clear();
                ui.print(&report?)
            }
        }
    }
}

fn worst_report(arm: &Arm, usage: &Usage) -> WorstReport {
    let Usage { actuator, load, gives } = *usage;
    WorstReport {
        actuator,
        name: arm.actuator_name(actuator),
        word: load.word.to_string(),
        load: Amount::of(arm, actuator, load.force),
        gives: Amount::of(arm, actuator, gives),
        share: usage.share(),
    }
}

fn word_report(laden: &Laden<'_>, word: Word) -> anyhow::Result<WordReport> {
    let arm = laden.arm;
    let loads = laden.loads(&word)?;
    let usages: Vec<Option<Usage>> = (loads.iter().enumerate())
        .map(|(actuator, &force)| usage(arm, actuator, word.digit(actuator).into(), ActuatorLoad { force, word }))
        .collect();
    let line = |(actuator, force): (usize, f64)| WordLine {
        actuator,
        name: arm.actuator_name(actuator),
        state: word.digit(actuator),
        load: Amount::of(arm, actuator, force),
        gives: usages[actuator].map(|usage| Amount::of(arm, actuator, usage.gives)),
        is_on_stop: is_on_stop(arm, actuator, word.digit(actuator).into(), force),
    };
    let max = usages.iter().flatten().max_by(|a, b| a.share().total_cmp(&b.share()));
    Ok(WordReport {
        payload_kg: laden.payload_kg,
        supply_pa: arm.model.working_supply,
        word: word.to_string(),
        worst: max.map(|usage| worst_report(arm, usage)),
        actuators: loads.iter().copied().enumerate().map(line).collect(),
    })
}

/// Whether a load presses an actuator in a state on its stop.
fn is_on_stop(arm: &Arm, actuator: usize, state: usize, force: f64) -> bool {
    let last = arm.model.chain.n_states(actuator).saturating_sub(1);
    force > 0.0 && state == 0 || force < 0.0 && state == last
}

fn load_report(laden: &Laden<'_>) -> anyhow::Result<LoadReport> {
    let arm = laden.arm;
    let ranges = laden.ranges()?;
    let capacity = laden.capacity()?;
    let (carries_kg, at_capacity) = match &capacity {
        Some(Capacity::UpTo { payload_kg, worst }) => (Some(*payload_kg), Some(worst)),
        Some(Capacity::Overloaded(worst)) => (Some(0.0), Some(worst)),
        Some(Capacity::Unlimited) | None => (None, None),
    };
    Ok(LoadReport {
        payload_kg: laden.payload_kg,
        supply_pa: arm.model.working_supply,
        carries_kg,
        is_unlimited: matches!(capacity, Some(Capacity::Unlimited)),
        at_capacity: at_capacity.map(|worst| worst_report(arm, worst)),
        worst: worst(arm, &ranges).map(|worst| worst_report(arm, &worst)),
        actuators: ranges.iter().enumerate().map(|(actuator, states)| range_line(arm, actuator, states)).collect(),
    })
}

fn range_line(arm: &Arm, actuator: usize, states: &[Option<LoadRange>]) -> RangeLine {
    let loads: Vec<(usize, ActuatorLoad)> = (states.iter().enumerate())
        .filter_map(|(state, range)| range.map(|range| (state, range)))
        .flat_map(|(state, range)| [(state, range.smallest), (state, range.largest)])
        .collect();
    let largest = |is_meant: &dyn Fn(usize, f64) -> bool| {
        let meant = loads.iter().filter(|(state, load)| is_meant(*state, load.force));
        let largest = meant.max_by(|a, b| a.1.force.abs().total_cmp(&b.1.force.abs()));
        largest
            .map(|(_, load)| Extreme { load: Amount::of(arm, actuator, load.force.abs()), word: load.word.to_string() })
    };
    let on_stop = |state, force| is_on_stop(arm, actuator, state, force);
    let [gives_push, gives_pull] =
        [0, 1].map(|side| gives(arm, actuator).map(|gives| Amount::of(arm, actuator, gives[side])));
    RangeLine {
        actuator,
        name: arm.actuator_name(actuator),
        push: largest(&|state, force| force > 0.0 && !on_stop(state, force)),
        pull: largest(&|state, force| force < 0.0 && !on_stop(state, force)),
        on_stop: largest(&on_stop),
        gives_push,
        gives_pull,
    }
}

impl WorstReport {
    fn text(&self) -> String {
        let (load, gives) = (self.load.value().abs(), self.gives.value());
        format!(
            "actuator {} ({}) in the word {}: {} of {} {}, {}",
            self.actuator,
            self.name,
            self.word,
            number(load, 1),
            number(gives, 1),
            self.gives.unit(),
            self.load.direction()
        )
    }
}

/// What is said where the arm file has no strength of any actuator.
const NO_STRENGTH: &str = "what it carries is not computed: the arm file does not say what the actuators give; add `cylinder`, \
                           `force` or `torque_nm` to them";

impl LoadReport {
    /// What the arm carries, in a sentence.
    fn capacity(&self) -> String {
        let supply = six_digits(self.supply_pa / BAR_PA);
        match (&self.at_capacity, self.carries_kg) {
            (Some(worst), Some(0.0)) => {
                format!("does not carry itself at {supply} bar; worst: {}", worst.text())
            }
            (Some(worst), Some(kg)) => {
                format!("carries {} kg in addition to the tool at {supply} bar; worst: {}", number(kg, 2), worst.text())
            }
            _ if self.is_unlimited => "any payload rests on stops: no actuator has to hold it".to_owned(),
            _ => NO_STRENGTH.to_owned(),
        }
    }

    fn table(&self) -> String {
        let given = |gives: &Option<Amount>| gives.map_or("-".to_owned(), |gives| number(gives.value(), 1));
        let extreme = |of: &Option<Extreme>| of.as_ref().map_or("-".to_owned(), |of| number(of.load.value(), 1));
        let head = ["actuator", "", "push", "of", "pull", "of", "on stop", "", "word of the largest push or pull"];
        let mut rows = vec![head.map(str::to_owned).to_vec()];
        rows.extend(self.actuators.iter().map(|line| {
            let value = |of: &Option<Extreme>| of.as_ref().map_or(0.0, |of| of.load.value());
            let larger = if value(&line.push) >= value(&line.pull) { &line.push } else { &line.pull };
            let unit = [&line.push, &line.pull, &line.on_stop].into_iter().flatten().next();
            vec![
                line.actuator.to_string(),
                line.name.clone(),
                extreme(&line.push),
                given(&line.gives_push),
                extreme(&line.pull),
                given(&line.gives_pull),
                extreme(&line.on_stop),
                unit.map_or("", |unit| unit.load.unit()).to_owned(),
                larger.as_ref().map_or(String::new(), |larger| larger.word.clone()),
            ]
        }));
        columns(&rows)
    }
}

impl Answer for LoadReport {
    fn text(&self) -> String {
        let with = |worst: &WorstReport| {
            format!("with {} kg the most loaded is {}\n", six_digits(self.payload_kg), worst.text())
        };
        let worst = self.worst.as_ref().map_or(String::new(), with);
        let payload = six_digits(self.payload_kg);
        format!(
            "{}\n{worst}\nlargest loads with {payload} kg in addition to the tool, over all words\n\n{}",
            self.capacity(),
            self.table()
        )
    }
}

impl Answer for WordReport {
    fn text(&self) -> String {
        let mut rows = vec![["actuator", "", "state", "load", "", "borne by"].map(str::to_owned).to_vec()];
        rows.extend(self.actuators.iter().map(|line| {
            let borne_by = match line.gives {
                Some(gives) => {
                    format!("{}, with up to {} {}", line.load.direction(), number(gives.value(), 1), gives.unit())
                }
                None if line.is_on_stop => "its stop".to_owned(),
                None => line.load.direction().to_owned(),
            };
            let load = line.load;
            vec![
                line.actuator.to_string(),
                line.name.clone(),
                line.state.to_string(),
                number(load.value(), 1),
                load.unit().to_owned(),
                borne_by,
            ]
        }));
        let worst = self.worst.as_ref().map(|worst| format!("the most loaded is {}\n\n", worst.text()));
        format!(
            "{}{}\n\nwith {} kg in addition to the tool; a load above zero is compression, or turns a joint down",
            worst.unwrap_or_default(),
            columns(&rows),
            six_digits(self.payload_kg)
        )
    }
}
