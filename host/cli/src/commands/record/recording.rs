//! A running recording: follows the program, joins its visits with camera measurements, writes rows.

use std::collections::VecDeque;

use darm_core::output::ActuatorWiring;
use darm_core::sequencer::Event;
use darm_device::client::stop::Confirmation;
use darm_device::client::{Client, TimedEvent};
use darm_device::strokes::{SentRow, stroke_times};
use darm_measure::Sample;

use super::join::{Span, join};
use super::output::Output;
use super::program::{POLL, Program};
use super::source::{CAMERA_DELAY_S, Camera, CameraError};
use super::visit_tracker::VisitTracker;
use crate::commands::camera_lines::{unix_less_host_s, unix_now_s};
use crate::commands::play::End;
use crate::commands::status::seconds;
use crate::failure::LostCamera;
use darm_measure::visits::Visits;

/// A running recording.
pub(crate) struct Recording<'a> {
    pub(crate) tracker: VisitTracker<'a>,
    pub(crate) program: Program,
    pub(crate) camera: Camera,
    pub(crate) output: Output,
    /// Number of the run in the file.
    pub(crate) run: u32,
    /// Visits that have ended and wait for their camera measurements.
    waiting: VecDeque<(usize, Span)>,
    /// The camera is a file, and visits from before this process are joined at the end, when the clock is known best.
    at_end: bool,
    begun: bool,
    /// Actuators of the table, and the rows that were switched.
    actuators: Vec<ActuatorWiring>,
    rows: Vec<SentRow>,
    /// Why no more measurements arrive.
    camera_error: Option<CameraError>,
    /// That the camera ended within the program.
    pub(crate) lost_camera: Option<LostCamera>,
    /// The arm is stopped then.
    stops_without_camera: bool,
}

impl<'a> Recording<'a> {
    /// A recording of a program that starts now, or started at the tracker's start.
    pub(crate) fn new(tracker: VisitTracker<'a>, program: Program, camera: Camera, output: Output, run: u32) -> Self {
        let resumed = tracker.start_s.is_some();
        let at_end = resumed && camera.is_file();
        let waiting = VecDeque::new();
        Self {
            tracker,
            program,
            camera,
            output,
            run,
            waiting,
            at_end,
            begun: resumed,
            actuators: Vec::new(),
            rows: Vec::new(),
            camera_error: None,
            lost_camera: None,
            stops_without_camera: false,
        }
    }

    /// The same, which stops the arm where the camera ends.
    pub(crate) fn stopping_without_camera(self) -> Self {
        Self { stops_without_camera: true, ..self }
    }

    /// The same with the times of the strokes of these actuators.
    pub(crate) fn with_strokes(self, actuators: &[ActuatorWiring]) -> Self {
        Self { actuators: actuators.to_vec(), ..self }
    }

    /// Follows the program to its end, or until the user has interrupted it, and writes each visit when its measurements
    /// have arrived. At the end all visits that have ended are written.
    pub(crate) fn until_the_end(&mut self, mut on_visit: impl FnMut(usize)) -> anyhow::Result<End> {
        let end = loop {
            std::thread::sleep(POLL);
            let interrupted = self.program.interrupt.interrupted().is_some();
            let polled = self.poll();
            on_visit(self.tracker.next);
            let polled = polled.and_then(|()| self.look_at_camera());
            match (polled, self.program.monitor.end) {
                (Ok(()), Some(end)) => break Ok(end),
                _ if interrupted => break Ok(End::Stopped),
                (Ok(()), None) => {}
                (Err(error), _) => break Err(error),
            }
        };
        self.at_end = false;
        self.collect();
        let camera = self.camera.finish();
        self.write(true)?;
        let end = end?;
        self.camera_error.take().map_or(camera, Err)?;
        Ok(end)
    }

    /// Reports at once that the camera ended within the program, and stops the arm if so wanted.
    fn look_at_camera(&mut self) -> anyhow::Result<()> {
        let (Some(start_s), None) = (self.start_unix_s(), self.program.monitor.end) else { return Ok(()) };
        let is_lost = self.camera_error.is_some() || self.camera.has_ended(start_s);
        if self.lost_camera.is_some() || !is_lost {
            return Ok(());
        }
        if self.stops_without_camera {
            let stopped = self.program.client.stop()?;
            if stopped != Confirmation::Confirmed {
                self.program.ui.note(stopped.text());
            }
            let then = "the arm is stopped. Start it again and repeat the command: this look is measured again";
            return Err(self.lost(then).into());
        }
        if !self.camera.is_file() {
            let then = "visits after it are missing: start it again, and record into another file";
            let lost = self.lost(then);
            self.program.ui.note(&format!("{lost}. Ctrl-C stops the arm"));
            self.lost_camera = Some(lost);
        }
        Ok(())
    }

    /// When row 0 was applied, Unix time.
    fn start_unix_s(&self) -> Option<f64> {
        let (start_s, offset) = (self.tracker.start_s?, self.program.client.clock().offset()?);
        Some(start_s + offset.at_s + unix_less_host_s())
    }

