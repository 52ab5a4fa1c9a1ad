//! The command `switchback-mpcc-ampl stub [-AMPL] [name=value ...]`.

use std::io::Write;
use std::process::ExitCode;

use switchback_mpcc_ampl::driver;

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args_os().skip(1).map(|a| a.to_string_lossy().into_owned()).collect();
    let environment = std::env::var(driver::VARIABLE).unwrap_or_default();
    let mut out = std::io::stdout().lock();
    match driver::run(&args, &environment, &mut out) {
        Ok(()) => {
            // a reader that has left is no failure
            let _ = out.flush();
            ExitCode::SUCCESS
        }
        Err(e) => {
            let _ = out.flush();
            eprintln!("{}: {e}", driver::NAME);
            ExitCode::FAILURE
        }
    }
}
