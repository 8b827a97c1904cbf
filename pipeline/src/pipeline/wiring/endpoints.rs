//! Check of the syntax of all network endpoints.

use tauscope_bus::link::zenoh::check_endpoint;

use super::Checker;
use crate::pipeline::stage::entry::stage_place;
use crate::yaml::Place;

impl Checker<'_> {
    pub(super) fn endpoints(&mut self) {
        let mut all: Vec<(Place, &[String])> = Vec::new();
        let file = self.file;
        let hosts = Place::root().key("hosts");
        for (name, host) in &file.value.hosts {
            let place = hosts.key(name);
            all.push((place.key("listen"), &host.listen.0));
            all.push((place.key("connect"), &host.connect.0));
        }
        for (at, stage) in file.value.stages.iter().enumerate() {
            let place = stage_place(at);
            if let Some(ingest) = stage.config::<tauscope_ingest::Config>() {
                let place = place.key("ingest");
                if let Some(zenoh) = &ingest.zenoh {
                    all.push((place.key("zenoh").key("connect"), &zenoh.connect));
                    all.push((place.key("zenoh").key("listen"), &zenoh.listen));
                }
                if let Some(commands) = &ingest.commands {
                    all.push((place.key("commands").key("connect"), &commands.connect));
                    all.push((place.key("commands").key("listen"), &commands.listen));
                }
            }
            let publish = stage.config::<tauscope_publish::Config>();
            if let Some(zenoh) = publish.and_then(|it| it.zenoh.as_ref()) {
                let place = place.key("publish").key("zenoh");
                all.push((place.key("connect"), &zenoh.connect));
                all.push((place.key("listen"), &zenoh.listen));
            }
        }
        for (place, endpoints) in all {
            for endpoint in endpoints {
                if let Err(error) = check_endpoint(endpoint) {
                    let problem = self.file.at(&place, error.to_string());
                    self.wrong(problem);
                }
            }
        }
    }
}
