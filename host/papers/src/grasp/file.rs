//! Hands as files.
//!
//! Keys marked `?` are optional.
//!
//! | key | meaning |
//! | --- | --- |
//! | `format` | version of this format: 1 |
//! | `name` | name of the hand |
//! | `robot` | its URDF or MJCF, beside this file; the base is the palm; the shapes that collide are those of this file |
//! | `lambdas` ? | the trained sequence of λ, the first one first; the paper's Table 1 |
//! | `[[finger]]` | four of them: index, medium, ring, thumb |
//! | `name` | name of the finger |
//! | `tip` | link of the fingertip: its origin is the centre of the sphere, z goes outwards, x to the pad |
//! | `tip_radius_mm` | radius of the sphere |
//! | `bend_deg` ?, `lateral_deg` ? | ranges of the virtual joints φ₅, from z to x, and φ₆: \[0, 90\], \[−45, 45\] |

use std::ops::Range;
use std::path::Path;

use serde::Deserialize;
use toml::Spanned;

use super::assembly::{Described, HandFile, Read, VIRTUAL_DEG, finger_at, shared, unknown_link};
use super::fault::{HandError, HandFault};
use super::layout::FINGERS;
use super::train::PAPER_LAMBDAS;
use darm_robot::description::DescriptionError;
use darm_robot::robot::Robot;
use darm_robot::source::{Number, Source};

const FORMAT: u32 = 1;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawHand {
    format: Spanned<u32>,
    name: String,
    robot: Spanned<String>,
    lambdas: Option<Spanned<Vec<Number>>>,
    #[serde(default)]
    finger: Vec<Spanned<RawFinger>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawFinger {
    name: String,
    tip: Spanned<String>,
    tip_radius_mm: Spanned<Number>,
    bend_deg: Option<Spanned<[Number; 2]>>,
    lateral_deg: Option<Spanned<[Number; 2]>>,
}

/// What is wrong, and where in the file.
type Wrong = (Range<usize>, HandFault);

/// Reads a hand.
///
/// # Errors
///
/// The file or its robot cannot be read; it is not TOML of this format; or it does not describe four fingers of four
/// turning joints each, with limits, and with shapes that have a volume. The error names line and column.
pub fn read_hand(path: &Path) -> Result<HandFile, HandError> {
    let source = Source::read(path)?;
    let raw: RawHand = source.parse()?;
    let of_file = |(span, fault): Wrong| source.wrong(span, fault);
    if *raw.format.get_ref() != FORMAT {
        return Err(of_file((raw.format.span(), HandFault::Format { found: *raw.format.get_ref() })));
    }
    let robot_path = path.parent().unwrap_or(Path::new("")).join(raw.robot.get_ref());
    let named = |error: DescriptionError| of_file((raw.robot.span(), HandFault::Robot(error.to_string())));
    let described = Described::read(&robot_path).map_err(named)?;
    hand_file(&raw, described).map_err(of_file)
}

fn hand_file(raw: &RawHand, described: Described) -> Result<HandFile, Wrong> {
    let robot = &described.robot;
    let fingers: Vec<_> = raw.finger.iter().map(|finger| read_finger(finger, robot)).collect::<Result<_, _>>()?;
    let found = fingers.len();
    let Ok(read): Result<[Read; FINGERS], _> = fingers.try_into() else {
        return Err((raw.format.span(), HandFault::Fingers { found }));
    };
    if let Some((i, fault)) = shared(&read) {
        return Err((raw.finger[i].span(), fault));
    }
    let lambdas = match &raw.lambdas {
        None => PAPER_LAMBDAS.to_vec(),
        Some(lambdas) => {
            let numbers: Vec<f64> = lambdas.get_ref().iter().map(|number| number.0).collect();
            if numbers.is_empty() || !numbers.iter().all(|lambda| (0.0..=1.0).contains(lambda)) {
                return Err((lambdas.span(), HandFault::Lambdas));
            }
            numbers
        }
    };
    described.assemble(raw.name.clone(), read, lambdas).map_err(|fault| (raw.robot.span(), fault))
}

fn read_finger(raw: &Spanned<RawFinger>, robot: &Robot) -> Result<Read, Wrong> {
    let RawFinger { name, tip, tip_radius_mm, bend_deg, lateral_deg } = raw.get_ref();
    let tip_frame = robot.frame(tip.get_ref()).ok_or_else(|| (tip.span(), unknown_link(robot, tip.get_ref())))?;
    let mut virtual_deg = VIRTUAL_DEG;
    for (own, range) in virtual_deg.iter_mut().zip([bend_deg, lateral_deg]) {
        let Some(range) = range else { continue };
        let [low, high] = range.get_ref().map(|number| number.0);
        if !(-180.0 <= low && low <= high && high <= 180.0) {
            return Err((range.span(), HandFault::Range { low, high }));
        }
        *own = [low, high];
    }
    finger_at(robot, name, tip_frame.clone(), virtual_deg, length_m(tip_radius_mm)?).map_err(|fault| match fault {
        HandFault::Joints { .. } => (tip.span(), fault),
        _ => (raw.span(), fault),
    })
}

fn length_m(mm: &Spanned<Number>) -> Result<f64, Wrong> {
    let value = mm.get_ref().0;
    if value > 0.0 { Ok(1e-3 * value) } else { Err((mm.span(), HandFault::NotPositive { value })) }
}
