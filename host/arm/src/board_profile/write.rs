//! The text of a profile's file.

use std::fmt::Write as _;

use darm_core::output::{CoilLimit, Drive, ServoWiring};
use darm_core::profile::{EmergencyStop, Fallback, Output, PinTable, Profile, Servo};

use super::{BoardProfile, FORMAT};

pub(super) fn write_profile(w: &mut String, board: &BoardProfile) -> std::fmt::Result {
    let Profile { supply, emergency_stop, board: wired, sync, min_supply_mv, .. } = &board.profile;
    writeln!(w, "# Board profile: what is wired, and the limits that no table can exceed.")?;
    writeln!(w, "# Stored on the board by `darm profile write`, while its user button is held.\n")?;
    writeln!(w, "format = {FORMAT}\nname = {:?}", board.name)?;
    if let Some(table) = wired.layout.and_then(PinTable::of_layout) {
        writeln!(w, "board = {:?}", table.board)?;
    }
    if let Some(mv) = min_supply_mv {
        writeln!(w, "min_board_supply_mv = {mv}")?;
    }
    if let Some(table) = wired.layout.and_then(PinTable::of_layout).filter(|_| *sync) {
        writeln!(w, "\n[pins]\nsync = {:?}", table.sync)?;
    }
    if let Some(chips) = wired.chips {
        writeln!(w, "\n[chain]\nchips = {chips}")?;
    }
    writeln!(w, "\n[supply]\nnew_outputs = {}\nwindow_ms = {}", supply.new_coils, supply.window_ms)?;
    if let Some(EmergencyStop { input, opens }) = emergency_stop {
        writeln!(w, "\n[emergency_stop]\ninput = {input}\nopens = {opens}")?;
    }
    for (number, output) in board.profile.outputs.iter().enumerate() {
        if let Some(output) = output {
            write_output(w, number, output)?;
        }
    }
    board.profile.servos.iter().try_for_each(|servo| write_servo(w, servo))
}

fn write_output(w: &mut String, number: usize, output: &Output) -> std::fmt::Result {
    writeln!(w, "\n[[output]]\nnumber = {number}")?;
    match output.drive {
        Drive::Hold { line } => writeln!(w, "drive = \"hold\"\nline = {line}")?,
        Drive::PeakHold { pull, hold, peak_ms } => {
            writeln!(w, "drive = \"peak-hold\"\npull = {pull}\nhold = {hold}\npeak_ms = {peak_ms}")?;
        }
        Drive::Latch { set, reset, pulse_ms } => {
            writeln!(w, "drive = \"latch\"\nset = {set}\nreset = {reset}\npulse_ms = {pulse_ms}")?;
        }
    }
    let CoilLimit { max_on_ms, duty_percent, window_ms } = output.limit;
    writeln!(w, "max_on_ms = {max_on_ms}\nduty_percent = {duty_percent}\nwindow_ms = {window_ms}")?;
    output.input.map_or(Ok(()), |input| writeln!(w, "input = {input}"))
}

fn write_servo(w: &mut String, servo: &Servo) -> std::fmt::Result {
    let ServoWiring { id, min_rad, max_rad, max_speed_rad_s, max_torque, timeout_ms } = servo.limit;
    // Coarser than the steps of an f32, so that 90 degrees read are 90 degrees written.
    let degrees = |angle_rad: f32| (f64::from(angle_rad).to_degrees() * 1e4).round() / 1e4;
    writeln!(w, "\n[[servo]]\nid = {id}")?;
    writeln!(w, "min_deg = {:?}\nmax_deg = {:?}", degrees(min_rad), degrees(max_rad))?;
    writeln!(w, "max_speed_deg_s = {:?}\nmax_torque = {max_torque:?}", degrees(max_speed_rad_s))?;
    let fallback = match servo.fallback {
        Fallback::Hold => "hold",
        Fallback::Release => "release",
    };
    writeln!(w, "timeout_ms = {timeout_ms}\nfallback = {fallback:?}")
}
