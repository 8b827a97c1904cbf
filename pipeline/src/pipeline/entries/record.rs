//! Check of a recorder: its file names are valid and its folders are writable.

use std::path::Path;

use tauscope_archive::whole_file;

use super::Resolver;
use crate::settings::Settings;
use crate::yaml::Place;

impl Resolver<'_> {
    pub(super) fn record(
        &mut self,
        index: usize,
        place: &Place,
        config: &tauscope_record::Config,
    ) -> Option<Settings> {
        let mut config = config.clone();
        if !config.writes_something() {
            let problem = self.file.at_key(place, "a recorder that writes nothing");
            self.report.push(
                problem.help("give `mcap: out/archive.mcap`, or `rerun: {file: out/picture.rrd}`"),
            );
            return None;
        }
        for path in config.all_names_mut() {
            *path = self.file.resolve(path);
        }
        if let Err(error) = config.check_names() {
            let problem = self.file.at_key(place, error.to_string());
            self.report
                .push(problem.help("for example `mcap: out/{date}/{time}.mcap`"));
            return None;
        }
        if self.is_here(index) {
            self.are_files(index, place, &mut config)?;
            self.can_be_written(index, place, &config)?;
        }
        Some(Settings::Record(config))
    }

    /// Checks that the recorder's names are those of files, not of folders.
    fn are_files(
        &mut self,
        index: usize,
        place: &Place,
        config: &mut tauscope_record::Config,
    ) -> Option<()> {
        let cells = self.wiring.map(|wiring| &wiring.cells[index]);
        let cell = cells.and_then(|cells| cells.first());
        let cell = cell.map_or("", String::as_str).to_owned();
        let ends = |path: &Path| path.to_string_lossy().ends_with('/');
        let given = config.all_names_mut().find(|path| ends(path)).cloned();
        let there = || config.in_the_way(&cell).into_iter().find(|p| p.is_dir());
        let Some(folder) = given.or_else(there) else {
            return Some(());
        };
        let title = format!("{} is a folder, no file", folder.display());
        let problem = self.file.at_key(place, title);
        self.report
            .push(problem.help("name a file in it, for example `{date}-{time}.mcap`"));
        None
    }

    /// Checks that this user may write to the recorder's folders.
    fn can_be_written(
        &mut self,
        index: usize,
        place: &Place,
        config: &tauscope_record::Config,
    ) -> Option<()> {
        let cells = self.wiring.map(|wiring| &wiring.cells[index]);
        let cell = cells.and_then(|cells| cells.first());
        let mut folders = config.folders(cell.map_or("", String::as_str));
        folders.dedup();
        for folder in folders {
            if let Err(error) = whole_file::check_writable(&folder) {
                let shown = if folder == Path::new("") {
                    Path::new(".")
                } else {
                    &folder
                };
                let title = format!("cannot write into {}: {error}", shown.display());
                let problem = self.file.at_key(place, title);
                self.report.push(problem.help(
                    "give a folder that this user may write to, or change its owner or rights",
                ));
                return None;
            }
        }
        Some(())
    }
}
