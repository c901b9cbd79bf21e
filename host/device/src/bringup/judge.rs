//! From strokes to findings.

use super::finding::Finding;
use super::kind::Kind;
use super::pairs::merged;
use super::response::Response;
use super::stroke::Stroke;
use super::subject::Subject;
use super::travel::travels;

/// What is wrong with an arm, as far as these strokes show it. Outputs without a stroke have no finding.
pub fn judge(subject: &Subject, strokes: &[Stroke]) -> Vec<Finding> {
    let responses: Vec<_> = strokes.iter().filter_map(|stroke| Response::new(subject, stroke)).collect();
    let mut kinds = match in_common(subject, &responses) {
        Some(common) => vec![common],
        None => merged(subject, one_by_one(subject, &responses)),
    };
    kinds.extend(slow(subject, strokes));
    kinds.into_iter().map(|kind| Finding::new(kind, subject)).collect()
}

/// What all outputs or all switches have in common: their supply.
fn in_common(subject: &Subject, responses: &[Response<'_>]) -> Option<Kind> {
    let watched: Vec<_> = responses.iter().filter(|response| response.place.expected().is_some()).collect();
    if watched.len() < 2 || !responses.iter().all(Response::is_silent) {
        return None;
    }
    let inputs = subject.switch_inputs();
    let is_open = |response: &&Response<'_>| response.stroke.samples.iter().all(|sample| sample.inputs & inputs == 0);
    let moved: Vec<_> = responses.iter().filter_map(Response::moved).collect();
    if moved.is_empty() {
        return Some(Kind::NothingResponds);
    }
    if moved.len() == responses.len() && moved.iter().all(|moved| moved.is_empty()) {
        return Some(Kind::NothingMoves);
    }
    (watched.iter().all(is_open) && moved.iter().all(|moved| !moved.is_empty())).then_some(Kind::NoSwitchCloses)
}

fn one_by_one(subject: &Subject, responses: &[Response<'_>]) -> Vec<Kind> {
    let swapped = coils_swapped(subject, responses);
    let is_of_swapped = |response: &Response<'_>| swapped.contains(&response.place.actuator);
    let others = responses.iter().filter(|response| !is_of_swapped(response)).filter_map(Response::kind);
    swapped.iter().map(|&actuator| Kind::CoilsSwapped { actuator }).chain(others).collect()
}

/// Actuators of which each coil does to the switch what the other one should.
fn coils_swapped(subject: &Subject, responses: &[Response<'_>]) -> Vec<usize> {
    let of = |actuator, bit| {
        responses.iter().find(|response| response.place.actuator == actuator && response.place.bit == bit)
    };
    let is_swapped = |actuator: &usize| {
        let Some((first, second)) = of(*actuator, 0).zip(of(*actuator, 1)) else { return false };
        let Some(switch) = first.place.switch else { return false };
        let levels = [first, second].map(|response| response.stroke.when_on() >> switch.input & 1 == 1);
        let others_move = [first, second].iter().any(|response| response.moved().is_some_and(|m| m != [*actuator]));
        switch.closed(1) != switch.closed(2) && levels == [switch.closed(2), switch.closed(1)] && !others_move
    };
    (0..subject.wiring.actuators.len()).filter(is_swapped).collect()
}

/// Actuators that were later than their time of travel for sure.
fn slow<'a>(subject: &'a Subject, strokes: &'a [Stroke]) -> impl Iterator<Item = Kind> + 'a {
    subject.wiring.actuators.iter().enumerate().filter_map(|(actuator, wiring)| {
        let own = travels(subject, strokes).into_iter().filter(|travel| travel.actuator == actuator);
        let took_ms = own.map(|travel| travel.min_us / 1000).max()?;
        (took_ms > u32::from(wiring.travel_ms)).then_some(Kind::Slow { actuator, took_ms })
    })
}
