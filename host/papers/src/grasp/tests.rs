//! The hand beside Pinocchio, its derivatives, both searches, the training, and files that are wrong.

use std::io::Read as _;
use std::path::{Path, PathBuf};

use darm_core::real::Vec3;
use nalgebra::SMatrix;
use proptest::prelude::{prop_assert, proptest};

use super::assembly::HandFile;
use super::bare::{Fingers, read_bare_hand};
use super::contact::{Configuration, Contact, Contacts};
use super::contacts_file::parse_contacts;
use super::file::read_hand;
use super::hand::Hand;
use super::jacobian::{COLUMNS, ROWS, jacobian, smallest_step};
use super::layout::{COORDINATES, FINGERS, JOINTS, THUMB};
use super::library::Library;
use super::paper::{self, End};
use super::solve::Settings;
use super::train::{Outcomes, Training, TrainingError};
use super::{picture, plot};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn allegro() -> HandFile {
    read_hand(&root().join("examples/allegro_hand.toml")).unwrap()
}

/// Random contacts that the hand can make, a few of them.
fn some(hand: &Hand, count: usize) -> Vec<Contacts> {
    hand.draw_many(count, 7)
}

#[test]
fn fingertips_stand_where_pinocchio_puts_them() {
    let file = std::fs::File::open(root().join("tests/data/golden/allegro_hand.json.gz")).unwrap();
    let mut text = String::new();
    flate2::read::GzDecoder::new(file).read_to_string(&mut text).unwrap();
    let golden: serde_json::Value = serde_json::from_str(&text).unwrap();
    let HandFile { hand, cross_check, .. } = allegro();
    for sample in golden["samples"].as_array().unwrap() {
        let angles = std::array::from_fn(|k| {
            let (finger, j) = (&hand.fingers[k / COORDINATES].name, k % COORDINATES);
            if j < JOINTS { sample["q"][finger][j].as_f64().unwrap() } else { 0.0 }
        });
        let placed = hand.place(&angles);
        let pose_world_palm = darm_core::se::Pose::identity();
        let (links, tips) = cross_check.place(&Configuration { pose_world_palm, angles }).unwrap();
        for (i, finger) in hand.fingers.iter().enumerate() {
            let number = |row: usize, column: usize| sample[&finger.name]["T"][row][column].as_f64().unwrap();
            let center = Vec3::from_fn(|row, _| number(row, 3));
            let rotation = SMatrix::<f64, 3, 3>::from_fn(number);
            // The URDF gives the angles of the thumb's base to ten digits.
            assert!((placed.tips[i].position - center).norm() < 1e-10 && (tips[i].position - center).norm() < 1e-10);
            assert!((placed.tips[i].rotation - rotation).amax() < 1e-9);
        }
        assert!(links.iter().zip(&placed.links).all(|(a, b)| a.distance(b, 1.0) < 1e-12));
    }
}

#[test]
fn the_jacobian_is_the_derivative_with_the_thumb_on_its_contact() {
    let hand = allegro().hand;
    let contacts = some(&hand, 1)[0];
    let angles = hand.initial_angles(0.4);
    // rᵢ along the palm's axes and nᵢ along the tip's, as they are at the middle of the difference.
    let palm = hand.on_thumb(&hand.place(&angles), &contacts, 0.3);
    let middle = hand.place(&angles);
    let rows = |k: usize, step: f64| {
        let mut moved = angles;
        let turn = if k == 0 { 0.3 + step } else { 0.3 };
        if k > 0 {
            moved[k - 1] += step;
        }
        let placed = hand.place(&moved);
        let back = palm.to(&hand.on_thumb(&placed, &contacts, turn));
        nalgebra::SVector::<f64, ROWS>::from_fn(|row, _| {
            let (i, row) = (row / 5, row % 5);
            match row {
                0..3 => (back * placed.tips[i].position)[row],
                _ => middle.tips[i].rotation.column(row - 3).dot(&(back.rotation * placed.normal(i))),
            }
        })
    };
    let exact = jacobian(&middle);
    for k in 0..COLUMNS {
        let numeric = (rows(k, 1e-6) - rows(k, -1e-6)) / 2e-6;
        assert!((numeric - exact.column(k)).amax() < 1e-8, "column {k}");
    }
}

