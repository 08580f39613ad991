//! The command line; see `silhouette --help`.

fn main() -> std::process::ExitCode {
    silhouette::cli::run()
}
