//! Files of random arms: joints with two to four states, at random outputs, lines and inputs, with every kind of drive.

use std::fmt::Write as _;

/// Random numbers that are the same on every machine: SplitMix64 (Steele, Lea, Flood, OOPSLA 2014).
pub(super) struct Draw(u64);

impl Draw {
    pub(super) fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// A number below `n`, which is not 0.
    pub(super) fn below(&mut self, n: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        (bits ^ (bits >> 31)) % n
    }

    /// The numbers below `n` in a random order.
    fn shuffled(&mut self, n: u8) -> Vec<u8> {
        let mut numbers: Vec<u8> = (0..n).collect();
        for k in (1..numbers.len()).rev() {
            numbers.swap(k, self.below(k as u64 + 1) as usize);
        }
        numbers
    }
}

/// The text of an arm file and of the profile of its board.
pub(super) fn files(draw: &mut Draw) -> (String, String) {
    let mut arm = String::from("format = 2\nname = \"random\"\n");
    let mut profile = String::from("format = 1\nname = \"random\"\nsupply = { new_outputs = 4, window_ms = 10 }\n");
    let (mut outputs, mut lines, mut inputs) = (draw.shuffled(48), draw.shuffled(64), draw.shuffled(13));
    for joint in 0..1 + draw.below(10) {
        let n_states = 2 + draw.below(3);
        let own: Vec<u8> = (0..if n_states == 2 { 1 } else { 2 }).filter_map(|_| outputs.pop()).collect();
        let values: Vec<String> = (0..n_states).map(|state| format!("{}.0", 10 * state)).collect();
        let _ = write!(
            arm,
            "[[stage]]\nkind = \"discrete-joint\"\nname = \"joint {joint}\"\nvalue_deg = [{}]\ntravel_ms = 60\n",
            values.join(", ")
        );
        let _ = match own[..] {
            [output] => writeln!(arm, "output = {output}"),
            _ => writeln!(arm, "outputs = {own:?}"),
        };
        let input = if draw.below(2) == 0 { inputs.pop() } else { None };
        if input.is_some() {
            let _ = writeln!(arm, "switch = {{ closed_in = [{}] }}", draw.below(n_states));
        }
        for (bit, output) in own.into_iter().enumerate() {
            write_output(&mut profile, draw, output, &mut lines, input.filter(|_| bit == 0));
        }
    }
    (arm, profile)
}

fn write_output(profile: &mut String, draw: &mut Draw, output: u8, lines: &mut Vec<u8>, input: Option<u8>) {
    let mut line = || lines.pop().expect("ten joints have at most forty lines");
    let drive = match draw.below(3) {
        0 => format!("\"hold\"\nline = {}", line()),
        1 => format!("\"peak-hold\"\npull = {}\nhold = {}\npeak_ms = 10", line(), line()),
        _ => format!("\"latch\"\nset = {}\nreset = {}\npulse_ms = 20", line(), line()),
    };
    let input = input.map_or(String::new(), |input| format!("input = {input}\n"));
    let _ = write!(
        profile,
        "[[output]]\nnumber = {output}\ndrive = {drive}\nmax_on_ms = 60000\nduty_percent = 100\nwindow_ms = 60000\n{input}"
    );
}