#[test]
fn the_least_step_is_that_of_the_truncated_pseudo_inverse_of_the_papers_jacobian() {
    let hand = allegro().hand;
    for contacts in some(&hand, 20) {
        let placed = hand.place(&hand.initial_angles(0.5));
        let palm = hand.on_thumb(&placed, &contacts, 0.0);
        let wanted = contacts.map(|contact| contact.seen_from(&palm));
        let short = jacobian(&placed);
        let (mut whole, mut change) = (SMatrix::<f64, 18, COLUMNS>::zeros(), nalgebra::SVector::<f64, 18>::zeros());
        for (i, wanted) in wanted.iter().enumerate().take(THUMB) {
            let rho = hand.fingers[i].tip_radius_m;
            let moved = short.fixed_view::<3, COLUMNS>(5 * i, 0).into_owned();
            let turned = placed.tips[i].rotation.fixed_columns::<2>(0) * short.fixed_view::<2, COLUMNS>(5 * i + 3, 0);
            whole.fixed_view_mut::<3, COLUMNS>(6 * i, 0).copy_from(&(moved + turned * rho));
            whole.fixed_view_mut::<3, COLUMNS>(6 * i + 3, 0).copy_from(&moved);
            let (r, r_wanted) = (placed.tips[i].position, wanted.center(rho));
            change.fixed_rows_mut::<3>(6 * i).copy_from(&(wanted.point - r - placed.normal(i) * rho));
            change.fixed_rows_mut::<3>(6 * i + 3).copy_from(&(r_wanted - r));
        }
        let svd = whole.svd(true, true);
        assert!(svd.singular_values.iter().filter(|value| **value > 1e-9).count() == ROWS);
        let expected = svd.solve(&change, 1e-9).unwrap();
        assert!((smallest_step(&short, &hand.paper_rows(&placed, &wanted)) - expected).amax() < 1e-9);
    }
}

#[test]
fn a_jacobian_without_rank_gives_a_step_that_is_finite() {
    let step = smallest_step(&super::jacobian::Jacobian::zeros(), &super::jacobian::Rows::repeat(1.0));
    assert_eq!(step.amax(), 0.0);
}

#[test]
fn the_initial_configuration_keeps_the_thumb_and_faces_the_others() {
    let hand = allegro().hand;
    for contacts in some(&hand, 20) {
        let start = hand.initial_configuration(0.61, &contacts);
        let errors = hand.errors(&start, &contacts);
        assert!(errors[THUMB].point_m < 1e-12 && errors[THUMB].center_m < 1e-12);
        let reached = hand.contacts(&hand.place(&start.angles)).map(|c| c.seen_from(&start.pose_world_palm.inverse()));
        let across = |contacts: &Contacts| {
            let wide = contacts[2].point - contacts[0].point;
            let normal = contacts[THUMB].direction;
            (wide - normal * normal.dot(&wide)).normalize()
        };
        assert!(across(&reached).dot(&across(&contacts)) > 1.0 - 1e-9);
    }
}

