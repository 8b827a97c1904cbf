//! Diagnosis of a source without usable messages: compares the expected, the received and the observed messages to
//! find the likeliest mistake. Pure.

use tauscope_archive::Twice;
use tauscope_archive::ros::JointStateType;
use tauscope_bus::Trouble;
use tauscope_session::suggest::LEAST_SIMILARITY;

use super::joint_names::{list, slip};
use super::keys::KeyScheme;
use super::publication::{Form, Publication};
use super::scout::Seen;
use crate::config::Keys;

/// Topic, joints and endpoints that a source expects.
#[derive(Debug, Clone)]
pub(super) struct Expected {
    pub scheme: KeyScheme,
    /// The topic in the pipeline file.
    pub topic: String,
    pub joints: Vec<String>,
    pub connect: Vec<String>,
    pub listen: Vec<String>,
}

/// Messages received on the topic since the last sample.
#[derive(Debug, Clone, Default)]
pub(super) struct Fed {
    /// Whether there were samples before.
    pub was_well: bool,
    /// Number of messages on the topic.
    pub messages: u64,
    pub undecodable: u64,
    /// Reason why the last message could not be decoded.
    pub reason: Option<String>,
    /// Messages of other joints.
    pub foreign: u64,
    /// Messages without positions.
    pub incomplete: u64,
    /// Messages with values that are not finite.
    pub not_finite: u64,
    /// A joint, and its field that was never finite.
    pub never_finite: Option<(String, &'static str)>,
    /// A joint that messages name more than once.
    pub twice: Option<Twice>,
    /// Messages with stamps that do not advance.
    pub stale: u64,
}

impl Expected {
    /// Returns the key without the type's hash: for the type that is published, else for `JointState`.
    fn stem(&self, seen: &Seen) -> String {
        let stem = |of: JointStateType| self.scheme.stem(&self.topic, &of.dds_type());
        let mut all = JointStateType::ALL.into_iter().map(stem);
        let found = all.find(|stem| seen.publications.by_key.contains_key(stem));
        found.unwrap_or_else(|| stem(JointStateType::JointState))
    }

