//! What happened in a run: a digest always, lines for people where they are wanted.

/// FNV-1a, 64 bits.
const OFFSET: u64 = 0xcbf2_9ce4_8422_2325;
const PRIME: u64 = 0x100_0000_01b3;

/// One line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Said {
    /// True time, ns.
    pub at_ns: u64,
    /// Who.
    pub who: &'static str,
    /// What.
    pub what: String,
}

/// The record of a run.
#[derive(Clone, Debug)]
pub struct Trace {
    digest: u64,
    lines: Option<Vec<Said>>,
}

impl Trace {
    /// An empty record.
    pub fn new(readable: bool) -> Self {
        Self { digest: OFFSET, lines: readable.then(Vec::new) }
    }

    /// Mixes bytes into the digest.
    pub fn mix(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.digest = (self.digest ^ u64::from(*byte)).wrapping_mul(PRIME);
        }
    }

    /// Notes a line, if people are to read it.
    pub fn say(&mut self, at_ns: u64, who: &'static str, what: impl FnOnce() -> String) {
        if let Some(lines) = &mut self.lines {
            lines.push(Said { at_ns, who, what: what() });
        }
    }

    /// Two runs of one seed have the same.
    pub fn digest(&self) -> u64 {
        self.digest
    }

    /// The lines in order of time.
    pub fn into_lines(self) -> Vec<Said> {
        self.lines.unwrap_or_default()
    }
}
