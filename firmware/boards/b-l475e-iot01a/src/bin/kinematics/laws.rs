//! Where a corrected arm has its tool, by its geometry and the laws of its effects in `f32`: the host holds the poses
//! against its own.
use core::hint::black_box;

use darm_b_l475e_iot01a::measure::{self, check, print};
use darm_core::chain::Scratch;
use darm_core::model::Model;
use darm_core::se::Pose;
use darm_core::units::Word;
use darm_firmware::stack::StackMemory;

use crate::corrected;

/// In flash.
static MODEL: Model<f32, 6> = corrected::MODEL;
/// Each is reached from the word at rest.
const WORDS: [&str; 8] = [
    "000000000000000000000000000000000000",
    "111111111111111111111111111111111111",
    "010110011101101001110010011101001011",
    "101001100010010110001101100010110100",
    "111111000000111111000000111111000000",
    "000111000111000111000111000111000111",
    "011011011011011011011011011011011011",
    "100010110101110001011010010111100011",
];

#[inline(never)]
fn predict(word: Word, scratch: &mut Scratch<f32, 6>) -> Option<Pose<f32>> {
    let rest = Word::zeros(word.len() as u8)?;
    MODEL.predict(&MODEL.working(word, rest, &[]), scratch).ok()
}

/// Prints the poses, by rows of the rotation and then the position, and what one of them takes.
#[inline(never)]
pub(crate) fn measure(stack: &StackMemory) {
    let mut scratch = Scratch::default();
    let (mut longest, mut shortest) = (0, u32::MAX);
    for digits in WORDS {
        let word: Word = digits.parse().unwrap_or_default();
        let mut pose = None;
        let count = measure::instructions(|| pose = predict(black_box(word), &mut scratch));
        (longest, shortest) = (longest.max(count), shortest.min(count));
        let Some(pose) = pose else { return check("the corrected arm has a pose", false) };
        let numbers = pose.rotation.transpose();
        for (index, number) in numbers.iter().chain(pose.position.iter()).enumerate() {
            print("pose", format_args!("{digits}.{index}"), number, "1");
        }
    }
    print("corrected_model", "pose_of_a_word_at_least", shortest, "instructions");
    print("corrected_model", "pose_of_a_word_at_most", longest, "instructions");
    print("corrected_model", "stack", stack.usage().used, "bytes");
}
