//! The data of a configuration, checked before anything is made of it.

use super::table::{Row, row, table};
use super::verbosity::{print_status, progress_bar};
use crate::config::Config;
use crate::dataset::{DataCheck, Fault};
use crate::system::closed_pipe::print_stderr;
use miette::{Report, miette};

/// Most files that a table shows.
const MOST_FAULTS: usize = 30;

/// Checks the files that `config` names; warnings are counted in one line.
///
/// # Errors
/// When one cannot be trained on, after a table of all that cannot.
pub(super) fn check_data(config: &Config) -> Result<DataCheck, Report> {
    let bar = progress_bar(0, "checking data {bar:30} {pos}/{len}");
    let check = DataCheck::run(config, &|done, total| {
        bar.set_length(total as u64);
        bar.set_position(done as u64);
    })?;
    bar.finish_and_clear();
    if check.faults.is_empty() {
        if let Some(first) = check.warnings.first() {
            let (count, files) = (check.warnings.len(), check.files);
            let (name, warning) = (first.file.file_name().unwrap_or_default(), first.warnings.join(", "));
            print_status(&format!(
                "data: warnings about {count} of {files} files, the first {}: {warning}; `clothcombo check` lists all",
                name.display()
            ));
        }
        return Ok(check);
    }
    let rows: Vec<Row> = check.faults.iter().take(MOST_FAULTS).map(fault_row).collect();
    print_stderr(table(&rows).trim_end());
    let count = check.faults.len();
    if count > MOST_FAULTS {
        print_stderr(format_args!("… and {} more", count - MOST_FAULTS));
    }
    Err(miette!(
        help = "mend them, or take them out of the data; `clothcombo check FOLDER --body BODY` judges in the same way",
        "{count} of {} files of the data cannot be trained on: see the table above",
        check.files
    ))
}

fn fault_row(fault: &Fault) -> Row {
    row! {
        "name" => fault.name,
        "file" => fault.file.display().to_string(),
        "what is wrong" => fault.what,
        "what mends it" => fault.remedy,
    }
}
