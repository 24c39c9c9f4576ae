//! The program `motorlink`.

fn main() -> std::process::ExitCode {
    motorlink_cli::run(std::env::args_os()).into()
}