#[test]
fn the_papers_search_meets_the_contacts_with_one_lambda_and_often_collides() {
    let HandFile { hand, cross_check, .. } = allegro();
    let all = some(&hand, 200);
    let (mut solved, mut collides) = (0, 0);
    for contacts in &all {
        let mut path = 0;
        let attempt = hand.attempt(0.5, contacts, &paper::Settings::default(), |_| path += 1);
        assert_eq!(path, attempt.iterations + 1);
        let verdict = cross_check.judge(&hand, &attempt.configuration, contacts).unwrap();
        assert!(verdict.past_limit_rad <= 0.0);
        if matches!(attempt.end, End::Solved | End::Collides) {
            assert!(verdict.point_m < 1e-3 && verdict.collision.is_some() == (attempt.end == End::Collides));
        }
        solved += usize::from(attempt.end == End::Solved);
        collides += usize::from(attempt.end == End::Collides);
    }
    // It does not know of collisions until its end, and the boxes of palm and thumb touch in most postures.
    assert!((70..110).contains(&solved) && (130..190).contains(&(solved + collides)), "{solved} {collides}");
}

proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig::with_cases(40))]
    #[test]
    fn every_answer_makes_its_contacts_within_the_limits_and_without_a_collision(seed in 0..1_000_000u64) {
        let HandFile { hand, cross_check, .. } = allegro();
        let library = Library::draw(&hand, 200, 1);
        let contacts = hand.draw_many(1, seed)[0];
        let found = hand.solve(&library, &contacts, &Settings::default());
        let verdict = cross_check.judge(&hand, &found.configuration, &contacts).unwrap();
        prop_assert!(verdict.past_limit_rad <= 0.0);
        if found.is_solved {
            prop_assert!(verdict.point_m < 1e-6 && verdict.direction_rad < 1e-5 && verdict.collision.is_none());
        }
    }
}

#[test]
fn contacts_are_assigned_where_nobody_said_whose_they_are() {
    let HandFile { hand, cross_check, .. } = allegro();
    let library = Library::draw(&hand, 300, 1);
    for contacts in some(&hand, 10) {
        let shuffled = [2, 3, 1, 0].map(|k: usize| contacts[k]);
        let (found, order) = hand.solve_any(&library, &shuffled, &Settings::default());
        assert!(found.is_solved && (0..FINGERS).all(|k| order.contains(&k)));
        let verdict = cross_check.judge(&hand, &found.configuration, &order.map(|k| shuffled[k])).unwrap();
        assert!(verdict.point_m < 1e-6);
    }
}

#[test]
fn contacts_that_nothing_can_make_are_told_and_do_not_panic() {
    let hand = allegro().hand;
    let library = Library::draw(&hand, 50, 1);
    let contact = |x: f64| Contact { point: Vec3::new(x, 0.0, 0.0), direction: Vec3::z() };
    let far = [0.0, 0.1, 0.2, 1e300].map(contact);
    let (a, b, apart, most) = hand.out_of_reach(&far, true).unwrap();
    assert!((a, b) == (0, 3) && apart > most && (0.2..0.6).contains(&most));
    assert!(hand.out_of_reach(&[0.0, 0.1, 0.2, f64::NAN].map(contact), false).is_some());
    assert!(hand.out_of_reach(&[0.0; 4].map(contact), true).is_none());
    for contacts in [[0.0; 4].map(contact), far, [f64::NAN; 4].map(contact)] {
        assert!(!hand.solve(&library, &contacts, &Settings::default()).is_solved);
        assert!(hand.attempt(0.5, &contacts, &paper::Settings::default(), |_| ()).end != End::Solved);
    }
}

#[test]
fn the_greedy_sequence_takes_what_solves_most_of_what_is_left() {
    let solved = ["1100", "1100", "1010", "0010", "0001"];
    let solved = solved.map(|row| row.chars().map(|c| c == '1').collect()).to_vec();
    let outcomes = Outcomes { lambdas: vec![0.0, 0.3, 0.6, 1.0], solved };
    let sequence = outcomes.sequence(10);
    let reported: Vec<_> = sequence.iter().map(|c| (c.lambda, c.rate, c.accumulated)).collect();
    assert_eq!(reported, [(0.0, 60.0, 60.0), (0.6, 50.0, 80.0), (1.0, 100.0, 100.0)]);
    assert_eq!(sequence[1].rates, [0.0, 0.0, 50.0, 50.0]);
    let pictures = [plot::selection(&outcomes.lambdas, &sequence), plot::accumulation(&sequence)];
    assert!(pictures.iter().all(|svg| svg.contains("the paper") && !svg.contains("NaN")));
}