    /// That the camera ended now.
    fn lost(&self, then: &'static str) -> LostCamera {
        let (visit, all) = (self.tracker.next, self.tracker.visits.rests.len());
        LostCamera { camera: self.camera.name().to_owned(), visit, all, then }
    }

    fn poll(&mut self) -> anyhow::Result<()> {
        if self.camera_error.is_none() {
            // The program continues, and so does the recording of earlier measurements.
            self.camera_error = self.camera.poll().err();
        }
        if let Some(events) = self.program.poll()? {
            let monitor = &self.program.monitor;
            self.rows.extend(events.iter().filter_map(sent_row));
            self.tracker.update(&events, monitor.end.and(monitor.ended_s));
            self.begin()?;
            self.collect();
        }
        self.write(false)
    }

    /// Writes the comment lines once the program's start is known.
    fn begin(&mut self) -> anyhow::Result<()> {
        let (false, Some(start_s)) = (self.begun, self.tracker.start_s) else { return Ok(()) };
        self.begun = true;
        let client = &self.program.client;
        let about = format!(
            "{}{}# program_start_s {start_s:.6}\n{}",
            table_lines(self.tracker.visits),
            board_lines(client),
            clock_lines(client)
        );
        self.output.begin(&about)
    }

    /// Collects the visits that have ended.
    fn collect(&mut self) {
        if !self.at_end {
            let client = &self.program.client;
            self.waiting.extend(self.tracker.over(client.clock(), client.now_s()));
        }
    }

    /// Writes the visits whose measurements have arrived; all of them at the `end`.
    fn write(&mut self, end: bool) -> anyhow::Result<()> {
        while let Some(&(visit, span)) = self.waiting.front() {
            let seen = self.camera.pictures().last().is_some_and(|picture| picture.time_s >= span.to_s);
            let late = !self.camera.is_file() && unix_now_s() > span.to_s + CAMERA_DELAY_S;
            if !(end || seen || late) {
                break;
            }
            self.waiting.pop_front();
            if let Some(sample) = self.sample(visit, &span) {
                let planar = self.camera.is_planar().unwrap_or(sample.pose.is_planar());
                self.output.row(sample, planar)?;
            }
            self.camera.forget_before(span.to_s);
        }
        Ok(())
    }

    fn sample(&self, visit: usize, span: &Span) -> Option<Sample> {
        let (rest, start_s) = (self.tracker.visits.rests.get(visit)?, self.tracker.start_s?);
        let sample = join(rest, visit, span, self.camera.pictures())?;
        let strokes_s = self.strokes_s(visit);
        Some(Sample { run: self.run, time_s: start_s + sample.time_s, strokes_s, ..sample })
    }

    /// The stroke of each actuator on its way to a visit; empty where the firmware does not say when inputs changed.
    fn strokes_s(&self, visit: usize) -> Vec<Option<f64>> {
        let (Some(inputs), rests) = (&self.program.inputs, &self.tracker.visits.rests) else { return Vec::new() };
        let before = visit.checked_sub(1).and_then(|before| rests.get(before)).map_or(0, |rest| rest.row);
        let last = rests.get(visit).map_or(0, |rest| rest.row);
        let mut strokes_s = vec![None; self.actuators.len()];
        for stroke in stroke_times(&self.actuators, &self.rows, inputs) {
            if before < stroke.row && stroke.row <= last {
                strokes_s[stroke.actuator] = Some(seconds(stroke.time));
            }
        }
        strokes_s
    }

    /// The visits that have ended without a row.
    pub(crate) fn not_recovered(&self) -> Vec<usize> {
        let samples = self.output.samples.iter().filter(|sample| sample.run == self.run);
        let recorded: Vec<usize> = samples.map(|sample| sample.visit as usize).collect();
        (0..self.tracker.next).filter(|visit| !recorded.contains(visit)).collect()
    }
}

/// The row of an event.
fn sent_row(timed: &TimedEvent) -> Option<SentRow> {
    match timed.event {
        Event::Row { row, word } => Some(SentRow { row, at: timed.at, word }),
        _ => None,
    }
}

/// Which table was played, as comment lines.
fn table_lines(visits: &Visits) -> String {
    let Visits { model, geometry, table, .. } = visits;
    format!("# model {model}\n# geometry {geometry}\n# table {table}\n")
}

/// Which board played it, as comment lines.
fn board_lines(client: &Client) -> String {
    let device = client.identity().device;
    let hello = client.hello().map(|hello| format!("# profile {}\n# boot {}\n", hello.profile, hello.boots));
    format!("# board {device}\n{}", hello.unwrap_or_default())
}

/// Estimate of the board's clock, as comment lines.
pub(crate) fn clock_lines(client: &Client) -> String {
    let rate = client.clock().rate();
    let offset = client.clock().offset().map_or(String::new(), |offset| {
        format!("# clock_offset_s {:.6}\n# clock_uncertainty_s {:.6}\n", offset.at_s, offset.uncertainty_s)
    });
    format!(
        "{offset}# clock_rate_error_ppm {:.1}\n# clock_rate_uncertainty_ppm {:.1}\n# clock_lost_s {:.6}\n",
        1e6 * rate.error,
        1e6 * rate.uncertainty,
        client.clock().lost_s()
    )
}
