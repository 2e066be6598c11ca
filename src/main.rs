//! The command `skylit`; all of it is in [`skylit::cli`].

use std::process::ExitCode;

fn main() -> ExitCode {
    skylit::cli::main()
}