#[test]
fn a_training_goes_on_where_it_was_stopped() {
    let hand = allegro().hand;
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("training.txt");
    let settings = paper::Settings { max_iterations: 20, ..paper::Settings::default() };
    let training = Training { count: 12, lambdas: 3, seed: 5, settings };
    let whole = training.run(&hand, Some(&file), |_| ()).unwrap();
    assert_eq!(whole, training.run(&hand, None, |_| ()).unwrap());
    let text = std::fs::read_to_string(&file).unwrap();
    let head = text.find('\n').unwrap() + 1;
    for cut in [head, head + 1, head + 4, text.len() - 2, text.len()] {
        std::fs::write(&file, &text[..cut]).unwrap();
        let mut heard = Vec::new();
        assert_eq!(whole, training.run(&hand, Some(&file), |done| heard.push(done)).unwrap());
        assert_eq!(heard[0], (cut - head) / 4);
        assert_eq!(std::fs::read_to_string(&file).unwrap(), text);
    }
    for other in [&text[..head - 2], "x\n", &text.replace("\n0", "\n7").replace("\n1", "\n7")] {
        std::fs::write(&file, other).unwrap();
        assert!(matches!(training.run(&hand, Some(&file), |_| ()), Err(TrainingError::Other { .. })));
    }
}

#[test]
fn a_picture_shows_every_stage_from_three_sides() {
    let hand = allegro().hand;
    let contacts = some(&hand, 1)[0];
    let stages = [0.0, 0.5].map(|lambda| (format!("λ {lambda}"), hand.initial_configuration(lambda, &contacts)));
    let svg = picture::svg(&hand, &stages, &contacts);
    assert!(svg.matches("class=\"view\"").count() == 6 && svg.contains("λ 0.5") && !svg.contains("NaN"));
}

/// The message of a hand's file with one thing replaced; the robot is read from the examples.
fn hand_message(from: &str, to: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(root().join("examples/allegro_hand.toml")).unwrap();
    assert!(text.contains(from));
    std::fs::copy(root().join("examples/allegro_hand.urdf"), folder.path().join("allegro_hand.urdf")).unwrap();
    let file = folder.path().join("hand.toml");
    std::fs::write(&file, text.replacen(from, to, 1)).unwrap();
    let message = read_hand(&file).err().map(|error| error.to_string()).unwrap_or_default();
    message.replace(&format!("{}", file.display()), "hand.toml")
}

#[test]
fn faults_of_a_hand_name_line_and_column() {
    let check = |from, to, message: &str| {
        let reported = hand_message(from, to);
        assert!(reported.starts_with(message), "{reported}");
    };
    check("format = 1", "format = 2", "hand.toml:3:10: format 2 is not known");
    check("hand.urdf", "claw.urdf", "hand.toml:5:9: ");
    check("link_3.0_tip", "link_3_tip", "hand.toml:11:7: the robot has no link `link_3_tip`; it has palm_link, ");
    check("link_3.0_tip", "link_2.0", "hand.toml:11:7: finger `index` has 3 joints between the palm and its tip");
    check("link_7.0_tip", "link_3.0_tip", "hand.toml:14:1: fingers `medium` and `index` share a joint");
    check("tip_radius_mm = 12", "tip_radius_mm = 0", "hand.toml:12:17: 0 mm; give a length above zero");
    check("tip_radius_mm = 12", "tip_radius_mm = inf", "hand.toml:12:17: the number has to be finite");
    check("tip_radius_mm = 12", "tip_radius_mm = 12\nbend_deg = [9, 0]", "hand.toml:13:12: the range 9 to 0 deg");
    check("lambdas = [0.8889", "lambdas = [1.5", "hand.toml:7:11: the lambdas must be");
    let three = "[[finger]]\nname = \"index\"\ntip = \"link_3.0_tip\"\ntip_radius_mm = 12\n";
    check(three, "", "hand.toml:3:10: the hand has 3 fingers");
}

