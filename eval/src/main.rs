//! What measures: the demo, the benchmarks, the blind suite, the papers and the faults; what is done with the figures.
//! `cargo xtask` starts it.

mod bench;
mod blind;
mod calibrate;
mod faults;
mod join;
mod papers;
mod python;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Measurements of this workspace, each with its goals
///
/// A command with the options --shard and --results is a list of independent seeded items. Several processes share them:
/// each runs its part (--shard I/N, or the rank of mpirun or of a Slurm array) and appends outcomes to a separate file
/// (--results 'NAME.{shard}.results'); a process that was killed is started again with the same command. `merge` joins the
/// files and prints the table of one process. docs/evaluation.md describes the files.
#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask")]
struct Arguments {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    Demo(darm_demo::Demo),
    Bench(bench::Bench),
    Papers(papers::Papers),
    Blind(blind::Blind),
    Calibrate(calibrate::Calibrate),
    Faults(faults::Faults),
    Merge(join::Merge),
    Compare(join::Compare),
    Measured(join::Measured),
}

fn main() -> ExitCode {
    let result = match Arguments::parse().task {
        Task::Demo(demo) => demo.run(),
        Task::Bench(bench) => bench.run(),
        Task::Papers(papers) => papers.run(),
        Task::Blind(blind) => blind.run(),
        Task::Calibrate(calibrate) => calibrate.run(),
        Task::Faults(faults) => faults.run(),
        Task::Merge(merge) => merge.run(),
        Task::Compare(compare) => compare.run(),
        Task::Measured(measured) => measured.run(),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use clap::{CommandFactory as _, Parser as _};

    use super::Arguments;

    /// The command lines with options that the documents print, behind their `cargo xtask`, with numbers for placeholders.
    /// A word alone may also be the name of a group.
    fn documented() -> Vec<String> {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let docs = std::fs::read_dir(root.join("docs")).unwrap().map(|entry| entry.unwrap().path());
        let pages = docs.filter(|path| path.extension().is_some_and(|extension| extension == "md"));
        let pages = pages.chain([root.join("README.md")]).map(|page| std::fs::read_to_string(page).unwrap());
        let lines = |page: String| -> Vec<String> {
            let starts = page.split("cargo xtask ").skip(1);
            let line =
                starts.map(|rest| rest.split(['`', '\n', '#']).next().expect("a split text has a first part").trim());
            line.filter(|line| line.contains(' ')).map(|line| line.replace(" N", " 1")).collect()
        };
        pages.flat_map(lines).collect()
    }

    #[test]
    fn command_lines_of_the_documents_are_valid() {
        let tasks: Vec<String> =
            Arguments::command().get_subcommands().map(|task| task.get_name().to_owned()).collect();
        let all = documented();
        let own =
            all.iter().filter(|line| line.split(' ').next().is_some_and(|task| tasks.iter().any(|own| own == task)));
        let parsed = own
            .map(|line| (line, Arguments::try_parse_from(["cargo xtask"].into_iter().chain(line.split_whitespace()))));
        let (valid, invalid): (Vec<_>, Vec<_>) = parsed.partition(|(_, parsed)| parsed.is_ok());
        let invalid: Vec<String> =
            invalid.into_iter().filter_map(|(line, parsed)| Some(format!("{line}: {}", parsed.err()?))).collect();
        assert!(invalid.is_empty(), "{}", invalid.join("\n"));
        assert!(valid.len() > 30, "{} command lines", valid.len());
    }
}
