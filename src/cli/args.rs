//! How values of flags are written.

use std::num::NonZero;
use std::str::FromStr;

/// How many threads.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Threads {
    /// So many.
    Count(NonZero<usize>),
    /// Half of what the machine runs at once.
    Half,
    /// All of it.
    Max,
}

/// More threads than any machine has are a slip of the finger.
const MAX_THREADS: usize = 4096;

impl Threads {
    /// At least 1.
    pub fn count(self) -> usize {
        let all = std::thread::available_parallelism().map_or(1, NonZero::get);
        match self {
            Threads::Count(n) => n.get(),
            Threads::Half => all.div_ceil(2),
            Threads::Max => all,
        }
    }
}

impl FromStr for Threads {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, String> {
        match s {
            "half" => Ok(Threads::Half),
            "max" => Ok(Threads::Max),
            _ => s
                .parse()
                .ok()
                .filter(|n: &NonZero<usize>| n.get() <= MAX_THREADS)
                .map(Threads::Count)
                .ok_or_else(|| format!("takes a number from 1 to {MAX_THREADS}, half or max")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_read_or_refused_with_a_reason() {
        assert_eq!("3".parse(), Ok(Threads::Count(NonZero::new(3).unwrap())));
        assert_eq!("half".parse(), Ok(Threads::Half));
        assert!(["0", "-1", "some", "99999999"].iter().all(|s| s.parse::<Threads>().is_err()));
    }
}