#[test]
fn a_bare_urdf_is_the_hand_of_its_file_but_for_the_shapes() {
    let urdf = root().join("examples/allegro_hand.urdf");
    let bare = |tips: &[&str]| {
        let tips = tips.iter().map(|tip| (*tip).to_owned()).collect();
        read_bare_hand(&urdf, &Fingers { tips, tip_radius_m: 0.012 })
    };
    let (found, file) = (bare(&[]).unwrap().hand, allegro().hand);
    assert_eq!(found.limits, file.limits);
    for (found, file) in found.fingers.iter().zip(&file.fingers) {
        assert_eq!((&found.name, &found.joints), (&file.name, &file.joints));
        assert!(found.tip.distance(&file.tip, 1.0) < 1e-12, "{}", found.name);
    }
    let turned = ["link_7.0_tip", "link_3.0_tip", "link_11.0_tip", "link_15.0_tip"];
    assert_eq!(bare(&turned).unwrap().hand.fingers[0].joints, file.fingers[1].joints);
    let message = |tips: &[&str]| bare(tips).err().unwrap().to_string();
    assert!(message(&turned[..3]).contains("needs four leaf links"), "{}", message(&turned[..3]));
    assert!(message(&["tip", "b", "c", "d"]).contains("no link `tip`; it has palm_link"));
    assert!(message(&["link_3.0", "b", "c", "d"]).contains("no link `b`"));
    assert!(message(&["link_3.0", turned[0], turned[2], turned[3]]).contains("`link_3.0` is no fingertip"));
    assert!(message(&[turned[0]; 4]).contains("share a joint"), "{}", message(&[turned[0]; 4]));
    let arm =
        read_bare_hand(&root().join("tests/data/urdf/panda.urdf"), &Fingers { tips: Vec::new(), tip_radius_m: 0.01 });
    assert!(arm.err().unwrap().to_string().contains("0 are found; its leaf links are "));
}

#[test]
fn faults_of_contacts_name_line_and_column() {
    let hand = allegro().hand;
    let text = std::fs::read_to_string(root().join("examples/grasp-contacts.toml")).unwrap();
    let message = |from: &str, to: &str| {
        assert!(text.contains(from));
        let task = parse_contacts(Path::new("c.toml"), &text.replacen(from, to, 1), &hand);
        task.err().map(|error| error.to_string()).unwrap_or_default()
    };
    assert_eq!(message("format = 1", "format = 3"), "c.toml:2:10: format 3 is not known, this program reads 1");
    let known = "it has index, medium, ring, thumb";
    assert_eq!(message("\"ring\"", "\"little\""), format!("c.toml:15:10: the hand has no finger `little`; {known}"));
    assert_eq!(message("\"ring\"", "\"index\""), "c.toml:15:10: finger `index` has a contact already");
    assert_eq!(
        message("finger = \"index\"\n", ""),
        "c.toml:4:1: the contact names no finger, others do; name that of each, or of none"
    );
    assert_eq!(
        message("direction = [-1, 0, 0]", "direction = [0, 0, 0]"),
        "c.toml:7:13: the direction is 0, 0, 0; give the normal into the object"
    );
    let last = "\n[[contact]]\nfinger = \"thumb\"\npoint_mm = [390, 24, 140]\ndirection = [1, 0, 0]\n";
    assert_eq!(message(last, ""), "c.toml:2:10: 3 contacts are given, there must be 4, each a [[contact]]");
    let huge = message("direction = [-1, 0, 0]", "direction = [1e300, 1e300, 0]");
    assert_eq!(huge, "");
}
