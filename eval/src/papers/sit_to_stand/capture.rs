//! A demonstration as the table that `darm com map` reads.

use darm_core::real::Vec3;
use darm_measure::csv_text::csv_text;
use darm_papers::motion::demonstration::Demonstration;

/// A capture as `darm com map` reads it, with the plates of floor and chair, and of arm rests where hands push: Fz, Mx, My
/// of each frame.
pub(super) fn csv(Demonstration { capture, chair, .. }: &Demonstration, hands: Option<&[[f64; 3]]>) -> String {
    let markers = capture.names.iter().flat_map(|name| ["x", "y", "z"].map(|axis| format!("{name}_{axis}")));
    let plates = ["floor", "chair"].into_iter().chain(hands.map(|_| "hands"));
    let plates = plates.flat_map(|plate| ["Fz_n", "Mx_nm", "My_nm"].map(|part| format!("{plate}_{part}")));
    let head = std::iter::once("t_s".to_owned()).chain(markers).chain(plates);
    let mut rows = vec![head.collect::<Vec<_>>()];
    let measured = capture.chair_n.iter().flatten().zip(chair);
    for (frame, (((time, places), plate), (chair_n, [_, mx, my]))) in
        capture.time_s.iter().zip(&capture.places).zip(&capture.plates).zip(measured).enumerate()
    {
        let place = |place: &Option<Vec3<f64>>| match place {
            Some(place) => place.map(|x| format!("{x:.5}")).data.0[0].clone(),
            None => [const { String::new() }; 3],
        };
        let total = [plate.force_n, plate.cop[1] * plate.force_n, -plate.cop[0] * plate.force_n];
        let own = [*chair_n, *mx, *my];
        let pushed = hands.and_then(|hands| hands.get(frame));
        let floor = [0, 1, 2].map(|k| total[k] - own[k] - pushed.map_or(0.0, |pushed| pushed[k]));
        let cells = std::iter::once(format!("{time:.4}")).chain(places.iter().flat_map(place));
        let wrenches = floor.iter().chain(&own).chain(pushed.into_iter().flatten()).map(|x| format!("{x:.4}"));
        rows.push(cells.chain(wrenches).collect());
    }
    csv_text(rows)
}
