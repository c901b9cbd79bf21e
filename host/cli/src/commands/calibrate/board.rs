//! The arm on its board, seen by a camera: plays the visits of a look and measures them.

use std::path::Path;

use darm_arm::board_profile::BoardProfile;
use darm_arm::image::UploadImage;
use darm_arm::plan::Visit;
use darm_arm::table_file::TableFile;
use darm_arm::wired_arm::WiredArm;
use darm_device::client::Client;
use darm_diagnose::calibrate::Station;
use darm_diagnose::measurement_plan::PlanStep;
use darm_measure::Sample;
use darm_measure::visit_table::{PlannedVisit, VisitTable};

use super::CalibrateError;
use super::folder::Folder;
use crate::commands::record::Measurement;
use crate::failure::Occupied;
use crate::guests::Role;
use crate::interrupt::InterruptHandler;
use crate::port::{self, PortArgs, emulated_camera};
use crate::ui::Ui;

/// A board and a camera.
pub(super) struct Board<'a> {
    pub(super) wired: &'a WiredArm,
    /// The camera as the user named it; `None`: that of the simulator.
    pub(super) source: Option<String>,
    pub(super) dwell_s: f64,
    pub(super) folder: &'a Folder,
    pub(super) port: &'a PortArgs,
    pub(super) ui: Ui,
    /// Stops the arm at Ctrl-C, from the first connection on.
    pub(super) interrupt: Option<InterruptHandler>,
    /// What the progress says.
    pub(super) doing: String,
}

impl Board<'_> {
    /// The profile of the board.
    pub(super) fn profile(&self) -> &BoardProfile {
        &self.wired.profile
    }

    /// Says which look is next, counted from 0.
    pub(super) fn begin(&mut self, look: usize, looks: usize) {
        self.doing = format!("look {} of at most {looks}", look + 1);
    }

    /// Uploads a table; its digest.
    pub(super) fn upload(&self, table: &Path) -> anyhow::Result<String> {
        let table = TableFile::read(table)?;
        let mut client = self.port.connect()?;
        self.send(&mut client, &table.image)?;
        Ok(table.digest().to_string())
    }

    /// Uploads a table that the board does not have yet.
    fn send(&self, client: &mut Client, image: &UploadImage) -> anyhow::Result<()> {
        if client.hello().and_then(|hello| hello.table) == Some(image.image().digest) {
            return Ok(());
        }
        let bar = self.ui.progress_bar(&format!("{}: uploading", self.doing), u64::from(image.image().len), "bytes");
        let uploaded = client.upload(image, &mut |progress| bar.set_position(u64::from(progress.done)));
        uploaded.map_err(|error| Occupied::explain(client, error))?;
        bar.finish_and_clear();
        Ok(())
    }

    /// Connects, and has Ctrl-C stop this board from now on.
    fn connect(&mut self) -> anyhow::Result<(Client, InterruptHandler)> {
        let port = self.port.name()?;
        let (client, handle) = port::connect(&port, Role::Controls)?;
        let interrupt = match self.interrupt.take() {
            Some(interrupt) => {
                interrupt.use_handle(handle);
                interrupt
            }
            None => InterruptHandler::start(&port, handle)?,
        };
        interrupt.report_next("; repeat the command to continue");
        self.interrupt = Some(interrupt.clone());
        Ok((client, interrupt))
    }
}

impl Station for Board<'_> {
    type Error = anyhow::Error;

    fn measure(&mut self, steps: &[PlanStep]) -> anyhow::Result<Vec<Sample>> {
        let camera = camera(self.source.as_deref())?;
        let (mut client, interrupt) = self.connect()?;
        let WiredArm { arm, profile, .. } = self.wired;
        let table = VisitTable { arm, profile, device: None, modules: &[], may_rest: true };
        let (plan, visits) = table.of(&planned(steps, self.dwell_s))?;
        self.send(&mut client, &plan.image)?;
        let (n, end_s) = (visits.rests.len(), plan.end.0 as f64 * 1e-6);
        self.ui.note(&format!("{}: {n} visits in {end_s:.0} s", self.doing));
        let bar = self.ui.progress_bar(&self.doing, n as u64, "visits");
        let output = self.folder.file("measuring.csv");
        let measurement = Measurement { visits: &visits, camera: &camera, output: &output, ui: self.ui };
        let measured = measurement.run(client, &interrupt, |visit| bar.set_position(visit as u64));
        bar.finish_and_clear();
        let samples = measured?;
        // The look's own file takes its place.
        let _ = std::fs::remove_file(&output);
        Ok(samples)
    }
}

/// Steps as the visits of a table.
fn planned(steps: &[PlanStep], dwell_s: f64) -> Vec<PlannedVisit> {
    steps.iter().enumerate().map(|(number, step)| visit(number, step, dwell_s)).collect()
}

fn visit(number: usize, step: &PlanStep, dwell_s: f64) -> PlannedVisit {
    let (word, servos_rad, label) = (step.word, step.servos_rad.clone(), format!("visit {number}"));
    PlannedVisit { visit: Visit { word, servos_rad, dwell_s, label }, held_out: step.held_out }
}

/// The source of poses: the one that was named, or the camera of the simulator.
fn camera(source: Option<&str>) -> Result<String, CalibrateError> {
    source.map(str::to_owned).or_else(emulated_camera).ok_or(CalibrateError::NoSimulator)
}
