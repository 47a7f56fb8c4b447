//! The standalone real-time controller.

use std::process::ExitCode;

fn main() -> ExitCode {
    ilc_rt::cli::main()
}
