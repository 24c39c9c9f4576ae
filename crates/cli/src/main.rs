//! The program `motorlink`.

fn main() -> std::process::ExitCode {
    let program = std::env::current_exe().unwrap_or_else(|_| "motorlink".into());
    motorlink_cli::run(&[program.into()], std::env::args_os()).into()
}