    fn lines(&self) -> Vec<String> {
        let keys = self.scheme.joint_state_keys(&self.topic);
        let keys = keys.into_iter().map(|(key, of)| match of {
            Some(of) => format!("{} on {key}", of.name()),
            None => format!("{} on {key}", JointStateType::names()),
        });
        keys.chain([format!("joints {}", list(&self.joints))])
            .collect()
    }
}

/// Returns the reason why no usable message arrives.
pub(super) fn diagnose(expected: &Expected, fed: &Fed, seen: &Seen) -> Trouble {
    let stem = expected.stem(seen);
    let own = seen.publications.by_key.get(&stem);
    let trouble = if seen.connected == 0 {
        unconnected(expected, fed, seen)
    } else if fed.messages > 0 {
        unusable(expected, fed, &stem, own)
    } else if let Some(own) = own.filter(|own| own.publishers() > 0) {
        let them = if own.publishers() == 1 {
            "its publisher sends"
        } else {
            "its publishers send"
        };
        Trouble::new(format!("{stem} is announced, but {them} nothing")).likely(Some(
            "the driver is up, but not connected to the robot, or it is paused".to_owned(),
        ))
    } else if fed.was_well {
        gone(expected, &stem)
    } else {
        Trouble::new(format!("no publisher of {stem}")).likely(misnamed(expected, seen))
    };
    trouble.expects(expected.lines()).sees(lines(seen, &stem))
}

/// Describes a topic whose messages have stopped. Only `rmw_zenoh` shows whether its publisher still exists.
fn gone(expected: &Expected, stem: &str) -> Trouble {
    if expected.scheme.keys == Keys::RmwZenoh {
        return Trouble::new(format!("the publisher of {stem} has gone")).likely(Some(
            "the driver has ended, or it has lost its router".to_owned(),
        ));
    }
    Trouble::new(format!("no message on {stem} any more")).likely(Some(
        "its publisher has paused or ended: see whether the driver runs and is connected to the robot"
            .to_owned(),
    ))
}

fn unconnected(expected: &Expected, fed: &Fed, seen: &Seen) -> Trouble {
    if expected.connect.is_empty() {
        return Trouble::new(format!(
            "no peer has connected to {}",
            expected.listen.join(", ")
        ))
        .likely(Some(
            "let the robot's router or bridge connect to this address".to_owned(),
        ));
    }
    let lost = if fed.was_well {
        "the connection is lost: "
    } else {
        ""
    };
    let all = expected.connect.join(", ");
    let tried = seen.endpoints.iter().map(|(endpoint, fault)| match fault {
        Some(fault) => format!("{endpoint}: {fault}"),
        None => {
            format!("{endpoint}: answers, but not as Zenoh: another service, or `tls/` is needed")
        }
    });
    let refused = seen.endpoints.iter().any(|(_, fault)| fault.is_some());
    let likely = if refused {
        "the router does not run (`ros2 run rmw_zenoh_cpp rmw_zenohd`), a firewall is between, or `connect` has \
         the wrong address"
    } else {
        "`connect` has the wrong port, or the wrong protocol"
    };
    Trouble::new(format!("{lost}router {all} cannot be reached"))
        .sees(tried)
        .likely(Some(likely.to_owned()))
}

/// Describes messages that arrive, but cannot be used.
fn unusable(expected: &Expected, fed: &Fed, stem: &str, own: Option<&Publication>) -> Trouble {
    if fed.undecodable > 0 {
        let reason = fed.reason.clone().unwrap_or_default();
        return Trouble::new(format!("the messages on {stem} are no {} in CDR", JointStateType::names()))
            .sees([reason])
            .likely(Some("the key carries another type, or its publisher does not encode with CDR (4 bytes of header, then the message)".to_owned()));
    }
    let found = own.map_or(&[][..], |own| &own.joints);
    if let Some((joint, field)) = &fed.never_finite {
        return Trouble::new(format!(
            "the joint states on {stem} have no {field} of joint `{joint}`: it is NaN or infinite in all of them"
        ))
        .likely(Some(format!(
            "the driver has no measurement yet, or does not measure the {field} of this joint: make the joint `fixed` \
             in the URDF"
        )));
    }
    if let Some(Twice {
        joint,
        entries: [first, second],
        ..
    }) = &fed.twice
    {
        return Trouble::new(format!(
            "the joint states on {stem} name joint `{joint}` twice, as entries {first} and {second} of `name`: they are refused"
        ))
        .likely(Some(
            "two lists of joints are joined in one message: let the driver send each joint once".to_owned(),
        ));
    }
    if fed.not_finite > 0 {
        return Trouble::new(format!("the joint states on {stem} hold NaN or infinity")).likely(
            Some("the driver has no measurement yet, or none of this field".to_owned()),
        );
    }
    if let Some(slip) = slip(&expected.joints, found) {
        let what = if fed.foreign > 0 {
            "name none of this robot's joints"
        } else {
            "do not name all of this robot's joints"
        };
        return Trouble::new(format!("the joint states on {stem} {what}")).likely(Some(slip));
    }
    if fed.incomplete > 0 {
        return Trouble::new(format!("the joint states on {stem} have no positions"));
    }
    if fed.stale > 0 {
        return Trouble::new(format!("the stamps of the joint states on {stem} do not advance"))
            .likely(Some("the publisher repeats one message, or two publishers with different clocks share the topic".to_owned()));
    }
    Trouble::new(format!("the joint states on {stem} make no whole sample"))
}

/// Describes another publication that was probably meant.
fn misnamed(expected: &Expected, seen: &Seen) -> Option<String> {
    let all = &seen.publications.by_key;
    if all.is_empty() {
        return Some(format!(
            "{} connected, but nothing is published: start the driver; ROS 2 must use rmw_zenoh, \
             or zenoh-bridge-ros2dds must run next to it",
            peers(seen.connected)
        ));
    }
    let topic = format!("/{}", expected.topic.trim_matches('/'));
    let states = || all.iter().filter(|(_, found)| found.is_joint_state());
    let here = |found: &Publication| match (&found.form, expected.scheme.keys) {
        (Form::Rmw { domain, .. }, Keys::RmwZenoh) => *domain == expected.scheme.domain,
        (Form::Plain, Keys::Ros2dds | Keys::Tauscope) => true,
        _ => false,
    };
    // First choice: the topic in another domain, namespace or kind of key.
    let same = states().find(|(key, found)| names(key, found, &topic));
    if let Some((key, found)) = same {
        return Some(same_topic(expected, key, found, &topic));
    }
    // Second choice: the topic with another type.
    let other_type = all
        .iter()
        .find(|(key, found)| here(found) && names(key, found, &topic));
    if let Some((
        _,
        Publication {
            type_name: Some(type_name),
            ..
        },
    )) = other_type
    {
        return Some(format!(
            "{topic} carries {type_name}, not {}",
            JointStateType::names()
        ));
    }
    let alike = states()
        .filter(|(_, found)| here(found))
        .map(|(key, found)| topic_of(expected, key, found))
        .map(|theirs| (strsim::jaro_winkler(&theirs, &topic), theirs))
        .max_by(|a, b| a.0.total_cmp(&b.0));
    match alike {
        Some((similarity, theirs)) if similarity >= LEAST_SIMILARITY => Some(format!(
            "the topic is {theirs}, you wrote {topic}: set `topics: {{state: {theirs}}}`"
        )),
        Some((_, theirs)) => Some(format!(
            "joint states are published on {theirs}: if these are meant, set `topics: {{state: {theirs}}}`"
        )),
        None => states().next().map(|(key, found)| scheme_of(key, found)),
    }
}

/// Whether a key names this topic, perhaps below a namespace.
fn names(key: &str, found: &Publication, topic: &str) -> bool {
    match &found.form {
        Form::Rmw { topic: theirs, .. } => theirs == topic,
        Form::Plain => format!("/{key}").ends_with(topic),
    }
}

/// Returns the topic as the pipeline file would name it.
fn topic_of(expected: &Expected, key: &str, found: &Publication) -> String {
    match &found.form {
        Form::Rmw { topic, .. } => topic.clone(),
        Form::Plain => {
            let below = key
                .strip_prefix(&expected.scheme.prefix)
                .filter(|rest| rest.starts_with('/'));
            below.map_or_else(|| format!("/{key}"), str::to_owned)
        }
    }
}

fn same_topic(expected: &Expected, key: &str, found: &Publication, topic: &str) -> String {
    match (&found.form, expected.scheme.keys) {
        (Form::Rmw { domain, .. }, Keys::RmwZenoh) => format!(
            "its publishers have ROS_DOMAIN_ID={domain}, the pipeline says {}: set `domain: {domain}`",
            expected.scheme.domain
        ),
        (Form::Plain, Keys::Ros2dds | Keys::Tauscope) => {
            let namespace = key
                .strip_suffix(topic.trim_start_matches('/'))
                .unwrap_or_default();
            let namespace = match namespace.trim_matches('/') {
                "" => "\"\"",
                namespace => namespace,
            };
            format!("the topic is published as {key}: set `namespace: {namespace}`")
        }
        _ => scheme_of(key, found),
    }
}

/// Describes the kind of a key, with the settings for it.
fn scheme_of(key: &str, found: &Publication) -> String {
    match &found.form {
        Form::Rmw { domain, topic } => format!(
            "{key} is a key of rmw_zenoh: set `keys: rmw_zenoh`, `domain: {domain}` and `topics: {{state: {topic}}}`"
        ),
        Form::Plain => {
            let (namespace, topic) = key.rsplit_once('/').unwrap_or(("\"\"", key));
            format!(
                "{key} is no key of rmw_zenoh, but of zenoh-bridge-ros2dds or of a program of your own: set \
                 `keys: ros2dds`, `namespace: {namespace}` and `topics: {{state: /{topic}}}`"
            )
        }
    }
}

/// Lists the observed keys, one per line: the expected key, then joint states, then all others.
fn lines(seen: &Seen, stem: &str) -> Vec<String> {
    let mut all: Vec<_> = seen.publications.by_key.iter().collect();
    all.sort_by_key(|(key, found)| (key.as_str() != stem, !found.is_joint_state()));
    let mut lines: Vec<String> = all
        .into_iter()
        .map(|(key, found)| line(key, found))
        .collect();
    if seen.publications.more > 0 {
        lines.push(format!(
            "{} messages of further keys",
            seen.publications.more
        ));
    }
    if lines.is_empty() && seen.connected > 0 {
        lines.push(format!("{} connected, no key", peers(seen.connected)));
    }
    lines
}

fn line(key: &str, found: &Publication) -> String {
    let mut facts = Vec::new();
    facts.extend(found.type_name.clone());
    if found.publishers() > 0 {
        facts.push(counted(found.publishers() as u64, "publisher"));
    }
    facts.push(match found.heard {
        0 => "no message".to_owned(),
        heard => counted(heard, "message"),
    });
    if !found.joints.is_empty() {
        facts.push(format!("joints {}", list(&found.joints)));
    }
    format!("{key} ({})", facts.join(", "))
}

fn counted(count: u64, what: &str) -> String {
    let plural = if count == 1 { "" } else { "s" };
    format!("{count} {what}{plural}")
}

fn peers(count: usize) -> String {
    let is = if count == 1 { "is" } else { "are" };
    format!("{} {is}", counted(count as u64, "Zenoh peer"))
}

#[cfg(test)]
mod tests;
