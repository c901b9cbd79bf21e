//! Every command line in the help and in the documents runs exactly as printed, in a scratch folder with the files of
//! `examples`. Lines that need hardware or data that is not shipped carry a printed reason: `(no_run: probe)`.

use std::collections::BTreeSet;
use std::io::{BufRead as _, BufReader, Read as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::time::Instant;

use super::stop::interrupt;
use super::{Home, text};

/// Lines that cannot run, at most.
const MAX_NOT_RUN: usize = 10;
/// First words of an example.
const PROGRAMS: [&str; 3] = ["darm ", "cargo ", "printf "];
/// The simulator that serves the examples of all commands, as the overview starts it.
const SIMULATOR: &str = "darm sim arm.toml --effect stroke-loss";

/// A command line as printed.
struct Example {
    source: String,
    line: String,
}

impl Example {
    fn is_run(&self) -> bool {
        !self.line.contains("(no_run: ")
    }

    /// Whether it runs until Ctrl-C and uses the simulator.
    fn is_server(&self) -> bool {
        self.line.starts_with("darm serve")
    }

    /// Whether it runs until Ctrl-C and is the simulator.
    fn is_simulator(&self) -> bool {
        self.line.starts_with("darm sim ")
    }
}

/// A scratch folder, and the simulator that runs in it.
struct Scratch {
    home: Home,
    simulator: Option<(String, Child, BufReader<ChildStdout>)>,
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap()
}

/// Copies all files of a folder.
fn copy_files(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap().map(Result::unwrap) {
        std::fs::copy(entry.path(), to.join(entry.file_name())).unwrap();
    }
}

impl Scratch {
    fn new() -> Self {
        Self { home: Home::new(), simulator: None }
    }

    /// A shell that finds `darm` and nothing else. Files of earlier examples are overwritten, as by a person who agrees.
    fn shell(&self, line: &str) -> Command {
        let programs = Path::new(env!("CARGO_BIN_EXE_darm")).parent().unwrap();
        let mut command = Command::new("/bin/sh");
        command.args(["-c", line]).env_clear().env("PATH", programs).env("HOME", self.home.path(""));
        command.env("DARM_FORCE", "1");
        command.current_dir(self.home.path("")).stdin(Stdio::null());
        command
    }

    /// Runs an example; what it printed if it failed.
    fn run(&mut self, example: &Example) -> Option<String> {
        if !example.is_run() {
            return None;
        }
        let mut failed = None;
        let started = Instant::now();
        if example.is_simulator() {
            self.start_simulator(&example.line);
        } else if example.is_server() {
            self.run_server(&example.line);
        } else {
            let output = self.shell(&example.line).output().unwrap();
            let printed = || format!("{}: `{}`: {}", example.source, example.line, text(&output.stderr));
            failed = (!output.status.success()).then(printed);
        }
        eprintln!("{:6.2} s  {}: {}", started.elapsed().as_secs_f64(), example.source, example.line);
        failed
    }

    fn start_simulator(&mut self, line: &str) {
        self.stop_simulator();
        let (child, output) = self.start_until(line, "camera ");
        self.simulator = Some((line.to_owned(), child, output));
    }

    /// Starts a command that runs until Ctrl-C, and waits until a line that it prints begins with `ready`.
    fn start_until(&self, line: &str, ready: &str) -> (Child, BufReader<ChildStdout>) {
        // The shell is replaced by the command, which then gets the signal.
        let mut child = self.shell(&format!("exec {line}")).stdout(Stdio::piped()).spawn().unwrap();
        let mut output = BufReader::new(child.stdout.take().unwrap());
        let mut printed = String::new();
        while !printed.lines().any(|line| line.starts_with(ready)) {
            assert!(output.read_line(&mut printed).unwrap() > 0, "`{line}` ended: {printed}");
        }
        (child, output)
    }

    /// Starts the server of the live page and ends it by Ctrl-C: it holds the port while it runs.
    fn run_server(&self, line: &str) {
        let (mut child, _output) = self.start_until(line, "page ");
        interrupt(&child);
        assert!(child.wait().unwrap().success(), "`{line}`");
    }

    /// Ends the simulator by Ctrl-C.
    fn stop_simulator(&mut self) {
        let Some((line, mut child, mut output)) = self.simulator.take() else { return };
        interrupt(&child);
        let mut rest = String::new();
        output.read_to_string(&mut rest).unwrap();
        assert!(child.wait().unwrap().success(), "`{line}`: {rest}");
        assert!(rest.contains("undeclared effect in the arm"), "`{line}`: {rest}");
    }

    /// The standard board, for the examples of a command.
    fn standard_simulator(&mut self) {
        if self.simulator.as_ref().is_none_or(|(line, ..)| !line.starts_with(SIMULATOR)) {
            self.start_simulator(SIMULATOR);
        }
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        if let Some((_, child, _)) = &mut self.simulator {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// The command lines of a help text.
fn of_help(command: &str, help: &str) -> Vec<Example> {
    // A line that ends in a backslash is continued on the next one.
    let joined = help.replace("\\\n", "\\\u{0}");
    let indented = joined.lines().filter_map(|line| line.strip_prefix("  "));
    let lines = indented.filter(|line| PROGRAMS.iter().any(|program| line.starts_with(program)));
    let source = || format!("darm {command}--help");
    lines.map(|line| Example { source: source(), line: line.replace('\u{0}', "\n") }).collect()
}

/// What follows an example where neither another one nor an empty line does: the rest of an example that is too long.
fn wrapped(help: &str) -> Vec<&str> {
    let is_example = |line: &str| {
        let line = line.strip_prefix("  ").unwrap_or_default();
        PROGRAMS.iter().any(|program| line.starts_with(program))
    };
    let pairs = help.lines().zip(help.lines().skip(1));
    pairs
        .filter(|(line, next)| is_example(line) && !line.ends_with('\\') && !is_example(next) && !next.is_empty())
        .map(|(_, next)| next)
        .collect()
}

/// The subcommands of a command; the overview has its own list, in groups.
fn subcommands(path: &str, help: &str) -> Vec<String> {
    if path.is_empty() {
        return super::COMMANDS.map(str::to_owned).to_vec();
    }
    let listed = help.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
    let names = listed.filter(|line| !line.starts_with("    ")).filter_map(|line| line.split_whitespace().next());
    names.filter(|name| *name != "help").map(str::to_owned).collect()
}

/// All commands with their help, a group of subcommands after its own help.
fn commands(home: &Home, path: &str) -> Vec<(String, String)> {
    let help = home.succeeds(&format!("{path}--help"));
    let mut found = vec![(path.to_owned(), help.clone())];
    for name in subcommands(path, &help) {
        found.extend(commands(home, &format!("{path}{name} ")));
    }
    found
}

#[test]
fn examples_of_the_help_run_as_printed() {
    let mut scratch = Scratch::new();
    copy_files(&root().join("examples"), &scratch.home.path(""));
    let commands = commands(&scratch.home, "");
    assert!(commands.len() > 30, "{} commands", commands.len());
    let (mut done, mut failed) = (BTreeSet::new(), Vec::new());
    for (command, help) in &commands {
        let examples = of_help(command, help);
        if !command.is_empty() {
            scratch.standard_simulator();
        }
        for example in examples {
            if done.insert(example.line.clone()) {
                failed.extend(scratch.run(&example));
            }
        }
    }
    scratch.stop_simulator();
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}

/// The Markdown files whose command lines run.
fn documents() -> Vec<PathBuf> {
    let mut found = vec![root().join("README.md")];
    let mut folders = vec![root().join("docs")];
    while let Some(folder) = folders.pop() {
        for path in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "md") {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

/// The command lines in the `sh` fences of a document.
fn of_document(path: &Path) -> Vec<Example> {
    let name = path.strip_prefix(root()).unwrap().display().to_string();
    let (mut found, mut reason) = (Vec::new(), None);
    for (number, line) in (1..).zip(std::fs::read_to_string(path).unwrap().lines()) {
        let source = format!("{name}:{number}");
        match (&reason, line.strip_prefix("```")) {
            (None, Some(language)) => {
                let is_shell = language.split([',', ' ']).next() == Some("sh");
                let no_run = language.split_once("no_run: ").map(|(_, reason)| format!("  # (no_run: {reason})"));
                reason = Some(is_shell.then(|| no_run.unwrap_or_default()));
            }
            (Some(_), Some("")) => reason = None,
            (Some(Some(reason)), None) if !line.trim().is_empty() && !line.starts_with(['#', ' ']) => {
                found.push(Example { source, line: format!("{line}{reason}") });
            }
            _ => {}
        }
    }
    found
}

#[test]
fn command_lines_of_the_documents_run_as_printed() {
    let mut scratch = Scratch::new();
    copy_files(&root().join("examples"), &scratch.home.path("examples"));
    let examples: Vec<_> = documents().iter().flat_map(|path| of_document(path)).collect();
    // What builds and measures is run by `cargo xtask test` and by the evaluation.
    let examples: Vec<_> = examples.into_iter().filter(|example| !example.line.starts_with("cargo ")).collect();
    assert!(examples.len() > 10, "{} command lines", examples.len());
    let failed: Vec<_> = examples.iter().filter_map(|example| scratch.run(example)).collect();
    scratch.stop_simulator();
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}

#[test]
fn every_help_has_examples_that_fit_on_a_line() {
    for (command, help) in commands(&Home::new(), "") {
        assert!(!of_help(&command, &help).is_empty(), "darm {command}--help has no example");
        assert_eq!(wrapped(&help), [""; 0], "darm {command}--help wraps an example");
    }
}

#[test]
fn few_command_lines_cannot_run() {
    let home = Home::new();
    let of_help = commands(&home, "").into_iter().flat_map(|(command, help)| of_help(&command, &help));
    let all = of_help.chain(documents().iter().flat_map(|path| of_document(path)).collect::<Vec<_>>());
    // This test is a part of what the first line runs; the default build has no camera.
    let is_other = |line: &str| ["cargo xtask test ", "darm camera "].iter().any(|start| line.starts_with(start));
    let lines = all.filter(|example| !example.is_run() && !is_other(&example.line));
    let not_run: BTreeSet<String> =
        lines.map(|example| example.line.split_whitespace().collect::<Vec<_>>().join(" ")).collect();
    assert!(not_run.len() <= MAX_NOT_RUN, "{} lines: {not_run:#?}", not_run.len());
}
