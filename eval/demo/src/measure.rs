//! One program on the board: uploaded, played, and looked at by the camera in every visit.

use anyhow::{Context, Result, bail};
use darm_arm::arm::Arm;
use darm_arm::plan::{Visit, plan};
use darm_core::sequencer::{Command, Event};
use darm_core::units::Micros;
use darm_diagnose::truth::{TrueState, Truth};
use darm_measure::{Run, Sample};
use rand_chacha::ChaCha8Rng;

use crate::rig::Rig;
use darm_figures::progress::Progress;

/// Time between two questions to the board.
const POLL_S: f64 = 0.05;

/// One visit, and whether its measurement is kept from the fit.
#[derive(Clone, Debug)]
pub(crate) struct Stop {
    /// Where to go.
    pub(crate) visit: Visit,
    /// Kept from every fit.
    pub(crate) held_out: bool,
}

/// What was measured.
pub(crate) struct Measured {
    /// The samples.
    pub(crate) run: Run,
    /// Rows of the table that was played.
    pub(crate) table_rows: usize,
    /// When it started, on the host's clock.
    pub(crate) start_s: f64,
    /// How long it was played.
    pub(crate) time_s: f64,
}

/// Where arms are measured: the rig, the camera's noise, and who watches the progress.
pub(crate) struct Station<'r> {
    /// Board and camera.
    pub(crate) rig: &'r mut Rig,
    /// The camera's noise.
    pub(crate) rng: ChaCha8Rng,
    /// Shown meanwhile.
    pub(crate) progress: &'r Progress,
}

/// Uploads and plays the visits on the board; the camera looks at the true arm in each of them.
///
/// The samples come in the order of the visits, one for each that the camera took a picture of in time.
pub(crate) fn measure(station: &mut Station<'_>, arm: &Arm, truth: &Truth, stops: &[Stop]) -> Result<Measured> {
    let Station { rig, rng, progress } = station;
    let visits: Vec<Visit> = stops.iter().map(|stop| stop.visit.clone()).collect();
    let board = rig.profile.board(Some(rig.client.identity().device));
    let plan = plan(arm, &visits, &board, &[])?;
    let bar = progress.bar("uploading", plan.image.image().len.into());
    rig.client.upload(&plan.image, &mut |upload| bar.set_position(upload.done.into()))?;
    bar.finish_and_clear();
    let started = play(rig, plan.rows.len(), progress)?;
    let clock = rig.client.clock();
    let host_s = |at: Micros| {
        let board_s = (started + at).0 as f64 * 1e-6;
        clock.host_time(board_s).context("the board's clock is not known")
    };
    let start_s = host_s(Micros(0))?.at_s;
    let mut run = Run::default();
    for (number, (stop, window)) in stops.iter().zip(&plan.windows).enumerate() {
        let (from, to) = (host_s(window.0)?, host_s(window.1)?);
        let frame = rig.film.at_rest_between(from.at_s + from.uncertainty_s, to.at_s - to.uncertainty_s);
        let Some(frame) = frame else { continue };
        let servos_rad: Vec<f64> = frame.state.servos_rad.iter().map(|&angle| f64::from(angle)).collect();
        let state = TrueState {
            word: frame.state.reached,
            previous: Some(frame.state.previous),
            servos_rad: &servos_rad,
            time_s: frame.at_s,
            load_kg: 0.0,
            history: None,
        };
        let seen = truth.observe(&state, rng)?;
        let before = visits[..number].iter().rev().find(|before| before.word != stop.visit.word);
        run.samples.push(Sample {
            time_s: frame.at_s - start_s,
            word: stop.visit.word,
            previous: before.map(|visit| visit.word).or(Some(arm.rest())),
            servos_rad,
            pose: seen.pose,
            supply: Some(seen.supply),
            temperature_c: Some(seen.temperature_c),
            load_kg: None,
            strokes_s: Vec::new(),
            run: 0,
            visit: number as u32,
            held_out: stop.held_out,
        });
    }
    let missed = stops.len() - run.samples.len();
    if missed > 0 {
        progress.say(format!("the camera came too late in {missed} of {} visits", stops.len()));
    }
    let time_s = plan.end.0 as f64 * 1e-6;
    Ok(Measured { run, table_rows: plan.rows.len(), start_s, time_s })
}

/// Plays the loaded table to its end; when its first row went out, on the board's clock.
fn play(rig: &mut Rig, rows: usize, progress: &Progress) -> Result<Micros> {
    let mut next = rig.client.say_hello()?.next_event;
    rig.client.set_clock(20)?;
    let _ = rig.film.take();
    rig.client.command(Command::Play)?;
    let bar = progress.bar("playing", rows as u64);
    let mut started = None;
    loop {
        for timed in rig.client.events(next)? {
            next = timed.number + 1;
            match timed.event {
                Event::Started => started = Some(timed.at),
                Event::Row { row, .. } => bar.set_position(u64::from(row) + 1),
                Event::Finished => {
                    bar.finish_and_clear();
                    return started.context("the program ended before it started");
                }
                Event::Stopped => bail!("the program was stopped"),
                Event::Fault(fault) => bail!("the board latched its safe state: {fault}"),
                Event::Booted | Event::Cleared => {}
            }
        }
        rig.client.listen(POLL_S)?;
    }
}
